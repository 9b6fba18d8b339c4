"""Numbers, units and symbols as an engineer reads them; the data stay in SI units."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike

_NAMES = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi psi omega"
_GREEK = dict(zip(_NAMES.split(), "αβγδεζηθκλμνξρστφχψω", strict=True))
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: what `math_symbol` makes, and matplotlib's powers of ten
_MATH = re.compile(r"\$\\?[A-Za-z]+(_\{\\mathrm\{[A-Za-z0-9_,]*\}\})?\$|\$\\mathdefault\{[^$]*\}\$")
THIN = "\u202f"


@dataclass(frozen=True)
class Unit:
    """A display unit: multiply the SI value with `factor`."""

    name: str
    factor: float = 1.0

    def label(self, quantity: str) -> str:
        """Axis label ``quantity (unit)``."""
        return f"{quantity} ({self.name})" if self.name != "1" else quantity


def display_unit(unit: str, values: ArrayLike) -> Unit:
    """The unit in which a signal of this size is usually read: degrees, mm, kN, mV, bar, %."""
    finite = np.abs(np.asarray(values, dtype=float))
    peak = float(np.max(finite[np.isfinite(finite)], initial=0.0))
    choices = {
        "rad": Unit("°", 180 / math.pi),
        "rad/s": Unit("rad/s"),
        "m": Unit("mm", 1e3) if peak < 1 else Unit("m"),
        "N": Unit("kN", 1e-3) if peak >= 2000 else Unit("N"),
        "V": Unit("mV", 1e3) if peak < 1 else Unit("V"),
        "Pa": Unit("bar", 1e-5),
    }
    return choices.get(unit, Unit(unit))


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, thousands apart, powers of ten where it is very large or small."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else ("∞" if value > 0 else "−∞")
    if value == 0:
        return "0"
    value = float(f"{value:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(value)))
    if not -5 <= exponent < 7:
        mantissa = f"{value / 10.0**exponent:.{digits - 1}f}"
        return f"{mantissa}×10{str(exponent).translate(_SUPERSCRIPT)}".replace("-", "−")
    return _grouped(value, max(0, digits - 1 - exponent))


def compact(value: float, digits: int = 6) -> str:
    """A number with at most so many significant digits and no zeros at its end."""
    text = number(value, digits)
    mantissa, times, power = text.partition("×")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + times + power


def with_sd(value: float, sd: float) -> str:
    """A number to the digits its standard deviation supports (two digits of it)."""
    if not (math.isfinite(sd) and sd > 0 and math.isfinite(value)):
        return number(value, 4)
    size = math.floor(math.log10(max(abs(value), sd)))
    return number(value, min(6, max(2, size - math.floor(math.log10(sd)) + 2)))


def plus_minus(value: float, sd: float) -> str:
    """A number with its standard deviation; the number alone where that is not known."""
    return with_sd(value, sd) + (f" ± {number(sd, 2)}" if math.isfinite(sd) else "")


def interval(low: float, high: float, sd: float) -> str:
    """Both ends to the digits that the standard deviation supports; a dash where they are not known."""
    return f"{with_sd(low, sd)} … {with_sd(high, sd)}" if math.isfinite(low) else "–"


#: Fractions that are written as less, and as more, than these.
_NONE, _MANY = 1e-6, 10.0


def percent(value: float, digits: int = 3) -> str:
    """A fraction in per cent, bounded where it is as good as none."""
    if 0 < abs(value) < _NONE:
        return f"< {number(100 * _NONE)}{THIN}%"
    return "–" if math.isnan(value) else f"{number(100 * value, digits)}{THIN}%"


def whole_percent(value: float, decimals: int = 0) -> str:
    """A fraction in per cent with so many decimals, bounded where per cent say nothing any more."""
    if abs(value) > _MANY:
        return f"{'more than ' if value > 0 else 'less than −'}{_grouped(100 * _MANY, 0)}{THIN}%"
    return "–" if math.isnan(value) else f"{_grouped(100 * value, decimals)}{THIN}%"


def p_value(p: float) -> str:
    """A p value, bounded where it is tiny."""
    return "< 0.0001" if p < 1e-4 else number(p, 2)


def unit_text(unit: str) -> str:
    """A unit in a cell of a table; nothing for a plain number."""
    return "" if unit == "1" else unit


def _grouped(value: float, decimals: int) -> str:
    text = f"{value:,.{decimals}f}".replace(",", THIN)
    return text.replace("-", "−")


def count(value: float) -> str:
    """A whole number, thousands apart."""
    return _grouped(round(float(value)), 0)


def symbol(name: str) -> Markup:
    """A parameter's name with its index lowered: ``c_M`` becomes c with index M; long names stay as they are."""
    base, index = _parts(name)
    if not _is_symbol(base):
        return Markup("<span>{}</span>").format(name)
    text = Markup("<i>{}</i>").format(_GREEK.get(base, base))
    return text + (Markup("<sub>{}</sub>").format(index.replace("_", ",")) if index else Markup(""))


