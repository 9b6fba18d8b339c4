"""The effects that may explain a gap, and what each would change in the tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.few_periods import cut
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.integration import DIVERGED, clipped, each_with_enough_steps, stable
from mofit.diagnosis.score_columns import ScoreColumns
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.errors import InputError
from mofit.identification.inputs import as_effect
from mofit.models import (
    Effect,
    Model,
    apart,
    base_and_effects,
    build_system,
    drifts_of,
    effect_names,
    incompatibility,
    with_effects,
)
from mofit.parameters import ParameterSpace
from mofit.simulation import Simulator, lacking
from mofit.simulation.evaluation.evaluations import simulator_of
from mofit.simulation.ranges import scaled, with_parameters
from mofit.simulation.requirements import stated_conditions

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
        S at the neutral size, (G, m + p, c), rows of the prior included.
    columns
        What the c columns are: the components of the size, or their values per test.
    steps
        Runge–Kutta steps per sampling interval that each point took, (G,).
    """

    discrepancies: tuple[Discrepancy, ...]
    sensitivities: FloatArray
    columns: ScoreColumns
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
        """Per column: 1 if its size cannot be below neutral, -1 if it cannot be above, else 0."""
        return self.columns.signs(self.effect)


def ranged(
    effect: Effect,
    scales: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
    scopes: Mapping[str, str] = MappingProxyType({}),
) -> Effect:
    """The effect with ranges for data of these scales (`mofit.simulation.ranges`), or the bounds and scopes asked for.

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
    parameters = tuple(one.scoped(scopes.get(one.name)) for one in space.parameters)
    return own if parameters == tuple(own.parameters) else with_parameters(own, parameters)


def choose_effects(
    model: Model, campaign: Campaign, names: Sequence[str | Effect] = (), more: Sequence[Effect] = ()
) -> tuple[list[Effect], dict[str, str]]:
    """Effects that the model and the tests admit, and why each of the others is left out.

    Parameters
    ----------
    model, campaign
        The model without effects, and the tests that are used.
    names
        Shipped names, ``path/to/file.py:Name``, or effects. Effects and files join the shipped effects; if a shipped
        name is given, only the named effects take part.
    more
        Effects that take part beside the shipped ones.

    Raises
    ------
    InputError
        If a named effect is unknown or does not fit.
    """
    own = [name for name in names if not isinstance(name, str) or name.partition(":")[0].endswith(".py")]
    only = [name for name in names if name not in own]
    chosen, left_out, present = [], {}, [one.name for one in base_and_effects(model)[1]]
    for name in (*(only or (*effect_names(), *drifts_of(model), *more)), *own):
        effect = apart(as_effect(name).for_tests(stated_conditions(campaign)), model)
        reason = "the model has it already" if effect.name in present else incompatibility(effect, model)
        if reason is None and (issues := lacking(with_effects(model, effect), campaign)):
            reason = f"{issues[0].where}: {issues[0].message}"
        reason = _out_of_reach(model, effect) if reason is None else reason
        if reason is not None and name in names:
            raise InputError.of(
                f"effect '{name if isinstance(name, str) else name.name}'",
                reason,
                "Leave it out, or choose another model",
            )
        if reason is not None:
            left_out[effect.name] = reason
        elif effect.candidate or name in names:
            chosen.append(effect)
    return chosen, left_out


def _out_of_reach(model: Model, effect: Effect) -> str | None:
    """Why an effect cannot act around a user's simulator; None where it can, and for a model that has equations."""
    if simulator_of(model) is None:
        return None
    try:
        build_system(with_effects(model, effect))
    except InputError as error:
        return error.issues[0].message
    return None


def prepare(fitted: Fitted, effect: Effect, beside: Sequence[Effect] = ()) -> Candidate:
    """Simulate what an effect adds to the fitted model, for every point of its grid.

    Other effects of the fitted model, but those ``beside``, are not part of the simulation: they are small, and the
    direction of a score test need not be exact for its level to be.
    """
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    effects = [*beside, effect]
    system, simulator = observed.simulators.simulator(
        with_effects(observed.problem.model, *effects), experiments_of(observed.problem, effects), effect.size
    )
    tests = model.layout.values_by_test(fitted.minimum.point)
    sets = [{**effect.neutral, **point, **own} for point in effect.grid_points for own in effect.scoped_grid_points]
    values = np.array([[[{**here, **point}[name] for name in system.parameters] for here in tests] for point in sets])
    if model.layout.shared.all():
        values = values[:, 0]

    def sensitivities(data: WhitenedData, at: Simulator, steps: int, which: NDArray[Any]) -> FloatArray:
        slopes = _secants if effect.abrupt else _slopes
        return data.whitened([clipped(slope) for slope in slopes(at.with_steps(steps), values[which], effect)])

    def change(coarse: FloatArray, fine: FloatArray) -> float:
        return float(np.linalg.norm(fine - coarse) / (np.linalg.norm(fine) + np.finfo(float).tiny))

    steps = np.full(len(values), max(model.steps, _STATIC_STEPS))
    if effect.states:
        briefly = partial(sensitivities, *(cut(observed, simulator) or (observed, simulator)))
        steps, _ = each_with_enough_steps(briefly, change, _SENSITIVITY_CHANGE, len(values))
    points: FloatArray = np.empty((len(values), len(observed.measured), len(effect.size)))
    for own in np.unique(steps):
        points[steps == own] = sensitivities(observed, simulator, int(own), steps == own)
    found = observed.stages.discrepancies(effect)
    columns, root = ScoreColumns.of(effect, observed.problem.measurements), observed.prior_root[1]
    if effect.scoped:
        points = points.reshape(len(found), -1, *points.shape[1:])
        steps = steps.reshape(len(found), -1).max(axis=1)
        wide = np.stack([columns.spread(own, observed.test) for own in points])
        return Candidate(tuple(found), np.pad(wide, ((0, 0), (0, len(root)), (0, 0))), columns, steps)
    place = np.arange(len(found)) % len(points)
    rows = [np.concatenate([points[i], root @ one.sensitivity]) for i, one in zip(place, found, strict=True)]
    return Candidate(tuple(found), np.stack(rows), columns, steps[place])


def _slopes(simulator: Simulator, values: FloatArray, effect: Effect) -> list[FloatArray]:
    """Derivatives of the outputs by the effect's size, per test (K, n, outputs, c)."""
    return [slope for _, slope in simulator.sensitivities(values)]


def _secants(simulator: Simulator, values: FloatArray, effect: Effect) -> list[FloatArray]:
    """Change of the outputs per unit of the effect's size up to its typical size, per test (K, n, outputs, c)."""
    without, columns = _simulated(simulator, values), list[list[FloatArray]]()
    for size in effect.parameters:
        if size.neutral is None:
            continue
        typical = values.copy()
        typical[..., simulator.system.parameters.index(size.name)] = size.nominal
        changed = zip(_simulated(simulator, typical), without, strict=True)
        columns.append([(there - here) / (size.nominal - size.neutral) for there, here in changed])
    return [np.stack(test, axis=-1) for test in zip(*columns, strict=True)]


def _simulated(simulator: Simulator, values: FloatArray) -> list[FloatArray]:
    """Outputs per test (K, n, outputs); nan where the integration diverged, so that two of these do not agree."""
    return [np.where(np.abs(output) < DIVERGED, output, np.nan) for output in simulator.simulate(values)]


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
