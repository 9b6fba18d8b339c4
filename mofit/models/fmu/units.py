"""Units of FMUs, spelt as in Modelica or defined by SI base units."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from mofit.units import UnitError, any_si_unit, to_si

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
    try:
        if spelt:
            return _by_name(spelt, any_si_unit(spelt))
    except UnitError:
        pass
    if base is None:
        return None
    powers = [(name, int(getattr(base, name))) for name in _BASE if getattr(base, name)]
    composed = " ".join(name if power == 1 else f"{name}^{power}" for name, power in powers) or "1"
    return SiConversion(any_si_unit(composed), float(base.factor), float(base.offset))


def _by_name(unit: str, target: str) -> SiConversion:
    zero, one = to_si([0.0, 1.0], unit, target).tolist()
    return SiConversion(target, one - zero, zero)


def _spelt(unit: str) -> str:
    """Modelica's ``N.s/m`` and ``kg.m2/s3``: a point between letters multiplies; a ``rev`` is a turn."""
    return re.sub(r"\brev\b", "turn", re.sub(r"(?<=[A-Za-z0-9)])\.(?=[A-Za-z(])", " ", unit.strip()))
