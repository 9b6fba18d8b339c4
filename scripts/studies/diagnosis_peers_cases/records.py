"""What every peer is given: signals of the tests by the fitted model, residuals where there are measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagnosis_peers_cases.terms import MOTION
from mofit._typing import FloatArray

#: correlation from which two signals count as one
ALIKE = 0.999


@dataclass(frozen=True)
class Records:
    """Tests of one campaign, or records held out; each signal in units of its root mean square in the campaign.

    Parameters
    ----------
    input, output
        Input u and simulated output s, (tests, samples).
    deflection, rate
        Of the part that effects act on.
    forced
        Simulated change of the output by each term as a force beside the input, (terms, tests, samples); none where
        the output itself is the force.
    parameters
        Change of the output by each fitted parameter, (parameters, tests, samples).
    residual
        Measured less simulated output, in units of its own root mean square; empty of records held out.
    """

    input: FloatArray
    output: FloatArray
    deflection: FloatArray
    rate: FloatArray
    forced: FloatArray
    parameters: FloatArray
    residual: FloatArray

    @property
    def signals(self) -> dict[str, FloatArray]:
        """Deflection, rate, input, and output with its rate."""
        slope = _slope(self.output)
        return {"x": self.deflection, "v": self.rate, "u": self.input, "s": self.output, "s'": slope}

    def static(self) -> dict[str, FloatArray]:
        """Terms that add to the output, (tests, samples) each."""
        slope = _slope(self.output)
        own = {name: term(self.deflection, self.rate) for name, (term, _) in MOTION.items()}
        return {"s'": slope, "s''": _slope(slope), **own}

    def driven(self) -> dict[str, FloatArray]:
        """Terms that act as a force on the rig, as the output shows them; none where the output is the force."""
        return dict(zip(FORCES, self.forced, strict=False))


FORCES = (*MOTION, "u'", "u''")
#: terms by name, (tests, samples) each
Library = Callable[[Records], dict[str, FloatArray]]


def forces(input_: FloatArray, deflection: FloatArray, rate: FloatArray) -> FloatArray:
    """Every term that may act as a force, (terms, tests, samples)."""
    slope = _slope(input_)
    own = [term(deflection, rate) for term, _ in MOTION.values()]
    return np.stack([*own, slope, _slope(slope)])


def save(path: Path, parts: dict[str, Records]) -> None:
    """Write campaign and records held out."""
    np.savez_compressed(
        path, **{f"{part}:{key}": value for part, one in parts.items() for key, value in vars(one).items()}
    )


def load(path: Path) -> dict[str, Records]:
    """Read what `save` wrote."""
    with np.load(path) as stored:
        parts: dict[str, dict[str, FloatArray]] = {}
        for key in stored.files:
            part, _, name = key.partition(":")
            parts.setdefault(part, {})[name] = stored[key]
    return {part: Records(**one) for part, one in parts.items()}


def _slope(signal: FloatArray) -> FloatArray:
    return np.asarray(np.gradient(signal, axis=-1))


def rms(signal: FloatArray) -> float:
    """Root mean square; 1 of zeros."""
    return float(np.sqrt(np.mean(signal**2))) or 1.0


def distinct(signals: dict[str, FloatArray]) -> list[str]:
    """Names of signals without those proportional to an earlier one."""
    found: dict[str, FloatArray] = {}
    for name, one in signals.items():
        unit = one / rms(one)
        if all(abs(np.mean(unit * other)) < ALIKE for other in found.values()):
            found[name] = unit
    return list(found)
