"""The cheapest single test that would make a parameter identifiable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mofit.data import Experiment
from mofit.design.identifiability import identifiability, is_identifiable, relative_size
from mofit.design.information import SourceInformation, estimator_precision, information
from mofit.design.planned_tests import group_of, planned_tests
from mofit.design.rig_limits import driven_input
from mofit.design.sources import Source
from mofit.simulation.virtual_rig.signals import excitation


@dataclass(frozen=True)
class AugmentationSettings:
    """The tests that are tried.

    Parameters
    ----------
    seconds
        Duration of every candidate: long enough for slow sines, short enough to be cheap.
    repeats
        How often it may be run: up to ten minutes.
    frequencies, beyond
        Sine frequencies, and how far beyond the known ones they reach, each way.
    amplitudes
        Shares of the largest known amplitude.
    periods, samples_per_period
        Fewest of the slowest and of the fastest sine.
    unknown
        Frequencies where the known tests have none [Hz].
    """

    seconds: float = 20.0
    repeats: tuple[int, ...] = (1, 2, 3, 6, 15, 30)
    frequencies: int = 12
    beyond: float = 4.0
    amplitudes: tuple[float, ...] = (0.5, 1.0)
    periods: float = 3.0
    samples_per_period: float = 20.0
    unknown: tuple[float, float] = (0.3, 3.0)


_SETTINGS = AugmentationSettings()


@dataclass(frozen=True)
class Augmentation:
    """A test in words, how often it has to be run, its time in all [s], and the standard deviation with it."""

    test: str
    repeats: int
    seconds: float
    sd: float


def cheapest_augmentation(
    known: SourceInformation,
    tests: tuple[str, ...],
    name: str,
    jobs: int = 1,
    settings: AugmentationSettings = _SETTINGS,
) -> Augmentation | None:
    """The sine, chirp or step that, added to some tests, makes a parameter identifiable in the least time.

    Of equal times the one of least standard deviation; None where none helps within ten minutes. At the reference
    values, with amplitudes and sampling of the tests that there are.

    Parameters
    ----------
    known
        Information of the tests that there are.
    tests
        Names of those that count, beside the calibration stages.
    name
        The parameter.
    jobs
        Threads.
    settings
        The tests that are tried.
    """
    source, values = known.source, known.samples[:1]
    place = source.space.index(name)
    experiments = list(_candidates(source, settings))
    planned = planned_tests(source.model, experiments, values[0], source.noise, jobs=jobs)
    found = information(source.model, planned, values, known.derivative[:1], jobs)
    base = known.estimator(tests)[:1]
    size = relative_size(source.space, values)[0, place]
    for repeats in settings.repeats:
        sd = np.array([
            identifiability(estimator_precision(base + repeats * each), values, source.space).sd[0, place]
            for each in found.estimator
        ])  # fmt: skip
        best = int(np.argmin(sd))
        if is_identifiable(sd[best], size):
            total = float(sd[best] * known.derivative[0, place])
            return Augmentation(experiments[best].name, repeats, repeats * settings.seconds, total)
    return None


def _candidates(source: Source, settings: AugmentationSettings) -> Iterator[Experiment]:
    """Tests of the main identification, named by what they are."""
    known = [test.experiment for test in source.main]
    driven, unit = driven_input(source.model)
    rate = max(1 / test.step for test in known)
    largest = max(float(np.max(np.abs(test.inputs[driven]))) for test in known)
    own = [test.frequency for test in known if test.frequency] or settings.unknown
    low = max(min(own) / settings.beyond, settings.periods / settings.seconds)
    high = min(max(own) * settings.beyond, rate / settings.samples_per_period)
    scale, shown = (180 / np.pi, "deg") if unit == "rad" else (1.0, unit)
    for share in settings.amplitudes:
        size = f"amplitude {scale * share * largest:.3g} {shown}"
        tests = [("sine", f"sine of {frequency:.2g} Hz, {size}", {"frequency": float(f"{frequency:.2g}")})
                 for frequency in np.geomspace(low, high, settings.frequencies)]  # fmt: skip
        sweep = {"frequency": low, "last_frequency": high}
        tests.append(("chirp", f"chirp from {low:.2g} to {high:.2g} Hz, {size}", sweep))
        tests.append(("step", f"step, {size}", {"ramp_rate": 10 * largest, "delay": 0.5}))
        for kind, words, numbers in tests:
            if group_of(source.model, kind) == 0:
                every = {"sample_rate": rate, "duration": settings.seconds, "amplitude": share * largest, **numbers}
                signal = excitation(kind, every, None, np.random.default_rng(0))
                yield Experiment(
                    words, kind, signal.time, {driven: signal.values}, known[0].conditions, signal.frequency,
                    every["amplitude"], interpolation=signal.interpolation,
                )  # fmt: skip
