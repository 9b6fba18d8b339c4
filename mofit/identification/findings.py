"""What a reader must know before the numbers: a misfit, an estimate at a limit, parameters that act only together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.identification.combinations import combined
from mofit.identification.widening import WORTH
from mofit.optimize import Minimum
from mofit.parameters import Parameter, ParameterSpace
from mofit.problem import Problem

Level = Literal["caution", "untrusted"]
"""``caution``: read it before the numbers. ``untrusted``: numbers of other parameters depend on it (exit code 3)."""

#: Ratio of residual to noise from which the misfit is larger than the noise: :math:`\sqrt{1 + 1}` is an equal share.
GAP = 2**0.5
#: Ratio of residual to noise from which the noise hardly matters any more.
MISFIT = 3.0
#: Share of the output's range below which a residual is that of the integration, not of the model.
NEGLIGIBLE = 5e-4


@dataclass(frozen=True)
class Finding:
    """One thing to know, in a sentence."""

    kind: str
    level: Level
    text: str


def misfit(problem: Problem, nrmsd: FloatArray) -> list[Finding]:
    """How well the model fits beside the noise, if badly; from the NRMSD of every test."""
    floor = np.maximum(problem.noise.floor, NEGLIGIBLE)
    ratio = float(np.sqrt(np.mean(nrmsd**2) / np.mean(floor**2)))
    if not ratio >= MISFIT:
        return []
    worst = int(np.argmax(nrmsd / floor))
    text = (
        f"The model misses {ratio:.2g} times the noise ({100 * np.sqrt(np.mean(nrmsd**2)):.2g} % of the range; "
        f"most in {problem.tests[worst]}). The parameters are those of a compromise: mofit diagnose says what it lacks."
    )
    return [Finding("misfit", "caution", text)]


def at_limits(space: ParameterSpace, minimum: Minimum, hessian: FloatArray, asked: Sequence[str] = ()) -> list[Finding]:
    """Parameters whose best value is a limit, and whether that decides the others; ``asked`` have bounds of the user's.

    Parameters
    ----------
    space, minimum
        Of the posterior.
    hessian
        Of the negative log posterior, (d, d).
    asked
        Names of the parameters whose bounds the user gave.
    """
    found = []
    for k in np.flatnonzero(minimum.at_bound):
        gain, shift = _released(minimum.gradient, hessian, minimum.at_bound, int(k))
        if gain < WORTH:  # consistent with the limit: the verdict says so
            continue
        one, side = space.parameters[k], int(minimum.at_bound[k])
        text = f"{one.name} is at {_limit(one, side, one.name in asked)}, and the fit would gain beyond it."
        decided = [name for name, moved in zip(space.names, shift, strict=True) if moved > 1]
        if decided:
            text += f" That limit decides {', '.join(decided)} too."
        cure = f"--bounds {one.name}=…" if one.name in asked else "another model"
        text += f" Check the model, the signs and units of the data, or try {cure}."
        found.append(Finding("limit", "untrusted" if decided else "caution", text))
    return found


def ridges(space: ParameterSpace, point: FloatArray, hessian: FloatArray) -> list[Finding]:
    """Parameters that the data determine only together, from the Hessian (d, d) of the likelihood at a minimum (d,)."""
    return [
        Finding("ridge", "caution", f"{', '.join(names)} cannot be told apart: {what}.")
        for names, what in combined(space, point, hessian)
    ]


def _limit(one: Parameter, side: int, asked: bool) -> str:
    value = one.lower if side < 0 else one.upper
    unit = "" if one.unit == "1" else f" {one.unit}"
    kind = "the limit asked for" if asked else "its limit" if value in one.possible else "the end of its widest range"
    return f"{kind}, {value:.4g}{unit}"


def _released(gradient: FloatArray, hessian: FloatArray, sides: NDArray[np.int64], k: int) -> tuple[float, FloatArray]:
    """Nats that the fit would gain without the limit of one coordinate, and how far others move, in their own sd."""
    free = np.flatnonzero(sides == 0)
    inner = hessian[np.ix_(free, free)] + 1e-9 * max(float(np.trace(hessian)), 1.0) * np.eye(len(free))
    follow = -np.linalg.solve(inner, hessian[free, k]) if len(free) else np.empty(0)
    curvature = float(hessian[k, k] + hessian[free, k] @ follow)
    step = abs(float(gradient[k])) / max(curvature, 1.0)
    shift = np.zeros(len(gradient))
    shift[free] = np.abs(follow) * step / np.sqrt(np.diag(np.linalg.inv(inner))) if len(free) else 0.0
    return 0.5 * abs(float(gradient[k])) * step, shift
