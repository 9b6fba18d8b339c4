"""Verdicts confirmed the long way: data are simulated with noise, and identified as measured ones would be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Measurement
from mofit.identifiability.comparison import Comparison
from mofit.identifiability.sources import SourceTest
from mofit.identifiability.statistics import groups
from mofit.identifiability.telling import Told
from mofit.kernel import Simulator
from mofit.model import Model, build_system
from mofit.progress import Progress, silent
from mofit.settings import Settings
from mofit.signals import NoiseProcess

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Posterior:
    """What an identification of simulated data says of a parameter: SI units; of the mode of most weight."""

    mean: float
    sd: float
    verdict: str
    modes: int
    converged: bool


def realise(parts: Sequence[NoiseProcess], rng: np.random.Generator) -> Array:
    """A draw of noise of independent parts, (n,), periodic over the record."""
    total = np.zeros(parts[0].count)
    for part in parts:
        white = np.fft.rfft(rng.standard_normal(part.count))
        total += part.level * np.fft.irfft(white * np.sqrt(part.spectrum), part.count)
    return total


def simulated_campaign(told: Told, tests: Sequence[str], seed: int) -> Campaign:
    """Named tests of a source and its calibration tests, simulated at the first parameter set, with noise."""
    source = told.source
    rng = np.random.default_rng(seed)
    measured: dict[str, Measurement] = {}
    for number, group in enumerate(groups(source.model)):
        own = [test for test in source.tests if test.group == number and (number > 0 or test.name in tests)]
        values = told.values[0, [source.space.index(parameter.name) for parameter in group.model.parameters]]
        for measurement in _measured(group.model, own, values, rng):
            measured.setdefault(measurement.name, measurement)  # a test that two groups use is measured once
    return Campaign("simulated", "simulated", {}, tuple(measured.values()))


def _measured(model: Model, tests: Sequence[SourceTest], values: Array, rng: np.random.Generator) -> list[Measurement]:
    if not tests:
        return []
    drives = [test.drive for test in tests]
    simulator = Simulator(build_system(model), drives, (), tolerance=1e-5, box=(values, values))
    units = {channel.name: channel.unit for channel in (*model.inputs, *model.outputs)}
    found = []
    for test, outputs in zip(tests, simulator.simulate(values[None]), strict=True):
        channels = {}
        for i, channel in enumerate(model.outputs):
            judged = test.drive.weights[:, i] > 0
            noisy = outputs[0, :, i].copy()
            noisy[judged] += realise(test.noise[i](outputs[0, :, i], judged), rng)
            # what is not judged gets noise as well, so that the start looks like the rest
            noisy[~judged] += rng.choice(noisy[judged] - outputs[0, judged, i], int(np.sum(~judged)))
            channels[channel.name] = noisy
        found.append(Measurement(test.procedure, channels, {**units}))
    return found


def confirm_by_posterior(
    comparison: Comparison, count: int, seed: int = 0, jobs: int = 1, progress: Progress = silent
) -> dict[str, Mapping[str, Posterior]]:
    """Identify simulated data of the procedures that know most of the parameters shown.

    Parameters
    ----------
    comparison
        Procedures, ranked by the mean logarithm of the relative standard deviations.
    count
        How many of them.
    seed, jobs
        Seed of noise and sampling; threads.
    progress
        Told what is being done.

    Returns
    -------
    dict
        By procedure and parameter.
    """
    ranked = sorted(
        comparison.judged, key=lambda row: float(np.mean([np.log(own.relative_sd) for own in row.entries.values()]))
    )
    found = {}
    for number, row in enumerate(ranked[:count]):
        progress("posterior", number, min(count, len(ranked)), row.procedure.name)
        told = comparison.told[row.procedure.source]
        campaign = simulated_campaign(told, row.procedure.tests, seed)
        found[row.procedure.name] = posterior(
            campaign, told.source.model, row.procedure.tests, Settings(seed=seed, jobs=jobs), comparison.parameters
        )
    return found


def posterior(
    campaign: Campaign, model: Model, tests: Sequence[str], settings: Settings, names: Sequence[str]
) -> Mapping[str, Posterior]:
    """Identify a campaign as `mofit identify` does; by parameter."""
    from mofit.identify import sampled_modes
    from mofit.settings import free_space
    from mofit.verdict import verdict

    modes = sampled_modes(campaign, model, settings, tuple(tests))
    best = max(modes, key=lambda mode: mode.weight)
    space = free_space(model, settings)
    points = best.chains.thinned().points.reshape(-1, len(space))
    values, words = space.from_unit(points), verdict(points)
    return {
        name: Posterior(
            mean=float(values[:, space.index(name)].mean()),
            sd=float(values[:, space.index(name)].std()),
            verdict=words[space.index(name)],
            modes=len(modes),
            converged=bool(best.chains.converged),
        )
        for name in names
    }
