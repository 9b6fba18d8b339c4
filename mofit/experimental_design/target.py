r"""Parameters under conditions that are aimed at: what the next tests are to make certain there.

By its laws a parameter has the value :math:`v(\theta, q)` under conditions q. Its relative change by relative changes
of all parameters and coefficients is a row

.. math:: w_i = \frac{s_i}{s_v} \frac{\partial v}{\partial \theta_i}

with what counts as a relative change of 1 of each, :math:`s` (`mofit.experimental_design.criteria.scales`). With the
covariance C of relative changes its relative variance is :math:`w^T C w`. A parameter without laws is itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.experimental_design.criteria import scales
from mofit.models import Law, Model, laws_of, values_under
from mofit.models.extended_model import base_and_effects
from mofit.parameters import Parameter, ParameterSpace

#: Step of the difference quotients, as a relative change: central ones of smooth laws are exact to 1e-9.
_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Target:
    """Conditions that are aimed at, and what the d parameters are there at N samples."""

    conditions: Mapping[str, float]
    """Of every condition over which parameters follow laws, in SI units."""
    units: Mapping[str, str]
    """SI units of the conditions."""
    notes: tuple[str, ...]
    """Conditions that were not named, and those outside of the range that was identified."""
    coefficients: tuple[str, ...]
    """Parameters that only laws have: they mean nothing under one condition."""
    size: FloatArray
    """Change of each parameter there that counts as a relative change of 1, (N, d)."""
    rows: FloatArray
    """Relative change of each parameter there by relative changes of all, (N, d, d)."""


def target_of(
    model: Model, space: ParameterSpace, samples: FloatArray, given: Mapping[str, float], names: Iterable[str] = ()
) -> Target:
    """The target with these conditions; those that are not named are in the middle of their ranges.

    Parameters
    ----------
    model
        With the laws of a run.
    space, samples
        Its parameters, and samples of their values (N, d).
    given
        Conditions by name, in SI units.
    names
        Parameters that are to be learnt there.

    Raises
    ------
    InputError
        If no law is over a condition, or a coefficient of a law is to be learnt there.
    """
    laws = laws_of(model)
    over = {law.condition: law for law in laws}
    coefficients = tuple(name for law in laws for name in law.coefficients)
    issues = [_unknown(name, value, over) for name, value in given.items() if name not in over]
    issues += [
        Issue(f"--parameter {name}", "is a coefficient of a law, which has no value under a condition",
              "Name the parameter that follows the law, or leave --target out")
        for name in names if name in coefficients
    ]  # fmt: skip
    raise_errors(issues)
    conditions = {name: given.get(name, law.centre) for name, law in over.items()}
    parameters = {one.name: one for one in base_and_effects(model)[0].parameters}
    size = scales(space, samples)

    def there(values: FloatArray) -> FloatArray:
        return _under(parameters, space, laws, values, conditions)

    rows = np.empty((*samples.shape, len(space)))
    for k in range(len(space)):
        step = _STEP * size * np.eye(len(space))[k]
        rows[:, :, k] = (there(samples + step) - there(samples - step)) / (2 * _STEP)
    own = scales(space, there(samples))
    notes = tuple(_notes(given, over))
    units = {name: law.unit for name, law in over.items()}
    return Target(conditions, units, notes, coefficients, own, rows / own[:, :, None])


def _under(
    parameters: Mapping[str, Parameter],
    space: ParameterSpace,
    laws: Sequence[Law],
    values: FloatArray,
    conditions: Mapping[str, float],
) -> FloatArray:
    """All parameters (N, d) under the conditions, coefficients as they are."""
    named = dict(zip(space.names, values.T, strict=True))
    found = values.copy()
    for name in dict.fromkeys(law.parameter for law in laws):
        found[:, space.index(name)] = values_under(parameters[name], laws, named, conditions)
    return found


def _unknown(name: str, value: float, over: Mapping[str, Law]) -> Issue:
    where = f"--target {name}={value:g}"
    if not over:
        return Issue(where, "no parameter follows a law over a condition", "Name the --run that was identified --over")
    return Issue(where, "no parameter follows a law over it", did_you_mean(name, over))


def _notes(given: Mapping[str, float], over: Mapping[str, Law]) -> Iterable[str]:
    for name, law in over.items():
        value, low, high = given.get(name), law.centre - law.half_range, law.centre + law.half_range
        if value is None:
            yield f"--target does not name {name}: it is {law.centre:g} {law.unit}, the middle of its range."
        elif not low <= value <= high:
            yield f"{name} = {value:g} {law.unit} is outside of {low:g} to {high:g}: there the laws are extrapolations."
