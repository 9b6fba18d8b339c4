"""Units as people write them, into SI."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from mofit._typing import FloatArray
from mofit.errors import InputError, MofitError

if TYPE_CHECKING:
    import pint


#: a number in SI units, or text with its unit: "25 mm"
Quantity: TypeAlias = float | str

#: SI units as mofit spells them; for an unknown channel the first with the same dimension is taken
SI_UNITS = (
    "1", "s", "m", "kg", "A", "K", "rad", "Hz", "N", "Pa", "J", "W", "V", "C", "T", "ohm",
    "m/s", "m/s^2", "rad/s", "rad/s^2", "N m", "N/m", "N s/m", "N/m^3", "N/rad", "N m/rad", "N/V",
    "1/m", "m^2", "m^3", "kg/m^3",
)  # fmt: skip

_PLAIN = {
    "-": "1", "": "1", "%": "percent", "°": "deg", "°/s": "deg/s", "°C": "degC", "deg C": "degC",
    "Nm": "N m", "kNm": "kN m", "kmh": "km/h", "kph": "km/h", "sec": "s", "msec": "ms",
}  # fmt: skip
#: root units of the registry -> base unit of the SI, or of FMI, and how many of that one is
_BASE_UNITS = {
    "gram": ("kg", 1e-3), "kilogram": ("kg", 1.0), "meter": ("m", 1.0), "second": ("s", 1.0), "ampere": ("A", 1.0),
    "kelvin": ("K", 1.0), "mole": ("mol", 1.0), "candela": ("cd", 1.0), "radian": ("rad", 1.0),
}  # fmt: skip
#: longest unit, and what would make of a unit a number that takes for ever to compute
_LONGEST = 40
_ENDLESS = re.compile(r"\^[^ /)]*\^|\^\s*\(?\s*[-+]?\d{3}|\)\s*\^")


class UnitError(MofitError):
    """A unit that is unknown or does not fit; the message names both units."""


def normal(unit: str) -> str:
    """A unit spelt the way of `SI_UNITS`: ``N*s/m`` and ``N·s/m`` become ``N s/m``."""
    unit = unit.strip()
    unit = _PLAIN.get(unit, unit).replace("**", "^").replace("·", " ").replace("*", " ")
    unit = unit.replace("²", "^2").replace("³", "^3")
    unit = re.sub(r"\s+", " ", re.sub(r"\s*/\s*", "/", unit))
    return re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", unit) if "^" not in unit else unit


def si_unit(unit: str) -> str:
    """SI unit of the same dimension, spelt as in `SI_UNITS`.

    Raises
    ------
    UnitError
        If the unit is unknown or of a dimension that mofit has no SI spelling for.
    """
    unit = normal(unit)
    if unit in SI_UNITS:
        return unit
    root = _root(unit)
    for known in SI_UNITS:
        if _root(known) == root:
            return known
    raise UnitError(f"no SI unit known for '{unit}'")


def any_si_unit(unit: str) -> str:
    """As `si_unit`; of a dimension without a spelling a product of base units, ``kg m^2``.

    Raises
    ------
    UnitError
        If the unit is unknown.
    """
    root = _root(normal(unit))
    for known in SI_UNITS:
        if _root(known) == root:
            return known
    base = _registry().get_base_units(root)[1]
    return normal(f"{base:~C}")


@cache
def is_unit(text: str) -> bool:
    """Whether a text is a unit that mofit converts."""
    try:
        si_unit(text)
    except UnitError:
        return False
    return True


def to_si(values: ArrayLike, unit: str, target: str) -> FloatArray:
    """Convert values to the SI unit ``target``.

    An angle is not a plain number here: ``deg`` converts to ``rad``, ``1`` does not.

    Raises
    ------
    UnitError
        If the unit is unknown or of another dimension.
    """
    array = np.asarray(values, dtype=float)
    unit, target = normal(unit), normal(target)
    if unit == target:
        return array
    if _root(unit) != _root(target):
        raise UnitError(f"unit '{unit}' does not fit '{target}'")
    return np.asarray(_registry().Quantity(array, _parse(unit)).to(_parse(target)).magnitude, dtype=float)


def parse_quantity(where: str, value: Quantity, unit: str | None) -> tuple[float, str]:
    """A quantity in SI units and its unit; a text must bring its unit.

    Raises
    ------
    InputError
        If the text is no number with a unit, or the unit does not fit ``unit``.
    """
    if not isinstance(value, str):
        return float(value), unit or "1"
    number, _, given = value.strip().partition(" ")
    try:
        target = unit or si_unit(given)
        return float(to_si(float(number), given, target)), target
    except (ValueError, UnitError) as error:
        raise InputError.of(where, f"'{value}': {error}", "Write a number and its unit, like '25 mm'") from error


def power_of_time(unit: str, other: str) -> int | None:
    """Exponent k, of -2 to 2, with which ``unit`` is ``other`` times s^k in dimension; None where there is none."""
    if unit == other:
        return 0
    try:
        ratio = _root(normal(unit)) / _root(normal(other))
    except UnitError:
        return None
    return next((k for k in (0, -1, 1, -2, 2) if ratio == _root("s") ** k), None)


def base_units(unit: str) -> tuple[float, dict[str, float]]:
    """A unit as a factor times powers of ``kg``, ``m``, ``s``, ``A``, ``K``, ``mol``, ``cd`` and ``rad``.

    Raises
    ------
    UnitError
        If the unit is unknown, of more than these, or counted from another zero (°C).
    """
    known = _parse(normal(unit))
    if _registry().Quantity(0.0, known).to_root_units().magnitude != 0:
        raise UnitError(f"unit '{unit}' has a zero of its own")
    found: tuple[Any, Any] = _registry().get_root_units(known)
    factor, powers = float(found[0]), {}
    for name, power in found[1]._units.items():
        if name not in _BASE_UNITS:
            raise UnitError(f"unit '{unit}' is of {name}")
        symbol, scale = _BASE_UNITS[name]
        powers[symbol] = float(power)
        factor *= scale ** float(power)
    return factor, powers


@cache
def _registry() -> pint.UnitRegistry:
    # imported here because pint takes longer to import than a campaign to read
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


@cache
def _parse(unit: str) -> pint.Unit:
    if len(unit) > _LONGEST or _ENDLESS.search(unit):
        raise UnitError(f"unknown unit '{unit[:_LONGEST]}'")
    try:
        return _registry().Unit("dimensionless" if unit == "1" else unit)
    except Exception as error:  # pint raises its own, tokenizer and type errors alike
        raise UnitError(f"unknown unit '{unit}'") from error


@cache
def _root(unit: str) -> pint.Unit:
    # root units keep the radian that dimensions lose
    return _registry().Unit(_registry().get_root_units(_parse(unit), check_nonmult=False)[1])
