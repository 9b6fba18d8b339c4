"""The effects that may explain a gap, and what each would change in the tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hypothesis import experiments_of
from mofit.diagnosis.integration import clipped, each_with_enough_steps, stable
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.errors import InputError
from mofit.models import Effect, Model, effect_names, find_effect, incompatibility, with_effects
from mofit.parameters import ParameterSpace
from mofit.simulation import lacking
from mofit.simulation.ranges import scaled, with_parameters

#: Relative change of a score test's direction when the step is halved: costs 1e-4 of the test's power.
_SENSITIVITY_CHANGE = 0.01
#: Runge–Kutta steps for an effect without states: nothing moves faster than in the fitted model.
_STATIC_STEPS = 2


@dataclass(frozen=True)
class Candidate:
    r"""An effect and the whitened rows that it adds per unit of its size, to first order.

    Parameters
    ----------
    discrepancies
        The effect at every point of its grid, in the dynamic tests alone or in all; G of them.
    sensitivities
        S at the neutral size, (G, m + p, q), rows of the prior included.
    steps
        Runge–Kutta steps per sampling interval that each point took, (G,).
    """

    discrepancies: tuple[Discrepancy, ...]
    sensitivities: FloatArray
    steps: NDArray[np.int64]

    @property
    def effect(self) -> Effect:
        """The effect."""
        return self.discrepancies[0].effect

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def integrates(self) -> bool:
        """Whether its states can be integrated at any point of its grid."""
        return any(stable(columns) for columns in self.sensitivities)

    @property
    def signs(self) -> tuple[int, ...]:
        """Per component of the size: 1 if it cannot be below neutral, -1 if it cannot be above, else 0."""
        size = [p for p in self.effect.parameters if p.neutral is not None]
        return tuple(int(p.neutral == p.lower) - int(p.neutral == p.upper) for p in size)


def ranged(effect: Effect, scales: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]) -> Effect:
    """The effect with ranges for data of these scales (`mofit.simulation.ranges`), or in the bounds asked for.

    Raises
    ------
    InputError
        If bounds leave out the value without the effect.
    """
    own = scaled(effect, scales)
    space = ParameterSpace(own.parameters)
    asked = [name for name in space.names if name in bounds]
    for name in asked:
        space = space.with_bounds(name, *bounds[name])
    return with_parameters(own, space.parameters) if asked else own


def choose_effects(model: Model, campaign: Campaign, names: Sequence[str] = ()) -> tuple[list[Effect], dict[str, str]]:
    """Effects that the model and the tests admit, and why each of the others is left out.

    Parameters
    ----------
    model, campaign
        The model without effects, and the tests that are used.
    names
        Shipped names or ``path/to/file.py:Name``. Files join the shipped effects; if a shipped name is given, only
        the named effects take part.

    Raises
    ------
    InputError
        If a named effect is unknown or does not fit.
    """
    own = [name for name in names if name.partition(":")[0].endswith(".py")]
    only = [name for name in names if name not in own]
    chosen, left_out = [], {}
    for name in (*(only or effect_names()), *own):
        effect = find_effect(name)
        present = {p.name for p in effect.parameters} & {p.name for p in model.parameters}
        reason = "the model has it already" if present else incompatibility(effect, model)
        if reason is None and (issues := lacking(with_effects(model, effect), campaign)):
            reason = f"{issues[0].where}: {issues[0].message}"
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
    effects = [*beside, effect]
    system, simulator = observed.simulators.simulator(
        with_effects(observed.problem.model, *effects), experiments_of(observed, effects), effect.size
    )
    here = {**model.layout.fixed, **fitted.values}
    sets = [{**here, **effect.neutral, **point} for point in effect.grid_points]
    values = np.array([[point[name] for name in system.parameters] for point in sets])

    def sensitivities(steps: int, which: NDArray[np.intp]) -> FloatArray:
        slopes = simulator.with_steps(steps).sensitivities(values[which])
        return observed.whitened([clipped(slope) for _, slope in slopes])

    def change(coarse: FloatArray, fine: FloatArray) -> float:
        return float(np.linalg.norm(fine - coarse) / (np.linalg.norm(fine) + np.finfo(float).tiny))

    if effect.states:
        steps, points = each_with_enough_steps(sensitivities, change, _SENSITIVITY_CHANGE, len(values))
    else:
        steps = np.full(len(values), max(model.steps, _STATIC_STEPS))
        points = sensitivities(int(steps[0]), np.arange(len(values)))
    found = observed.stages.discrepancies(effect)
    root = observed.prior_root[1]
    place = np.arange(len(found)) % len(points)
    rows = [np.concatenate([points[i], root @ one.sensitivity]) for i, one in zip(place, found, strict=True)]
    return Candidate(tuple(found), np.stack(rows), steps[place])


def effects_moving(fitted: Fitted, needs: Sequence[str]) -> list[Effect]:
    """Effects of the fitted model that move conditions of the tests which are needed."""
    conditions = {condition.name for condition in fitted.hypothesis.observed.problem.model.conditions}
    return [effect for effect in fitted.hypothesis.effects if conditions & {*effect.on} & {*needs}]


def prepared_at(fitted: Fitted, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates, prepared again where they need a condition of the tests that an effect of the fitted model moves.

    At another speed a wheel turns with another frequency: after some turns the first direction is useless.
    """
    beside = [effects_moving(fitted, one.effect.needs) for one in candidates]
    return [prepare(fitted, c.effect, by) if by else c for c, by in zip(candidates, beside, strict=True)]


def rescaled(candidates: Sequence[Candidate], old: WhitenedData, new: WhitenedData) -> list[Candidate]:
    """Candidates of the same tests with another noise."""
    factor = np.sqrt(old.variance / new.variance)
    found = []
    for one in candidates:
        sensitivities = one.sensitivities.copy()
        sensitivities[:, : len(factor)] *= factor[:, None]
        found.append(replace(one, sensitivities=sensitivities))
    return found
