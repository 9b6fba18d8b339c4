"""What a reader must know before the numbers: a misfit, an estimate at a limit, parameters that act only together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.data.join import specimen_name
from mofit.data.signals import REPEATED
from mofit.identification.combinations import combined
from mofit.identification.law_study import LawStudy
from mofit.identification.widening import WORTH
from mofit.optimize import Minimum
from mofit.parameters import Parameter, ParameterSpace
from mofit.problem import Problem
from mofit.simulation import objective_pairs

Level = Literal["caution", "untrusted"]
"""``caution``: read it before the numbers. ``untrusted``: numbers of other parameters depend on it (exit code 3)."""

#: Ratio of residual to noise from which what the model misses counts: then it is half as large as the noise.
GAP = 1.12
#: Share of independent residuals below which they follow one another: a gap, or noise that is not white.
WHITE = 0.25
#: Share of the output's range below which a residual is that of the integration, not of the model.
NEGLIGIBLE = 5e-4
#: Probability below which estimates scatter too far about a law.
NO_LAW = 1e-3
#: What a residual without repeats may be.
COLOURED_OR_GAP = "Either the noise is coloured, or the model lacks something: mofit diagnose tells."


@dataclass(frozen=True)
class Finding:
    """One thing to know, in a sentence."""

    kind: str
    level: Level
    text: str


def misfit(problem: Problem, nrmsd: FloatArray) -> list[Finding]:
    """How well the model fits beside the noise, if badly; from the NRMSD of every objective.

    The noise of a test is no larger than its residual, whatever was estimated from a record without repeats. Of several
    outputs the one that fits worst beside its noise decides.
    """
    noise, names = problem.noise, problem.objective_names
    floor = np.maximum(np.minimum(noise.floor, nrmsd), NEGLIGIBLE)
    output = np.array([output for _, output in objective_pairs(problem.experiments)])
    squares = [(nrmsd[output == one], floor[output == one]) for one in np.unique(output)]
    fits = [(float(np.sqrt(np.mean(own**2) / np.mean(noisy**2))), own) for own, noisy in squares]
    (ratio, least_fit), worst = max(fits, key=lambda fit: fit[0]), int(np.argmax(nrmsd / floor))
    advice = "The parameters are those of a compromise; mofit diagnose says what the model lacks."
    if ratio >= GAP:
        size = 100 * np.sqrt(np.mean(least_fit**2))
        where = f", most in {names[worst]}" if len(names) > 1 else ""
        size_and_where = f"({size:.2g} % of the range{where})"
        if not problem.signals[objective_pairs(problem.experiments)[worst][0]].repeats:
            text = (
                f"The residual is {ratio:.2g} times the noise from sample to sample {size_and_where}. {COLOURED_OR_GAP}"
            )
            return [Finding("misfit", "caution", text)]
        text = f"The model does not fit: its residual is {ratio:.2g} times the noise {size_and_where}."
        return [Finding("misfit", "caution", f"{text} {advice}")]
    # repeated records have shown that it is the noise which is coloured
    known = np.array(
        [problem.signals[test].noise_method == REPEATED for test, _ in objective_pairs(problem.experiments)]
    )
    share = np.where((nrmsd > NEGLIGIBLE) & ~known, noise.independent / noise.count, 1.0)
    least = int(np.argmin(share))
    if share[least] < WHITE:
        text = f"The residual of {names[least]} is not white: {noise.independent[least]:.0f} of "
        text += f"{noise.count[least]:.0f} samples are independent. {COLOURED_OR_GAP}"
        return [Finding("misfit", "caution", text)]
    return []


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


def ridges(
    space: ParameterSpace, point: FloatArray, hessian: FloatArray, path: FloatArray | None = None
) -> list[Finding]:
    """Parameters that the data determine only together; see `mofit.identification.combinations.combined`."""
    return [
        Finding("ridge", "caution", f"{', '.join(names)} cannot be told apart: {what}.")
        for names, what in combined(space, point, hessian, path)
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


def of_laws(study: LawStudy | None, campaign: Campaign, merged: Sequence[str] = ()) -> list[Finding]:
    """That the laws do not hold, which specimens stand out, and which conditions count as one (``merged``)."""
    if study is None:
        return []
    found = [Finding("set_points", "caution", text) for text in merged]
    for one in study.outliers:
        name = specimen_name(campaign, float(study.cells.at[one.specimen, 0]))
        text = (
            f"Specimen {name} stands out: its {one.parameter} is {abs(one.z):.2g} standard deviations from the others"
        )
        found.append(Finding("specimen", "caution", f"{text} (p = {one.p_value:.1g})."))
    fit = study.fit
    if fit.freedom > 0 and (p := float(chdtrc(fit.freedom, fit.chi_square))) < NO_LAW:
        found.append(
            Finding(
                "laws",
                "caution",
                f"The laws do not hold: the combinations scatter about them by more than their errors (chi square "
                f"{fit.chi_square:.4g} of {fit.freedom}, p = {p:.1g}). Another law (--law) or another condition is "
                "missing.",
            )
        )
    return found
