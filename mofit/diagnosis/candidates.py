"""The effects that may explain a gap, and what each would change in the tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign
from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.cause import Cause, causes
from mofit.diagnosis.hypothesis import drives_of
from mofit.diagnosis.steps import bounded, tamed, with_enough_steps
from mofit.drives import lacking
from mofit.errors import InputError
from mofit.kernel import Simulator
from mofit.library import effect_names, find_effect
from mofit.model import Effect, Model, why_not, with_effects

Array = NDArray[np.float64]

#: Relative error of the direction of a score test that is let pass: it costs 1e-4 of the test's power.
_SLOPE_ERROR = 0.01
#: Fewest Runge-Kutta steps per sampling interval for effects without states.
_STATIC_STEPS = 2


@dataclass(frozen=True)
class Candidate:
    r"""An effect and the white rows that it adds per unit of its size, to first order.

    Parameters
    ----------
    causes
        The effect at every point of its grid, in the dynamic tests alone or in all; G of them.
    slopes
        S at the neutral size, (G, m + p, q), rows of the prior included.
    steps
        Runge-Kutta steps per sampling interval that they took.
    """

    causes: tuple[Cause, ...]
    slopes: Array
    steps: int

    @property
    def effect(self) -> Effect:
        """The effect."""
        return self.causes[0].effect

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def integrates(self) -> bool:
        """Whether its states can be integrated at any point of its grid."""
        return any(bounded(slopes) for slopes in self.slopes)

    @property
    def signs(self) -> tuple[int, ...]:
        """Per part of the size: 1 if it cannot be below neutral, -1 if it cannot be above, else 0."""
        size = [p for p in self.effect.parameters if p.neutral is not None]
        return tuple(int(p.neutral == p.lower) - int(p.neutral == p.upper) for p in size)


def choose_effects(model: Model, campaign: Campaign, names: Sequence[str] = ()) -> tuple[list[Effect], dict[str, str]]:
    """Effects that the model and the tests admit, and why each of the others is left out.

    Parameters
    ----------
    model
        Without effects.
    campaign
        The tests that are used.
    names
        Shipped names or ``path/to/file.py:Name``. Files join the shipped effects; if a shipped name is given, only
        what is named takes part.

    Raises
    ------
    InputError
        If an effect that was named is unknown or does not fit.
    """
    own = [name for name in names if name.partition(":")[0].endswith(".py")]
    only = [name for name in names if name not in own]
    chosen, left_out = [], {}
    for name in (*(only or effect_names()), *own):
        effect = find_effect(name)
        present = {p.name for p in effect.parameters} & {p.name for p in model.parameters}
        reason = "the model has it already" if present else why_not(effect, model)
        if reason is None and (faults := lacking(with_effects(model, effect), campaign)):
            reason = f"{faults[0].where}: {faults[0].what}"
        if reason is not None and name in names:
            raise InputError.of(f"effect '{name}'", reason, "Leave it out, or choose another model")
        if reason is not None:
            left_out[effect.name] = reason
        elif effect.candidate or name in names:
            chosen.append(effect)
    return chosen, left_out


def prepare(fitted: Fitted, effect: Effect, beside: Sequence[Effect] = ()) -> Candidate:
    """Simulate what an effect adds to the fitted model, for every point of its grid.

    Other effects of the fitted model, but those ``beside``, are not part of the simulation: they are small, and the
    direction of a score test need not be exact for its level to be.
    """
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    system, simulator = observed.workshop.simulator(
        with_effects(observed.problem.model, *beside, effect), drives_of(observed, [*beside, effect]), effect.size, 1
    )
    here = dict(zip(model.system.parameters, model.full(fitted.minimum.point[None])[0], strict=True))
    sets = [{**here, **effect.neutral, **point} for point in effect.grid_points]
    values = np.array([[point[name] for name in system.parameters] for point in sets])

    def slopes(at: Simulator) -> Array:
        return observed.white([tamed(slope) for _, slope in at.sensitivities(values)])

    def change(coarse: Array, fine: Array) -> float:
        size = np.linalg.norm(fine, axis=(1, 2)) + np.finfo(float).tiny
        return float(np.max(np.linalg.norm(fine - coarse, axis=(1, 2)) / size))

    if effect.states:
        simulator, points = with_enough_steps(simulator, slopes, change, _SLOPE_ERROR)
    else:
        # nothing moves faster than in the fitted model
        simulator = simulator.with_steps(max(model.simulator.steps or 1, _STATIC_STEPS))
        points = slopes(simulator)
    found = causes(effect, observed.problem.space, observed.calibrations, observed.workshop)
    root = observed.prior_root[1]
    rows = [np.concatenate([points[i % len(points)], root @ cause.carried]) for i, cause in enumerate(found)]
    return Candidate(tuple(found), np.stack(rows), simulator.steps or 1)


def moving(fitted: Fitted, needs: Sequence[str]) -> list[Effect]:
    """Effects of the fitted model that move conditions of the tests which are needed."""
    conditions = {condition.name for condition in fitted.hypothesis.observed.problem.model.conditions}
    return [effect for effect in fitted.hypothesis.effects if conditions & {*effect.on} & {*needs}]


def as_seen_by(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates, prepared anew where they need a condition of the tests that an effect of the fitted model moves.

    At another speed a wheel turns with another frequency: after some turns nothing is left of the first direction.
    """
    beside = [moving(fitted, one.effect.needs) for one in candidates]
    return [prepare(fitted, c.effect, by) if by else c for c, by in zip(candidates, beside, strict=True)]
