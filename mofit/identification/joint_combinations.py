"""Combinations of conditions that no one of them determines alone: identified together, with shared parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.errors import InputError
from mofit.identification.law_fit import CellEstimates
from mofit.identification.result import Located
from mofit.identification.settings import Settings
from mofit.identification.stages import locate_minima
from mofit.models import SHARED, Model
from mofit.parameters import Parameter
from mofit.problem import Problem, adjusted_posterior
from mofit.sampling import laplace_covariance
from mofit.simulation.scoped_simulator import ScopedSimulator


def shared_names(parameters: Sequence[Parameter], forms: Mapping[tuple[str, str], Sequence[str]]) -> tuple[str, ...]:
    """Parameters with one value for all combinations, from the laws to choose from.

    Raises
    ------
    InputError
        If one is shared over some conditions only, or none is left to follow a law.
    """
    found = []
    for one in parameters:
        own = [tuple(choices) for (name, _), choices in forms.items() if name == one.name]
        if any(SHARED in choices for choices in own):
            if any(choices != (SHARED,) for choices in own):
                what = f"'{SHARED}' holds over all conditions, and leaves nothing to choose"
                raise InputError.of(f"--law {one.name}", what, "Say it alone, or choose constant")
            found.append(one.name)
    if found and len(found) == len(parameters):
        raise InputError.of("--law", "every parameter is shared", "Leave one that follows the conditions")
    return tuple(found)


def identified_together(
    campaign: Campaign,
    model: Model,
    settings: Settings,
    groups: Mapping[tuple[float, ...], Sequence[str]],
    blank: CellEstimates,
    until: float = math.inf,
) -> tuple[CellEstimates, Located]:
    r"""Estimates of all combinations from one fit, in which all but the shared parameters have a value for each.

    With the shared :math:`\theta` of precision :math:`\Lambda`, the others are :math:`z_g = \hat z_g + D_g (\theta -
    \hat\theta)` with covariance :math:`C_g` about that. Each combination adds

    .. math::
        \begin{pmatrix} D_g^T C_g^{-1} D_g + \Lambda / G & -D_g^T C_g^{-1} \\ -C_g^{-1} D_g & C_g^{-1} \end{pmatrix}

    to the precision of all estimates, which thus keeps the form of an arrow.

    Parameters
    ----------
    campaign, model, settings, until
        As for `mofit.identification.stages.locate_minima`.
    groups
        Tests of every combination that the fit uses.
    blank
        Parameters, conditions and shared parameters; its values are not read.
    """
    over = ",".join(settings.over)
    own = {one.name: over for one in blank.parameters if one.name not in blank.shared}
    tests = [name for names in groups.values() for name in names]
    joint = replace(settings, over=(), laws={}, scopes={**settings.scopes, **own})
    located = locate_minima(campaign, model, joint, tests, until=until)
    problem, point = located.posterior.main, located.minima[0].point
    theta = laplace_covariance(adjusted_posterior(located.posterior, point).normal_hessian)
    first = [problem.tests.index(names[0]) for names in groups.values()]
    return _estimates(problem, point, theta, first, blank), located


def _estimates(
    problem: Problem, point: FloatArray, theta: FloatArray, first: Sequence[int], blank: CellEstimates
) -> CellEstimates:
    """From the covariance of the shared parameters (d, d), unit coordinates; a test of every combination is given."""
    simulator, space = problem.simulator, problem.space
    assert isinstance(simulator, ScopedSimulator)
    p, scopes = problem.layout.full(point[None]), simulator.scopes.space
    best = simulator.best(p)
    values, shared = best.values[0][:, simulator.columns][first], space.from_unit(point)
    row = [scopes.index(one.name) for one in blank.parameters if one.name not in blank.shared]
    column = [space.index(name) for name in blank.shared]
    # by z: the logarithm where the scale is one
    inner = _per_z(scopes.parameters, values)  # (G, L), d value / d z
    outer = _per_z(space.parameters, shared)
    slopes = simulator.slopes(p)[0][first] * outer[: len(simulator.free)] / inner[..., None]  # (G, L, d)
    width = scopes.derivative(values) / inner
    place, group = best.unknowns.place[first], best.unknowns.group[first]
    covariance = problem.scoped_covariance(point)[group[:, None, None], place[:, :, None], place[:, None, :]]
    held = best.held()[0][group[:, None], place]
    # what lies at an end of its range may be anywhere near: as wide as the range
    covariance = covariance + np.eye(len(scopes)) * np.where(held, 1 / 12, 0.0)[:, None, :]
    covariance = (covariance * width[:, :, None] * width[:, None, :])[:, row][:, :, row]
    slopes = slopes[:, row][:, :, column]
    to_z = space.derivative(shared) / outer
    whole = (theta * np.outer(to_z, to_z))[np.ix_(column, column)]
    # in the order of the parameters
    names = [*blank.shared, *(scopes.names[k] for k in row)]
    order = [names.index(one.name) for one in blank.parameters]
    together = np.concatenate([np.tile(shared[column], (len(first), 1)), values[:, row]], axis=1)
    precision, marginal = _arrow(whole, slopes, covariance)
    return replace(
        blank,
        values=together[:, order],
        covariance=marginal[:, order][:, :, order],
        joint_precision=precision[:, order][:, :, order],
    )


def _per_z(parameters: Sequence[Parameter], values: FloatArray) -> FloatArray:
    return np.where([one.scale == "log" for one in parameters], values, 1.0)


def _arrow(whole: FloatArray, slopes: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Precision that each combination adds, and covariance there, of shared parameters and the others, (G, P, P)."""
    inverse = np.linalg.inv(covariance)
    mixed = -inverse @ slopes
    corner = np.linalg.inv(whole) / len(slopes) - slopes.swapaxes(1, 2) @ mixed
    precision = np.block([[corner, mixed.swapaxes(1, 2)], [mixed, inverse]])
    follow = slopes @ whole
    every = np.broadcast_to(whole, (len(slopes), *whole.shape))
    marginal = np.block([[every, follow.swapaxes(1, 2)], [follow, covariance + follow @ slopes.swapaxes(1, 2)]])
    return precision, marginal
