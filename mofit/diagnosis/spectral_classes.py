"""Classes of spectral lines: which lines of a record may hold which kind of discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.diagnosis.settings import SpectralSettings
from mofit.diagnosis.whitening import Whitening

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Lines:
    """The lines of one record, and what they are classed by; masks have shape (lines,).

    Parameters
    ----------
    whitening
        Of the record.
    orders
        Frequencies of what rotates, Hz; see `rotational_orders`.
    excitation
        The exciting input over the samples used, (n,).
    interference
        Lines of a sinusoid common to all tests (`mofit.diagnosis.periodic_disturbances`).
    settings
        Limits of the classes.
    """

    whitening: Whitening
    orders: Mapping[str, float]
    excitation: FloatArray
    interference: Mask
    settings: SpectralSettings

    @cached_property
    def number(self) -> NDArray[np.int64]:
        """Number of every line: its frequency times the record's length."""
        return np.arange(len(self.whitening.frequencies))

    def harmonics(self, remainder: int) -> Mask:
        """Low harmonics of the excitation, those of which the number halved leaves this remainder."""
        if not self.whitening.periods:
            return np.zeros(len(self.number), dtype=bool)
        harmonic, rest = np.divmod(self.number, self.whitening.periods)
        return (rest == 0) & (harmonic <= self.settings.harmonics) & (harmonic % 2 == remainder)

    @cached_property
    def subharmonics(self) -> Mask:
        """Odd multiples of half the excitation's frequency."""
        m = self.whitening.periods
        if m <= 2:
            return np.zeros(len(self.number), dtype=bool)
        half = 2 * self.number / m
        # of an odd number of periods the two lines beside
        nearest = np.abs(half - (2 * np.round((half - 1) / 2) + 1)) < 1.5 / m
        return np.asarray(nearest & (half < 2 * self.settings.subharmonics))

    @cached_property
    def slow(self) -> Mask:
        """Lines far below the excitation, and its nearest neighbours."""
        m, away = self.whitening.periods, np.abs(self.number - self.whitening.periods)
        if not m:
            return np.zeros(len(self.number), dtype=bool)
        return np.asarray((self.number < m / 2) | ((away <= self.settings.modulation) & (away < m / 2)))

    @cached_property
    def excited(self) -> Mask:
        """Without a period: up to twice the highest line that the input's power reaches."""
        if self.whitening.periods:
            return np.zeros(len(self.number), dtype=bool)
        power = np.abs(np.fft.rfft(self.excitation - self.excitation.mean())) ** 2
        order = np.argsort(-power, kind="stable")
        most = int(np.searchsorted(np.cumsum(power[order]), self.settings.excited_power * power.sum())) + 1
        # a sparsely filled band counts as a whole: harmonics of its lines fall between them
        return np.asarray(self.number <= 2 * int(order[:most].max()))

    @cached_property
    def rotating(self) -> Mask:
        """Lines of wheel and drum order and their sidebands, but for slow and excited ones."""
        m, spacing = self.whitening.periods, 1 / (self.whitening.count * self.whitening.step)
        near = np.zeros(len(self.number), dtype=bool)
        for frequency in self.orders.values():
            for sideband in (-1, 0, 1) if m else (0,):
                place = (frequency + sideband * m * spacing) / spacing
                near |= np.abs(self.number - place) < self.settings.leakage
        return near & ~self.slow & ~self.excited


@dataclass(frozen=True)
class SpectralClass:
    """A class of spectral lines.

    Parameters
    ----------
    name
        As in JSON.
    label
        Head of a column of the residual map.
    phrase
        For sentences: what a gap on these lines is seen in.
    definition
        For the documentation.
    holds
        The lines of a record that may belong to it; a line belongs to the first class that holds it.
    """

    name: str
    label: str
    phrase: str
    definition: str
    holds: Callable[[Lines], Mask]


#: In order of precedence.
SPECTRAL_CLASSES = (
    SpectralClass("dc", "constant", "the constant", "zero frequency", lambda lines: lines.number == 0),
    SpectralClass(
        "odd", "odd", "odd harmonics", "odd harmonics of the excitation, up to the tenth",
        lambda lines: lines.harmonics(1),
    ),
    SpectralClass(
        "even", "even", "even harmonics", "even harmonics of the excitation, up to the tenth",
        lambda lines: lines.harmonics(0),
    ),
    SpectralClass(
        "subharmonic", "half", "subharmonics", "odd multiples of half the excitation's frequency, up to the fifth",
        lambda lines: lines.subharmonics,
    ),
    SpectralClass(
        "rotating", "wheel,\ndrum", "rotational orders",
        "wheel and drum order, and their sidebands at ± the excitation",
        lambda lines: lines.rotating,
    ),
    SpectralClass(
        "slow", "slow", "slow changes", "below half the excitation's frequency, and two lines on each side of it",
        lambda lines: lines.slow,
    ),
    SpectralClass(
        "steady", "inter-\nference", "sinusoidal interference",
        "a frequency that exceeds the noise of all tests together, whatever excites them: mains, a gear",
        lambda lines: lines.interference,
    ),
    SpectralClass(
        "excited", "excited", "the excited band", "without a period: lines that the input excites, and their harmonics",
        lambda lines: lines.excited,
    ),
    SpectralClass(
        "other", "other", "other lines", "all other lines: noise, in every model",
        lambda lines: np.ones(len(lines.number), dtype=bool),
    ),
)  # fmt: skip
CLASS_INDEX = {one.name: index for index, one in enumerate(SPECTRAL_CLASSES)}


def classify(lines: Lines) -> NDArray[np.int64]:
    """Class of every line, as an index into `SPECTRAL_CLASSES`, shape (lines,)."""
    return np.argmax([one.holds(lines) for one in SPECTRAL_CLASSES], axis=0)


def rotational_orders(measurement: Measurement, settings: SpectralSettings) -> Mapping[str, float]:
    r"""Frequencies [Hz] of what rotates, :math:`v / 2 \pi r`: of the wheel, and of the drum under it.

    From the conditions ``longitudinal_velocity``, ``dynamic_rolling_radius`` and ``drum_radius``; none without them.
    """
    conditions = measurement.experiment.conditions
    speed = abs(conditions.get("longitudinal_velocity", 0.0))
    radius = conditions.get("dynamic_rolling_radius", 0.0)
    if not (speed > 0 and radius > 0):
        return {}
    drum = conditions.get("drum_radius", settings.drum_radius)
    return {"wheel": speed / (2 * np.pi * radius), "drum": speed / (2 * np.pi * drum)}
