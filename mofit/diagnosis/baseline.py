"""The baseline: the model without effects, fitted to the tests with the noise that it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.stats import qmc

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.diagnosis.baseline_starts import best_points
from mofit.diagnosis.few_periods import at_steps_for
from mofit.diagnosis.fitting import Fitted, fit
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.input_prediction import with_noise_beside_prediction
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.noise_memory import with_common_memory
from mofit.diagnosis.scoped_starts import with_scoped
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.errors import InputError
from mofit.identification.calibration import calibrated_values
from mofit.identification.problem_setup import ProblemSetup, set_up_problem
from mofit.identification.settings import Settings
from mofit.identification.steady_start import leads_said, led_in, steady_from_start
from mofit.identification.widening import MOST, WORTH, beyond_ends, widenings
from mofit.models import Model
from mofit.parameters import ParameterSpace
from mofit.problem import explained

#: Starts of the baseline beside those given, the most minima of a search among these, and starts of a further round.
_STARTS, _MINIMA, _FURTHER = 7, 8, 31
#: Descents that must end in the best minimum, and the most further rounds until they do: n descents, m of which end
#: there, miss one that is half as common with a chance of (1 - m / (2 n))^n, at most exp(-m / 2) or 5 %.
#: Where fewer than `_LEAST` do even then, the box is searched.
_AGREEING, _ROUNDS, _LEAST = 6, 4, 2
#: Rounds in which the baseline and the noise of records that do not repeat are estimated in turn.
_NOISE_ROUNDS = 2
#: Least share of the noise's power that a residual holds where that is noise: it is known better than to a factor of 2.
_FALSE = 0.5


def set_up(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    simulators: SimulatorCache | None = None,
    space: ParameterSpace | None = None,
) -> tuple[WhitenedData, FloatArray]:
    """The whitened tests, and starts (k, d): the nominal point, and the best points of a sample of the box.

    Parameters with a calibration start at its values.
    """
    return _started(set_up_problem(model, campaign, settings, tests, space=space), simulators)


def _whitened(setup: ProblemSetup, simulators: SimulatorCache | None) -> WhitenedData:
    return whiten(setup.posterior.main, setup.calibrations, simulators or SimulatorCache(setup.settings.jobs))


def _started(setup: ProblemSetup, simulators: SimulatorCache | None) -> tuple[WhitenedData, FloatArray]:
    problem, known = setup.posterior.main, calibrated_values(setup.calibrations)
    values = [known.get(p.name, p.nominal) for p in problem.space.parameters]
    if problem.evaluations is None:
        starts = np.clip(problem.space.to_unit(np.vstack([values, best_points(setup)])), 0.0, 1.0)
    else:  # of a simulator the best alone: descents from elsewhere cost more than they may find
        starts = _minima(setup, 1)
    return _whitened(setup, simulators), starts


def _minima(setup: ProblemSetup, most: int) -> FloatArray:
    """Starts (k, d): the best minima that the search finds."""
    from mofit.identification.stages import search  # late: few baselines are searched for

    found, _ = search(setup.searched, setup.settings)
    space = setup.posterior.main.space
    values = setup.searched.layout.values(found.archived_points[:most], space.names)
    return np.clip(space.to_unit(values), 0.0, 1.0)


def _first_fit(setup: ProblemSetup, simulators: SimulatorCache) -> Fitted:
    """The baseline from the best points of a sample and from others, until enough agree; else after a search."""
    observed, starts = _started(setup, simulators)
    seed, agreeing, found = setup.settings.seed, 0, list[Fitted]()
    with suppress(InputError):
        first = fit_baseline(observed, starts, seed)
        if observed.problem.evaluations is not None:  # it was searched
            return first
        best, agreeing = _agreed(first, seed)
        found.append(best)
    if agreeing < _LEAST:
        minima = _minima(setup, _MINIMA)
        found.append(fit_baseline(observed, minima if len(minima) else starts, seed))
    return min(found, key=_value)


def _agreed(best: Fitted, seed: int) -> tuple[Fitted, int]:
    """The best minimum from further points until enough descents end there, and how many do.

    What few descents of twenty find may hide a minimum that none has found.
    """
    agreeing = len(best.minimum.members)
    for number in range(_ROUNDS):
        if agreeing >= _AGREEING:
            break
        rng = np.random.default_rng([seed, number])
        again = fit_baseline(best.hypothesis.observed, best.minimum.point, rng, _FURTHER)
        # the first start is the best minimum so far
        same = 0 in again.minimum.members
        agreeing = len(again.minimum.members) + (agreeing - 1 if same else 0)
        best = min(best, again, key=_value)
    return best, agreeing


def _value(fitted: Fitted) -> float:
    return fitted.minimum.value


def baseline_in_wide_ranges(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    simulators: SimulatorCache | None = None,
) -> tuple[Fitted, tuple[str, ...]]:
    """The model without effects, fitted in ranges wide enough for it; and what was widened or led in, in sentences."""
    cache = simulators or SimulatorCache(settings.jobs)
    setup = set_up_problem(model, campaign, settings, tests)
    found, notes = _first_fit(setup, cache), list[str]()
    point = found.minimum.point[: len(found.hypothesis.observed.problem.space)]
    if steady_from_start(setup.posterior.main):  # else the noise at the point is not worth its cost
        # its steps for this point alone: to calibrate those of the whole box takes several times as long
        here = setup.posterior.near(point[None], np.zeros(len(point)))
        led = led_in(setup, here.with_noise_at(point), replace(found.minimum, point=point))
        if led is not None:
            notes += leads_said(setup, led[0])
            setup, point = led
            found = fit_baseline(_whitened(setup, cache), point, settings.seed)
    first = space = found.hypothesis.observed.problem.space
    for _ in range(MOST):
        sides, values = found.minimum.at_bound[: len(space)], space.from_unit(found.minimum.point[: len(space)])
        farther = space.farther(sides)
        if farther == space:
            break
        known, observed = setup.calibrations, found.hypothesis.observed
        wider = set_up_problem(model, campaign, settings, tests, space=farther, done=known, leads=setup.leads)
        # the noise of the records stays
        problem, _, stages = with_common_memory(wider.posterior.main, observed.records, wider.calibrations)
        same = replace(observed, problem=problem, calibrations=stages)
        again = fit_baseline(same, beyond_ends(space, farther, values, sides), settings.seed)
        if found.minimum.value - again.minimum.value <= WORTH:
            break
        found, space = again, farther
    found = with_own_noise(_without_false_noise(found, settings.seed), settings.seed)
    return found, (*notes, *map(str, widenings(first, space)))


def _without_false_noise(found: Fitted, seed: int) -> Fitted:
    """The baseline with records that ring up, say, taken as ones that do not repeat.

    What changes there from period to period is no noise: the model follows it.
    """
    observed = found.hypothesis.observed
    signals, false = list(observed.problem.signals), False
    for i, (test, _, w) in enumerate(observed.records):
        residual = w.signal(found.residual[: len(observed.measured)][observed.record == i])
        if w.periods and np.var(residual) < _FALSE * w.noise_sd**2:
            signals[test], false = replace(signals[test], period=None, periods=0), True
    if not false:
        return found
    problem = replace(observed.problem, signals=tuple(signals))
    again = whiten(problem, observed.calibrations, observed.simulators)
    return fit_baseline(again, found.minimum.point[: len(problem.space)], seed)


def with_own_noise(found: Fitted, seed: int) -> Fitted:
    """The baseline fitted again with the noise that it leaves of records that do not repeat."""
    for _ in range(_NOISE_ROUNDS if found.hypothesis.observed.predicted_only.any() else 0):
        found = fit_baseline(with_noise_of(found), found.minimum.point, seed)
    return found


def with_noise_of(found: Fitted) -> WhitenedData:
    """The tests with the noise that a fit leaves of records that do not repeat."""
    simulated = [outputs[0] for outputs, _ in found.hypothesis.outputs(found.minimum.point[None])]
    return with_noise_beside_prediction(found.hypothesis.observed, simulated)


def fit_baseline(
    observed: WhitenedData, starts: FloatArray, rng: int | np.random.Generator, further: int = _STARTS
) -> Fitted:
    """Fit the model as it is, from starts (k, d) or one, and from Sobol points over parameters without calibration.

    They are those of the campaign; from each the others start at what is best there. The minimum's ``members`` are the
    starts whose descents ended there.
    """
    model, starts = hypothesis(observed), np.atleast_2d(starts)[:, : len(observed.problem.space)]
    start, searched = starts[0], np.ones(starts.shape[1], dtype=bool)
    searched[[model.space.index(name) for name in observed.problem.prior.names]] = False
    scattered = qmc.Sobol(len(start), rng=rng).random(further + 1)[:further]  # a power of two is balanced
    if observed.problem.evaluations is None:  # a simulator was searched
        starts = np.concatenate([starts, np.where(searched, scattered, start)])
    starts = with_scoped(model, starts)
    model = at_steps_for(model, starts[:1])
    with explained(observed.problem):
        first = fit(model, starts)
    # the minimum may be stiffer than the start
    model = at_steps_for(model, first.minimum.point[None], model.steps)
    found = fit(model, first.minimum.point[None]).without_tables()
    return replace(found, minimum=replace(found.minimum, members=first.minimum.members))