def math_symbol(name: str) -> str:
    """The same for figures (matplotlib's math text)."""
    base, index = _parts(name)
    if not _is_symbol(base) or not re.fullmatch(r"[A-Za-z0-9_]*", index):
        return name
    letter = rf"\{base}" if base in _GREEK else base
    return rf"${letter}_{{\mathrm{{{index.replace('_', ',')}}}}}$" if index else f"${letter}$"


def is_math(text: str) -> bool:
    """Whether matplotlib is to read a text as math: it holds symbols or powers of ten, and no other dollar sign."""
    rest, symbols = _MATH.subn("", text)
    return symbols > 0 and "$" not in rest


def html_of_math(text: str) -> str:
    """A text of a figure as HTML: our symbols and powers of ten in italics, lowered and raised, the rest escaped."""
    if not is_math(text):
        return str(escape(text))
    parts = _MATH.split(text)
    found = [match[0] for match in _MATH.finditer(text)]
    plain = [str(escape(part or "")) for part in parts[:: _MATH.groups + 1]]
    shown = [*map(_html_symbol, found), ""]
    return "".join(between + one for between, one in zip(plain, shown, strict=True))


def _html_symbol(math_text: str) -> str:
    power = re.fullmatch(r"\$\\mathdefault\{(.*)\}\$", math_text)
    if power:
        return re.sub(r"\^\{(.*?)\}", r"<sup>\1</sup>", power[1])
    letter, _, index = math_text.strip("$").partition("_")
    below = re.sub(r"\{\\mathrm\{(.*)\}\}", r"<sub>\1</sub>", index)
    return f"<i>{_GREEK.get(letter.removeprefix(chr(92)), letter)}</i>{below}"


def parameter_label(name: str, unit: str) -> str:
    """A parameter and its unit, ``–`` without one, on an axis or over a panel (matplotlib's math text)."""
    return math_symbol(name) + f"  ({unit if unit_text(unit) else '–'})"


def parameter_head(name: str, unit: str) -> Markup:
    """The same at the head of a column."""
    return symbol(name) + (f" ({unit})" if unit_text(unit) else "")


def _parts(name: str) -> tuple[str, str]:
    """Letter and index: ``c_M`` and ``F0`` have one, ``gain`` has none."""
    numbered = re.fullmatch(r"([A-Za-z]{1,2})([0-9]+)", name)
    if numbered:
        return numbered[1], numbered[2]
    base, _, index = name.partition("_")
    return base, index


def _is_symbol(base: str) -> bool:
    return base in _GREEK or bool(re.fullmatch(r"[A-Za-z]{1,2}", base))


def listed(items: list[Markup] | list[str]) -> Markup:
    """``a, b and c``."""
    texts = [escape(item) for item in items]
    if len(texts) < 2:
        return Markup("").join(texts)
    return Markup(", ").join(texts[:-1]) + Markup(" and ") + texts[-1]
