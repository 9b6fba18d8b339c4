"""The next experiment: the sine that discriminates best between indistinguishable models, or that none does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, permutations, product

import numpy as np
from scipy.linalg import block_diag

from mofit._typing import FloatArray
from mofit.data import Experiment
from mofit.diagnosis.candidate_model import CandidateModel, probabilities
from mofit.diagnosis.expected_discrimination import LinearisedExperiment, linearise, rejection_probability
from mofit.diagnosis.expected_responses import expected_responses
from mofit.diagnosis.settings import NextExperimentSettings
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.diagnosis.whitening import Whitening
from mofit.models import Model
from mofit.runtime.parallel import forked_map
from mofit.simulation import first_input

#: Experiments that a process simulates together: two rows of lanes.
_TOGETHER = 16


@dataclass(frozen=True)
class NextExperiment:
    """An experiment, and the probability that it distinguishes the models.

    Parameters
    ----------
    kind, frequency, amplitude, duration, rate, conditions
        A sine [Hz, unit of the input, s], its sampling rate [Hz], and conditions that differ from the campaign's.
    separation
        Smallest expected difference of the criterion over all pairs, in favour of the right model.
    power
        Probability that one model alone is left, all others ten times less probable; expected over the models.
    resolves
        Whether the power is at least 0.95.
    discriminates
        Pairs of models that are distinguished with that probability, each by the names of its effects.
    sentence
        In words.
    """

    kind: str
    frequency: float
    amplitude: float
    duration: float
    rate: float
    conditions: Mapping[str, float]
    separation: float
    power: float
    resolves: bool
    discriminates: tuple[tuple[str, str], ...]
    sentence: str


def next_experiment(
    observed: WhitenedData, models: Sequence[CandidateModel], settings: NextExperimentSettings
) -> NextExperiment | None:
    """The sine that leaves the fewest of several models; None if there is one only, or no sine to vary.

    The models' present probabilities count; another experiment may follow where one is not enough.

    Parameters
    ----------
    observed
        The tests so far.
    models
        Models to discriminate between.
    settings
        What is tried.
    """
    usual = usual_sine(observed)
    if len({one.effects for one in models}) < 2 or usual is None:
        return None
    experiments = list(proposals(observed, usual, settings))
    prior = probabilities(models)
    shortest = [max(settings.shortest, settings.periods / float(one.frequency or 1)) for one in experiments]
    # no more samples at a high rate
    longest = [max(settings.longest * e.step / usual.step, s) for e, s in zip(experiments, shortest, strict=True)]

    def tried(part: slice) -> list[tuple[LinearisedExperiment, FloatArray]]:
        """Some experiments linearised at the fits, and the rejection probabilities of the longest ones."""
        responses = expected_responses(observed, [one.fitted for one in models], experiments[part], settings.settling)
        tests = [
            _linearised(observed, models, each, one) for *each, one in zip(*responses, experiments[part], strict=True)
        ]
        lengths = zip(tests, longest[part], strict=True)
        return [(test, _rejected(test, models, prior, seconds, settings)[1]) for test, seconds in lengths]

    parts = [slice(first, first + _TOGETHER) for first in range(0, len(experiments), _TOGETHER)]
    every = forked_map(tried, parts, observed.processes, name=str)
    tests, rejected = zip(*chain.from_iterable(every), strict=True)
    best = int(np.argmax([prior @ chances.sum(axis=1) for chances in rejected]))
    experiment, lengths = experiments[best], np.arange(shortest[best], longest[best] + 1, 10.0)
    found = [_rejected(tests[best], models, prior, seconds, settings) for seconds in lengths]
    alone = np.array([prior @ chances.prod(axis=1) for _, chances in found])
    gone = np.array([prior @ (chances * np.isfinite(means)).sum(axis=1) for means, chances in found])
    complete = alone[-1] >= settings.power
    enough = alone >= min(settings.aim, alone[-1]) if complete else gone >= settings.nearly * gone[-1]
    chosen = int(np.argmax(enough))
    (means, chances), power = found[chosen], float(alone[chosen])
    pairs = _distinguished(models, chances, prior, settings.power)
    conditions = {name: value for name, value in experiment.conditions.items() if value != usual.conditions.get(name)}
    proposed = NextExperiment(
        kind="sine",
        frequency=float(experiment.frequency or 0),
        amplitude=float(experiment.amplitude or 0),
        duration=float(lengths[chosen]),
        rate=round(1 / experiment.step, 6),
        conditions=conditions,
        separation=float(means.min()),
        power=power,
        resolves=power >= settings.power,
        discriminates=tuple(pair for pair, clear in pairs.items() if clear),
        sentence="",
    )
    what = _in_words(observed.problem.model, proposed, faster=experiment.step != usual.step)
    return replace(proposed, sentence=_sentence(proposed, what, len(pairs), models, settings))


def _rejected(
    test: LinearisedExperiment,
    models: Sequence[CandidateModel],
    prior: FloatArray,
    seconds: float,
    settings: NextExperimentSettings,
) -> tuple[FloatArray, FloatArray]:
    """Mean difference of the criterion, and rejection probability, by right and wrong model, (k, k)."""
    mean, variance = np.full((2, len(models), len(models)), np.inf)
    variance[:] = 1.0
    for right, wrong in permutations(range(len(models)), 2):
        if models[right].effects != models[wrong].effects:
            mean[right, wrong], variance[right, wrong] = test.discrimination(right, wrong, seconds)
    # a model that diverges in this experiment is neither ruled out by it nor rules out
    mean, variance = np.nan_to_num(mean, posinf=np.inf), np.nan_to_num(variance)
    return mean, rejection_probability(mean, variance, prior, settings.odds)


def _distinguished(
    models: Sequence[CandidateModel], chances: FloatArray, prior: FloatArray, power: float
) -> dict[tuple[str, str], bool]:
    """For every pair of different effects whether it is distinguished with that probability."""
    names = [" with ".join(one.effects) for one in models]
    found: dict[tuple[str, str], bool] = {}
    for i, j in combinations(range(len(models)), 2):
        if names[i] != names[j]:
            clear = chances[i, j] * prior[i] + chances[j, i] * prior[j] >= power * (prior[i] + prior[j])
            found[names[i], names[j]] = found.get((names[i], names[j]), True) and bool(clear)
    return found


def usual_sine(observed: WhitenedData) -> Experiment | None:
    """The fastest sine that repeats, at the usual speed and with the usual amplitude; None without any."""
    driver = first_input(observed.problem.model)
    sines = [
        (analysis.period, measurement.experiment)
        for measurement, analysis in zip(observed.problem.measurements, observed.problem.signals, strict=True)
        if measurement.kind == "sine" and analysis.period
    ]
    if not sines:
        return None
    speeds = [sine.conditions.get("longitudinal_velocity", 0.0) for _, sine in sines]
    speed = float(np.quantile(speeds, 0.5, method="nearest"))
    period, sine = min((one for one, own in zip(sines, speeds, strict=True) if own == speed), key=lambda one: one[0])
    amplitude = float(np.median([0.5 * np.ptp(one.inputs[driver]) for _, one in sines]))
    return replace(sine, frequency=1 / period, amplitude=amplitude)


def proposals(observed: WhitenedData, usual: Experiment, settings: NextExperimentSettings) -> Iterator[Experiment]:
    """Sines around the usual one, as short as they are simulated."""
    driver, own = first_input(observed.problem.model), usual.conditions
    speeds = settings.speeds if "longitudinal_velocity" in own else (1.0,)
    end = max((m.experiment.start_time or 0.0) + float(m.experiment.time[-1]) for m in observed.problem.measurements)
    for higher, size, faster in product(settings.frequencies, settings.amplitudes, speeds):
        frequency, amplitude = round(higher * float(usual.frequency or 0), 3), size * float(usual.amplitude or 0)
        rate = next((n for n in settings.rates if n >= frequency * usual.step * settings.samples_per_period), None)
        if rate is None or (rate > 1 and size > 1):
            continue
        step = usual.step / rate
        # as many samples at every rate
        count = max(min(settings.shortest / usual.step, settings.samples), settings.periods / (frequency * step))
        time = step * np.arange(round(count), dtype=np.float64)
        speed = {} if faster == 1.0 else {"longitudinal_velocity": round(faster * own["longitudinal_velocity"], 2)}
        yield replace(
            usual,
            name="next",
            time=time,
            inputs={driver: amplitude * np.sin(2 * np.pi * frequency * time)},
            conditions={**own, **speed},
            frequency=frequency,
            amplitude=amplitude,
            start_time=end if usual.start_time is not None else None,
        )


def _noise(observed: WhitenedData, experiment: Experiment, output: FloatArray) -> float:
    """Variance of a sample: that of the record with the most similar power, at the low frequencies that matter.

    The density of the noise is taken to be the same at a higher sampling rate.
    """
    strength = np.log(np.std(output) + 1e-300)

    def difference(record: tuple[int, int, Whitening]) -> float:
        channel = observed.problem.model.outputs[record[1]].name
        values = observed.problem.measurements[record[0]].channel(channel)
        return abs(float(np.log(np.std(values) + 1e-300) - strength))

    whitening = min((record for record in observed.records if record[1] == observed.first_output[0]), key=difference)[2]
    level = float(np.median(whitening.process.spectrum[: max(whitening.count // 8, 8)]))
    return level * whitening.step / experiment.step


def _linearised(
    observed: WhitenedData,
    models: Sequence[CandidateModel],
    responses: Sequence[tuple[FloatArray, FloatArray]],
    experiment: Experiment,
) -> LinearisedExperiment:
    """One experiment, linearised at the fits."""
    noise = np.sqrt(_noise(observed, experiment, responses[0][0]))
    derivatives, known = [], []
    for (_, columns), fitted in zip(responses, (one.fitted for one in models), strict=True):
        new = columns.shape[1] - len(fitted.free)
        derivatives.append(columns[:, np.append(fitted.free, np.ones(new, dtype=bool))] / noise)
        # of the new test's own values only the box is known
        known.append(block_diag(fitted.hessian, np.eye(new)))
    length = float(experiment.time[-1] + experiment.step)
    return linearise([output / noise for output, _ in responses], derivatives, known, length)


def _in_words(model: Model, proposed: NextExperiment, *, faster: bool) -> str:
    """The experiment in words, with its sampling rate where that is ``faster`` than usual."""
    driver = first_input(model)
    unit = next(channel.unit for channel in model.inputs if channel.name == driver)
    units = {condition.name: condition.unit for condition in model.conditions}
    parts = [f"a sine of {proposed.frequency:g} Hz", f"amplitude {proposed.amplitude:.4g} {unit}"]
    parts += [f"{n.replace('_', ' ')} {x:g} {units.get(n, '')}".rstrip() for n, x in proposed.conditions.items()]
    parts += [f"sampled at {proposed.rate:g} Hz"] if faster else []
    return ", ".join([*parts, f"for {proposed.duration:g} s"])


def _sentence(
    proposed: NextExperiment, what: str, pairs: int, models: Sequence[CandidateModel], settings: NextExperimentSettings
) -> str:
    if proposed.resolves:
        return f"Next experiment: {what}."
    *names, last = dict.fromkeys(" with ".join(one.effects) for one in models)
    who, clear = f"{', '.join(names)} and {last}", len(proposed.discriminates)
    percent = f"{100 * proposed.power:.0f} %"
    if clear:
        return f"Next experiment: {what}. It distinguishes {clear} of {pairs} pairs of {who}. Then diagnose again."
    if proposed.power >= settings.worthwhile:
        leaves = f"With a probability of {percent} it leaves one of {who}"
        return f"Next experiment: {what}. {leaves}. Then diagnose again."
    best = f"The best of those tried is {what}, with a probability of {percent}"
    return f"No sine distinguishes them reliably. {best}. Measure or calibrate {who} instead."
