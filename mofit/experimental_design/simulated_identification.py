"""Expected uncertainty checked by simulation: data are simulated with noise, and identified as measured ones are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Measurement
from mofit.data.signals import NoiseProcess
from mofit.experimental_design.information import SourceInformation
from mofit.experimental_design.planned_tests import DesignTest, groups
from mofit.identification.settings import Settings
from mofit.models import Model, build_system
from mofit.simulation import Simulator

#: Error of the simulated data relative to the output's range; noise is far larger.
_TOLERANCE = 1e-5


@dataclass(frozen=True)
class SimulatedEstimate:
    """Posterior of a parameter from simulated data: SI units; of the mode of largest probability."""

    mean: float
    sd: float
    verdict: str
    modes: int
    converged: bool


def draw_noise(parts: Sequence[NoiseProcess], rng: np.random.Generator) -> FloatArray:
    """A draw of noise of independent parts, (n,), periodic over the record."""
    total = np.zeros(parts[0].count)
    for part in parts:
        white = np.fft.rfft(rng.standard_normal(part.count))
        total += part.level * np.fft.irfft(white * np.sqrt(part.spectrum), part.count)
    return total


def simulated_campaign(known: SourceInformation, tests: Sequence[str], seed: int) -> Campaign:
    """Named tests of a source and its calibration tests, simulated at the reference values, with noise."""
    source = known.source
    rng = np.random.default_rng(seed)
    measured: dict[str, Measurement] = {}
    for number, group in enumerate(groups(source.model)):
        own = [test for test in source.tests if test.group == number and (number > 0 or test.name in tests)]
        values = known.samples[0, [source.space.index(parameter.name) for parameter in group.model.parameters]]
        for measurement in _measured(group.model, own, values, rng):
            measured.setdefault(measurement.name, measurement)  # a test that two groups use is measured once
    return Campaign("simulated", "simulated", {}, tuple(measured.values()))


def _measured(
    model: Model, tests: Sequence[DesignTest], values: FloatArray, rng: np.random.Generator
) -> list[Measurement]:
    if not tests:
        return []
    simulator = Simulator(
        build_system(model), [test.data for test in tests], (), tolerance=_TOLERANCE, box=(values, values)
    )
    units = {channel.name: channel.unit for channel in (*model.inputs, *model.outputs)}
    found = []
    for test, outputs in zip(tests, simulator.simulate(values[None]), strict=True):
        channels = {}
        for i in test.data.fitted:
            channel, used = model.outputs[i], test.data.weights[:, i] > 0
            noisy = outputs[0, :, i].copy()
            noisy[used] += draw_noise(test.noise[i](outputs[0, :, i], used), rng)
            # samples outside the fit get noise as well, so that the start looks like the rest
            noisy[~used] += rng.choice(noisy[used] - outputs[0, used, i], int(np.sum(~used)))
            channels[channel.name] = noisy
        found.append(Measurement(test.experiment, channels, units))
    return found


def simulated_estimates(
    campaign: Campaign, model: Model, tests: Sequence[str], settings: Settings, names: Sequence[str]
) -> Mapping[str, SimulatedEstimate]:
    """Identify a campaign as `mofit identify` does; estimates by parameter."""
    from mofit.identification.stages import find_modes
    from mofit.sampling import verdict

    modes = find_modes(campaign, model, settings, tests)
    best = max(modes, key=lambda mode: mode.probability)
    space = best.sampled.space
    points = best.chains.thinned().points.reshape(-1, len(space))
    values, words = space.from_unit(points), verdict(points, space.log_width)
    return {
        name: SimulatedEstimate(
            mean=float(values[:, space.index(name)].mean()),
            sd=float(values[:, space.index(name)].std()),
            verdict=words[space.index(name)],
            modes=len(modes),
            converged=bool(best.chains.converged),
        )
        for name in names
    }
