"""Units of FMUs, which are spelt as in Modelica or defined by SI base units, into SI."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from mofit.units import UnitError, is_unit, si_unit, to_si

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True)
class SiConversion:
    """``value in SI = factor * value + offset``."""

    unit: str = "1"
    """The SI unit."""
    factor: float = 1.0
    offset: float = 0.0


def si_conversion(unit: str | None, base: Any = None) -> SiConversion | None:
    """The conversion from an FMU's unit to SI; None where it has none, or one that nobody knows.

    The name decides where mofit knows it, else its definition by base units (FMI's ``BaseUnit``).
    """
    spelt = _spelt(unit or "")
    if spelt and is_unit(spelt):
        return _by_name(spelt, si_unit(spelt))
    if base is not None:
        powers = [(name, int(getattr(base, name))) for name in _BASE if getattr(base, name)]
        composed = " ".join(name if power == 1 else f"{name}^{power}" for name, power in powers) or "1"
        target = si_unit(composed) if is_unit(composed) else composed
        return SiConversion(target, float(base.factor), float(base.offset))
    if spelt:
        try:
            return _by_name(spelt, spelt)  # coherent, but of a dimension that mofit has no spelling for
        except UnitError:
            return None
    return None


def _by_name(unit: str, target: str) -> SiConversion:
    zero, one = to_si([0.0, 1.0], unit, target).tolist()
    return SiConversion(target, one - zero, zero)


def _spelt(unit: str) -> str:
    """Modelica's ``N.s/m`` and ``kg.m2/s3``: a point between letters multiplies."""
    return re.sub(r"(?<=[A-Za-z0-9)])\.(?=[A-Za-z(])", " ", unit.strip())
