"""The cheapest single test that would make a parameter identifiable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mofit.data import Experiment
from mofit.experimental_design.candidates import driven_input, shown_unit
from mofit.experimental_design.identifiability import identifiability, is_identifiable, relative_size
from mofit.experimental_design.information import SourceInformation, estimator_precision, information
from mofit.experimental_design.planned_tests import group_of, planned_tests
from mofit.experimental_design.sources import Source
from mofit.simulation.virtual_rig.signals import excitation


@dataclass(frozen=True)
class AugmentationSettings:
    """The tests that are tried."""

    seconds: float = 20.0
    """Duration of every candidate: long enough for slow sines, short enough to be cheap."""
    repeats: tuple[int, ...] = (1, 2, 3, 6, 15, 30)
    """How often it may be run: up to ten minutes."""
    frequencies: int = 12
    beyond: float = 4.0
    """Sine frequencies, and how far beyond the known ones they reach, each way."""
    amplitudes: tuple[float, ...] = (0.5, 1.0)
    """Shares of the largest known amplitude."""
    periods: float = 3.0
    samples_per_period: float = 20.0
    """Fewest of the slowest and of the fastest sine."""
    unknown: tuple[float, float] = (0.3, 3.0)
    """Frequencies where the known tests have none [Hz]."""


SETTINGS = AugmentationSettings()
#: Tests that are tried, at most: sines, a chirp and a step of each amplitude.
CANDIDATES = len(SETTINGS.amplitudes) * (SETTINGS.frequencies + 2)


@dataclass(frozen=True)
class Augmentation:
    """A test in words, how often it has to be run, its time in all [s], and the standard deviation with it."""

    test: str
    repeats: int
    seconds: float
    sd: float


def cheapest_augmentation(
    known: SourceInformation, tests: Sequence[str], name: str, jobs: int = 1
) -> Augmentation | None:
    """The sine, chirp or step that, added to some tests, makes a parameter identifiable in the least time.

    The tests are those that count beside the calibration stages. Of equal times the one of least standard deviation;
    None where none helps within ten minutes. At the reference values, with amplitudes and sampling of the known tests.
    """
    source, values = known.source, known.samples[:1]
    place = source.space.index(name)
    experiments = list(_candidates(source))
    planned = planned_tests(source.model, experiments, values[0], source.noise, jobs=jobs)
    found = information(source.model, planned, values, known.derivative[:1], jobs)
    base = known.estimator(tests)[:1]
    size = relative_size(source.space, values)[0, place]
    for repeats in SETTINGS.repeats:
        sd = np.array([
            identifiability(estimator_precision(base + repeats * each), values, source.space).sd[0, place]
            for each in found.estimator
        ])  # fmt: skip
        best = int(np.argmin(sd))
        if is_identifiable(sd[best], size):
            total = float(sd[best] * known.derivative[0, place])
            return Augmentation(experiments[best].name, repeats, repeats * SETTINGS.seconds, total)
    return None


def _candidates(source: Source) -> Iterator[Experiment]:
    """Tests of the main identification, named by what they are."""
    known = [test.experiment for test in source.main]
    driven = driven_input(source.model)
    rate = max(1 / test.step for test in known)
    largest = max(float(np.max(np.abs(test.inputs[driven.name]))) for test in known)
    own = [test.frequency for test in known if test.frequency] or SETTINGS.unknown
    low = max(min(own) / SETTINGS.beyond, SETTINGS.periods / SETTINGS.seconds)
    high = min(max(own) * SETTINGS.beyond, rate / SETTINGS.samples_per_period)
    unit, factor = shown_unit(driven.unit)
    for share in SETTINGS.amplitudes:
        size = f"amplitude {factor * share * largest:.3g} {unit}"
        tests = [("sine", f"sine of {frequency:.2g} Hz, {size}", {"frequency": float(f"{frequency:.2g}")})
                 for frequency in np.geomspace(low, high, SETTINGS.frequencies)]  # fmt: skip
        sweep = {"frequency": low, "last_frequency": high}
        tests.append(("chirp", f"chirp from {low:.2g} to {high:.2g} Hz, {size}", sweep))
        tests.append(("step", f"step, {size}", {"ramp_rate": 10 * largest, "delay": 0.5}))
        for kind, words, numbers in tests:
            if group_of(source.model, kind) == 0:
                every = {"sample_rate": rate, "duration": SETTINGS.seconds, "amplitude": share * largest, **numbers}
                signal = excitation(kind, every, None, np.random.default_rng(0))
                yield Experiment(
                    words, kind, signal.time, {driven.name: signal.values}, known[0].conditions, signal.frequency,
                    every["amplitude"], interpolation=signal.interpolation,
                )  # fmt: skip
