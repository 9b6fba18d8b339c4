"""Where the power of a record lies: classes of spectral lines."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Measurement
from mofit.diagnosis.whitening import Whitening

Array = NDArray[np.float64]

CLASSES = ("dc", "odd", "even", "subharmonic", "rotating", "slow", "steady", "excited", "other")
"""Zero frequency; odd and even harmonics of the excitation, and odd ones of half its frequency; wheel and drum order
with their sidebands; drift and slow modulation of the excitation; lines of one frequency in all tests that stand out of
the noise (`mofit.diagnosis.steady`); lines that a signal without period excites; all the rest."""

#: Harmonics that are told apart; higher ones count as other lines.
HARMONICS = 10
#: Odd multiples of half the excitation's frequency that are told apart.
SUBHARMONICS = 3
#: Lines on each side of an order that its leakage reaches.
_NEAR = 1.5
#: Lines on each side of the excitation that a slow modulation reaches.
_SKIRT = 2
#: Share of a signal's power that its excited lines hold.
_EXCITED = 0.999
#: Radius of a test drum, m, where a campaign does not state ``drum_radius``: 4.35 Hz at 60 km/h.
DRUM_RADIUS = 0.61


def orders(measurement: Measurement) -> Mapping[str, float]:
    r"""Frequencies [Hz] of what turns, :math:`v / 2 \pi r`: of the wheel, and of the drum under it.

    From the conditions ``longitudinal_velocity``, ``dynamic_rolling_radius`` and ``drum_radius``; none without them.
    """
    conditions = measurement.procedure.conditions
    speed = abs(conditions.get("longitudinal_velocity", 0.0))
    radius = conditions.get("dynamic_rolling_radius", 0.0)
    if not (speed > 0 and radius > 0):
        return {}
    drum = conditions.get("drum_radius", DRUM_RADIUS)
    return {"wheel": speed / (2 * np.pi * radius), "drum": speed / (2 * np.pi * drum)}


def classify(whitening: Whitening, turning: Mapping[str, float], driver: Array) -> NDArray[np.int64]:
    """Class of every line, as an index into `CLASSES`, shape (lines,).

    Parameters
    ----------
    whitening
        Of the record.
    turning
        See `orders`.
    driver
        The exciting signal over the samples used, (n,); looked at where the test does not repeat.
    """
    lines = len(whitening.frequencies)
    number = np.arange(lines)
    found = np.full(lines, CLASSES.index("other"))
    spacing = 1 / (whitening.count * whitening.step)

    def mark(name: str, where: NDArray[np.bool_]) -> None:
        found[where] = CLASSES.index(name)

    m = whitening.periods
    base = m * spacing
    for frequency in turning.values():
        for sideband in (-1, 0, 1) if m else (0,):
            mark("rotating", np.abs(number - (frequency + sideband * base) / spacing) < _NEAR)
    if m:
        mark("slow", (number < m / 2) | ((np.abs(number - m) <= _SKIRT) & (np.abs(number - m) < m / 2)))
        half = 2 * number / m
        # of an odd number of periods the two lines beside
        nearest = np.abs(half - (2 * np.round((half - 1) / 2) + 1)) < 1.5 / m
        mark("subharmonic", nearest & (half < 2 * SUBHARMONICS) & (m > 2))
        harmonic, rest = np.divmod(number, m)
        told = (rest == 0) & (harmonic <= HARMONICS)
        mark("odd", told & (harmonic % 2 == 1))
        mark("even", told & (harmonic % 2 == 0))
    else:
        power = np.abs(np.fft.rfft(driver - driver.mean())) ** 2
        order = np.argsort(-power, kind="stable")
        most = int(np.searchsorted(np.cumsum(power[order]), _EXCITED * power.sum())) + 1
        highest = int(order[:most].max())
        # a lightly filled band is excited throughout: harmonics of its lines fall between them
        mark("excited", number <= 2 * highest)
    mark("dc", number == 0)
    return found
