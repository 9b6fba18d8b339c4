"""The cheapest single test that would make a parameter identifiable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Procedure as Test
from mofit.identifiability.comparison import Procedure
from mofit.identifiability.fisher import sensitivities
from mofit.identifiability.limits import driven_input
from mofit.identifiability.noise import DEFAULT_NOISE
from mofit.identifiability.procedures import planned_drives
from mofit.identifiability.statistics import group_of, groups, precision
from mofit.identifiability.telling import Told
from mofit.identifiability.verdicts import good, relative_size, spread
from mofit.model import build_system
from mofit.simulate.excitation import excitation

Array = NDArray[np.float64]

#: Duration of every candidate [s]; each may be repeated so often.
SECONDS = 20.0
_REPEATS = (1, 2, 3, 6, 15, 30)
#: Sine frequencies that are tried, and how far beyond those known they reach.
_FREQUENCIES = 12
_BEYOND = 4.0
#: Amplitudes, as shares of the largest of the known tests.
_AMPLITUDES = (0.5, 1.0)
#: Samples per period that the fastest sine still has.
_FINEST = 20.0


@dataclass(frozen=True)
class Mend:
    """A test that helps: in words, how often it has to be run, what it costs [s], and the standard deviation then."""

    words: str
    repeats: int
    seconds: float
    sd: float


def cheapest_mend(told: Told, procedure: Procedure, name: str, jobs: int = 1) -> Mend | None:
    """The sine, chirp or step that makes a parameter identifiable in the least time, added to a procedure.

    Of equal times the one of least standard deviation; None where none helps within ten minutes. At the first parameter
    set, with amplitudes and sampling of the tests that there are.
    """
    source = told.source
    names = source.space.names
    place = names.index(name)
    candidates = list(_candidates(told))
    drives = planned_drives(source.model, [test for _, test in candidates], told.values[0], jobs)
    noises = [source.noise.get(channel.name, DEFAULT_NOISE) for channel in source.model.outputs]
    found = sensitivities(build_system(source.model), drives, told.values[:1], [noises] * len(drives), names, jobs)
    square = np.outer(told.stretch[0], told.stretch[0])
    own = np.zeros((len(candidates), 1, len(groups(source.model)), 2, len(names), len(names)))
    for number, test in enumerate(found):
        own[number, :, 0] = np.stack([test.normal * square, test.scatter * square], axis=1)
    chosen = [i for i, test in enumerate(source.tests) if test.group > 0 or test.name in procedure.tests]
    known = told.sums[chosen, :1].sum(axis=0)
    size = relative_size(source.space, told.values[:1])[0, place]
    for repeats in _REPEATS:
        sd = np.array([
            spread(precision(known + repeats * each), told.values[:1], source.space).sd[0, place] for each in own
        ])  # fmt: skip
        best = int(np.argmin(sd))
        if good(sd[best], size):
            return Mend(candidates[best][0], repeats, repeats * SECONDS, float(sd[best] * told.stretch[0, place]))
    return None


def _candidates(told: Told) -> Iterator[tuple[str, Test]]:
    source = told.source
    known = [test.procedure for test in source.main]
    driven, unit = driven_input(source.model)
    rate = max(1 / test.step for test in known)
    largest = max(float(np.max(np.abs(test.inputs[driven]))) for test in known)
    own = [test.frequency for test in known if test.frequency] or [0.3, 3.0]
    low, high = max(min(own) / _BEYOND, 3 / SECONDS), min(max(own) * _BEYOND, rate / _FINEST)
    settings = {"sample_rate": rate, "duration": SECONDS}
    scale, shown = (180 / np.pi, "deg") if unit == "rad" else (1.0, unit)
    for share in _AMPLITUDES:
        size = f"amplitude {scale * share * largest:.3g} {shown}"
        for frequency in np.geomspace(low, high, _FREQUENCIES):
            values = {**settings, "amplitude": share * largest, "frequency": float(f"{frequency:.2g}")}
            words = f"sine of {frequency:.2g} Hz, {size}"
            yield words, _test(told, words, "sine", values)
        chirp = {**settings, "amplitude": share * largest, "frequency": low, "last_frequency": high}
        words = f"chirp from {low:.2g} to {high:.2g} Hz, {size}"
        yield words, _test(told, words, "chirp", chirp)
        if group_of(source.model, "step") == 0:
            step = {**settings, "amplitude": share * largest, "ramp_rate": 10 * largest, "delay": 0.5}
            yield f"step, {size}", _test(told, f"step, {size}", "step", step)


def _test(told: Told, name: str, kind: str, values: dict[str, float]) -> Test:
    signal = excitation(kind, values, None, np.random.default_rng(0))
    driven, _ = driven_input(told.source.model)
    conditions = told.source.main[0].procedure.conditions
    inputs = {driven: signal.values}
    return Test(name, kind, signal.time, inputs, conditions, signal.frequency, values["amplitude"], hold=signal.hold)
