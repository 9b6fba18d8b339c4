r"""Laws: how a parameter follows a condition of the tests, as load, pressure or temperature.

A law is an effect on a parameter. One that cannot be negative is scaled, any other is shifted:

.. math:: c = c_0 \, f(x) \quad \text{or} \quad c = c_0 + g(x), \qquad x = (q - q_0) / h

with the condition q, the middle :math:`q_0` of its range and half its width h, so that :math:`c_0` is the value at the
middle. Laws over several conditions multiply, or add up. Their coefficients are parameters like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models.effect import Effect
from mofit.models.extended_model import base_and_effects, with_effects
from mofit.models.model import TARGET_UNIT, Applied, Condition, Model, Symbols
from mofit.parameters import Parameter
from mofit.quantities import title_of

#: laws without coefficients: none; none, and one value for all combinations also where each is identified for itself;
#: and a value of its own under every condition
CONSTANT, SHARED, FREE = "constant", "shared", "free"


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of a law: the ending of its name, its meaning, and its range for a parameter over a condition."""

    ending: str
    meaning: str
    bounds: Callable[[Parameter, Law], tuple[float, float]]
    unit: str = "1"
    limited: bool = False
    """Whether the parameter would leave what is possible beyond the range."""


@dataclass(frozen=True)
class Form:
    """A kind of law."""

    title: str
    """As in "c_y is … vertical force"."""
    formula: str
    """Of the factor (or the shift), with the coefficients a, b."""
    coefficients: tuple[Coefficient, ...]
    shape: Callable[[Any, Law, Sequence[Any], Any], Any]
    """Factor less one, or shift, from the condition's value, the law, its coefficients, and numpy or casadi."""
    values: int = 2
    """Fewest values of the condition that determine it."""
    of_logarithm: bool = False
    """For parameters on a log scale, over conditions above 0."""


@dataclass(frozen=True)
class Law:
    """One parameter over one condition, in SI units."""

    parameter: str
    condition: str
    form: str
    """One of `FORMS`."""
    centre: float
    half_range: float
    """Middle of the condition's range, and half its width."""
    unit: str = "1"
    """SI unit of the condition."""

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of its coefficients."""
        return tuple(f"{self.parameter}_{self.condition}{one.ending}" for one in FORMS[self.form].coefficients)

    @property
    def title(self) -> str:
        """The law in words."""
        return f"{self.parameter} {FORMS[self.form].title} {title_of(self.condition)}"

    def applied(self, parameter: Parameter, value: Any, q: Any, coefficients: Sequence[Any], ops: Any) -> Any:
        """The parameter at a value q of the condition, from its ``value`` at the centre; ``ops`` is numpy or casadi.

        What cannot be negative stays above the share of its value that its range spans.
        """
        shape = FORMS[self.form].shape(q, self, coefficients, ops)
        if not scaled_by_laws(parameter):
            return value + shape
        return value * ops.fmax(1 + shape, parameter.lower / parameter.upper)


def scaled_by_laws(parameter: Parameter) -> bool:
    """Whether laws scale a parameter, as it cannot be negative; else they shift it."""
    return parameter.possible[0] >= 0


def _relative(parameter: Parameter, law: Law) -> tuple[float, float]:
    """Factors from 0 to 2 at the ends of the condition's range, or shifts by half the parameter's range."""
    half = 1.0 if scaled_by_laws(parameter) else (parameter.upper - parameter.lower) / 2
    return -half, half


def _within(change: Callable[[Law], float]) -> Callable[[Parameter, Law], tuple[float, float]]:
    """Half the range of the parameter's logarithm, by what a coefficient of 1 changes at the end of the range."""

    def bounds(parameter: Parameter, law: Law) -> tuple[float, float]:
        half = math.log(parameter.upper / parameter.lower) / 2 / change(law)
        return -half, half

    return bounds


def _x(q: Any, law: Law) -> Any:
    return (q - law.centre) / law.half_range


def _wlf(q: Any, law: Law, a: Sequence[Any], ops: Any) -> Any:
    x = _x(q, law)
    return ops.exp(a[0] * x / (1 + a[1] * x)) - 1


#: the laws with coefficients, by name
FORMS: Mapping[str, Form] = {
    "linear": Form(
        "linear in", "1 + a x", (Coefficient("", "slope", _relative, TARGET_UNIT, True),),
        lambda q, law, a, ops: a[0] * _x(q, law),
    ),
    "quadratic": Form(
        "quadratic in", "1 + a x + b x²",
        (Coefficient("", "slope", _relative, TARGET_UNIT), Coefficient("_2", "curvature", _relative, TARGET_UNIT)),
        lambda q, law, a, ops: a[0] * _x(q, law) + a[1] * _x(q, law) ** 2, 3,
    ),
    "exponential": Form(
        "exponential in", "exp(a x)", (Coefficient("", "slope of the logarithm", _within(lambda law: 1.0)),),
        lambda q, law, a, ops: ops.exp(a[0] * _x(q, law)) - 1, 2, True,
    ),
    "power": Form(
        "a power of", "(q / q₀)ᵃ",
        (Coefficient("", "exponent", _within(lambda law: math.log1p(law.half_range / law.centre))),),
        lambda q, law, a, ops: (q / law.centre) ** a[0] - 1, 2, True,
    ),
    "arrhenius": Form(
        "by Arrhenius over", "exp(a (1/q − 1/q₀))",
        (Coefficient("", "activation energy over the gas constant",
                     _within(lambda law: 1 / (law.centre - law.half_range) - 1 / law.centre), "K"),),
        lambda q, law, a, ops: ops.exp(a[0] * (1 / q - 1 / law.centre)) - 1, 2, True,
    ),
    "wlf": Form(
        "by Williams, Landel and Ferry over", "exp(a x / (1 + b x))",
        (Coefficient("", "slope of the logarithm", _within(lambda law: 1.0)),
         Coefficient("_2", "half range over the constant C₂", lambda parameter, law: (0.0, 0.99), "1", True)),
        _wlf, 3, True,
    ),
}  # fmt: skip


