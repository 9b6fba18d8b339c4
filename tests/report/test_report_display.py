"""Numbers, units and names as they are printed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markupsafe import Markup

from mofit.report.toolkit.formatting import compact, display_unit, listed, math_symbol, number, percent, symbol, with_sd
from mofit.report.toolkit.page import plain


def read(text: str) -> float:
    """The number that a text shows."""
    superscripts = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    mantissa, _, power = text.replace("\u202f", "").replace("−", "-").partition("×10")
    return float(mantissa) * 10.0 ** int(power.translate(superscripts) or 0)


@given(st.floats(1e-30, 1e30), st.sampled_from([-1, 1]), st.integers(1, 7))
def test_a_number_keeps_its_digits(size, sign, digits) -> None:
    value = sign * size
    assert read(number(value, digits)) == pytest.approx(value, rel=0.5001 * 10 ** (1 - digits))
    assert read(compact(value, digits)) == read(number(value, digits))


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (number(121_819.0, 6), "121\u202f819"),
        (number(1839.0, 2), "1\u202f800"),
        (number(-7.547), "−7.55"),
        (number(0.0), "0"),
        (number(math.nan), "–"),
        (number(1.5e-7, 2), "1.5×10⁻⁷"),
        (number(9.999e-5, 2), "0.00010"),
        (with_sd(19_910.0, 1839.0), "19\u202f900"),
        (with_sd(281.04, 3.1), "281.0"),
        (with_sd(1.0, math.nan), "1.000"),
        (compact(50.0), "50"),
        (compact(0.25), "0.25"),
        (compact(1e5), "100\u202f000"),
        (percent(0.00488), "0.488\u202f%"),
    ],
)
def test_printed_numbers(text, shown) -> None:
    assert text == shown


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e5))
def test_rounding_never_hides_more_than_a_twentieth_of_the_uncertainty(value, sd) -> None:
    if abs(value) < 1e4 * sd:
        assert abs(read(with_sd(value, sd)) - value) <= 0.0501 * sd * 10


@pytest.mark.parametrize(
    ("unit", "peak", "name", "factor"),
    [
        ("rad", 0.03, "°", 180 / math.pi),
        ("m", 0.02, "mm", 1e3),
        ("m", 20.0, "m", 1.0),
        ("N", 5e3, "kN", 1e-3),
        ("N", 80.0, "N", 1.0),
        ("Pa", 2.2e5, "bar", 1e-5),
        ("V", 0.1, "mV", 1e3),
        ("N m", 1e5, "N m", 1.0),
    ],
)
def test_display_units(unit, peak, name, factor) -> None:
    found = display_unit(unit, [np.nan, -peak])
    assert (found.name, found.factor) == (name, factor)


def test_labels_leave_out_the_unit_one() -> None:
    assert display_unit("1", 3.0).label("gain") == "gain"
    assert display_unit("m", 0.1).label("stroke") == "stroke (mm)"


@pytest.mark.parametrize(
    ("name", "html", "math"),
    [
        ("c_M", "<i>c</i><sub>M</sub>", r"$c_{\mathrm{M}}$"),
        ("d", "<i>d</i>", "$d$"),
        ("omega_0", "<i>ω</i><sub>0</sub>", r"$\omega_{\mathrm{0}}$"),
        ("dF0", "<i>dF</i><sub>0</sub>", r"$dF_{\mathrm{0}}$"),
        ("gain", "<span>gain</span>", "gain"),
        ("stiffness_front", "<span>stiffness_front</span>", "stiffness_front"),
        ("<b>", "<span>&lt;b&gt;</span>", "<b>"),
    ],
)
def test_symbols(name, html, math) -> None:
    assert symbol(name) == html
    assert math_symbol(name) == math


def test_lists_read_like_a_sentence() -> None:
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed([Markup("<i>a</i>"), "<b>"]) == "<i>a</i> and &lt;b&gt;"
    assert listed([]) == ""


def test_json_values_are_finite_and_plain() -> None:
    value = {"a": np.array([1.0, np.nan]), "b": np.float64(np.inf), "c": (np.int64(2), "x"), "d": np.array([1.5, 2.0])}
    assert plain(value) == {"a": [1.0, None], "b": None, "c": [2, "x"], "d": [1.5, 2.0]}