def law_parameters(law: Law, parameter: Parameter) -> tuple[Parameter, ...]:
    """The coefficients of a law as parameters; those of a shift have units of the target."""
    shifts = not scaled_by_laws(parameter)
    found = []
    for name, one in zip(law.coefficients, FORMS[law.form].coefficients, strict=True):
        lower, upper = one.bounds(parameter, law)
        found.append(
            Parameter(
                name,
                "1" if one.unit == TARGET_UNIT and not shifts else one.unit,
                lower,
                upper,
                0.0,
                description=f"{one.meaning} of {law.parameter} over {title_of(law.condition)}",
                neutral=0.0,
                limits=(lower, upper) if one.limited and not shifts else (-math.inf, math.inf),
                scales=parameter.scales if shifts else (),
            )
        )
    return tuple(found)


class LawEffect(Effect):
    """A parameter that follows a condition by a law."""

    candidate = False
    part_of_name = False

    def __init__(self, law: Law, parameter: Parameter) -> None:
        self.law, self.parameter = law, parameter
        self.name = f"law:{law.parameter}/{law.condition}"
        self.title, self.on = law.title, (law.parameter,)
        self.family = "law"
        self.conditions = (Condition(law.condition, law.unit),)
        self.parameters = law_parameters(law, parameter)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The parameter under the test's condition."""
        coefficients = [getattr(s, name) for name in self.law.coefficients]
        q = getattr(s, self.law.condition)
        return Applied(self.law.applied(self.parameter, value, q, coefficients, ca))


def with_laws(model: Model, laws: Iterable[Law]) -> Model:
    """The model whose parameters follow laws; those of parameters that it does not have are left out.

    Raises
    ------
    InputError
        If a law does not suit its parameter or its condition.
    """
    own = {parameter.name: parameter for parameter in base_and_effects(model)[0].parameters}
    used = [law for law in laws if law.parameter in own]
    raise_errors(issue for law in used for issue in law_issues(law, own[law.parameter]))
    return with_effects(model, *(LawEffect(law, own[law.parameter]) for law in used))


def laws_of(model: Model) -> tuple[Law, ...]:
    """The laws that a model's parameters follow."""
    return tuple(effect.law for effect in base_and_effects(model)[1] if isinstance(effect, LawEffect))


def law_issues(law: Law, parameter: Parameter) -> list[Issue]:
    """Why a law does not suit its parameter or its condition."""
    where = f"--law {law.parameter}={law.form}"
    if law.form not in FORMS:
        return [Issue(where, "unknown law", did_you_mean(law.form, (CONSTANT, SHARED, *FORMS, FREE)))]
    if not FORMS[law.form].of_logarithm:
        return []
    found = []
    if parameter.scale != "log":
        found.append(Issue(where, "is for parameters on a log scale", "Choose linear or quadratic"))
    if not law.centre - law.half_range > 0:
        found.append(Issue(where, f"needs values of {law.condition} above 0", "Choose linear or quadratic"))
    return found


def values_under(
    parameter: Parameter,
    laws: Sequence[Law],
    values: Mapping[str, Any],
    conditions: Mapping[str, Any],
) -> FloatArray:
    """A parameter under conditions.

    Parameters
    ----------
    parameter
        As the model declares it.
    laws
        Those of all parameters.
    values
        Of the parameter at the centre and of the coefficients, by name, of shapes that broadcast with the conditions.
    conditions
        By name; those that no law of the parameter reads are not looked at.

    Returns
    -------
    numpy.ndarray
        In SI units.
    """
    found = np.asarray(values[parameter.name], dtype=float)
    for law in laws:
        if law.parameter == parameter.name:
            coefficients = [np.asarray(values[name], dtype=float) for name in law.coefficients]
            found = law.applied(parameter, found, np.asarray(conditions[law.condition]), coefficients, np)
    return np.asarray(found)


def as_laws(given: Iterable[Mapping[str, Any]]) -> tuple[Law, ...]:
    """Laws from plain data, as a result stores them.

    Raises
    ------
    InputError
        If they are not those of this version.
    """
    try:
        laws = tuple(Law(**one) for one in given)
    except TypeError as error:
        raise InputError.of("laws of the run", str(error), "Identify anew with this version") from error
    raise_errors(
        Issue("laws of the run", f"unknown law '{law.form}'", "Identify anew with this version")
        for law in laws
        if law.form not in FORMS
    )
    return laws
