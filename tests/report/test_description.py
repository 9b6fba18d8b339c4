"""What the axes of a figure show, against figures whose content is known."""

from __future__ import annotations

import numpy as np
import pytest

from mofit.report.toolkit.axes import axis_of_tests, heat_map, log_axis
from mofit.report.toolkit.description import keyed, offers
from mofit.report.toolkit.figures import FLOOR, MODE_COLOURS, Panels, band_key, dot_key, line_key, panel_of
from mofit.report.toolkit.formatting import html_of_math, parameter_label


def described(panels: Panels, **features):
    return panels.figure("alt", "caption", **features).described


def parts(panels: Panels, kind: str, panel: int = 0) -> list[dict]:
    return [part for part in described(panels)["panels"][panel]["parts"] if part["kind"] == kind]


def test_lines_dots_and_bands_have_their_values_colours_and_names() -> None:
    blue, red = (colour.lower() for colour in MODE_COLOURS[:2])
    legend = [line_key(blue, "model"), line_key(blue, "other", ls="--"), dot_key(red, "data"), band_key(FLOOR, "noise")]
    panels = Panels(1, 1, 1.0, legend=legend)
    (axes,) = panels.axes
    axes.plot([0, 1, 2], [3, np.nan, 5], color=blue)
    axes.plot([0, 1], [1, 2], color=blue, ls="--")
    axes.plot([1], [4], color=red, ls="none", marker="s", mfc="none")
    axes.fill_between([0, 1], [0, 0], [1, 2], color=FLOOR, alpha=0.3, lw=0)
    first, second, dots = parts(panels, "line")
    assert (first["x"], first["y"]) == ([0, 1, 2], [3, None, 5])
    assert [part["name"] for part in (first, second, dots)] == ["model", "other", "data"]
    assert (first["colour"], second["dash"]) == (blue, "dash")
    assert (dots["dots"]["symbol"], dots["dash"]) == ("square-open", "")
    (band,) = parts(panels, "band")
    assert (band["name"], band["alpha"]) == ("noise", pytest.approx(0.3))
    assert {(0, 0), (1, 2)} <= set(zip(band["x"], band["y"], strict=True))


def test_an_error_bar_without_a_value_is_left_out() -> None:
    panels = Panels(1, 1, 1.0)
    panels.axes[0].errorbar([0, 1, 2], [3.0, np.nan, 5.0], yerr=[1.0, 1.0, 2.0], fmt="none")
    (bars,) = parts(panels, "line")
    assert (bars["x"], bars["y"]) == ([0, 0, None, 2, 2], [2, 4, None, 3, 7])


def test_what_goes_right_across_has_one_coordinate() -> None:
    panels = Panels(1, 1, 1.0)
    panels.axes[0].axhline(2.5, color=FLOOR)
    panels.axes[0].axvline(-1.0, color=FLOOR)
    panels.axes[0].axhspan(1, 2, color=FLOOR, alpha=0.2, lw=0)
    across = parts(panels, "across")
    assert [{key: part[key] for key in "xy" if key in part} for part in across] == [{"y": 2.5}, {"x": -1.0}]
    (stripe,) = parts(panels, "stripe")
    assert stripe["y"] == [1, 2]
    assert "x" not in stripe


def test_bars_stairs_and_cells() -> None:
    panels = Panels(3, 3, 1.0)
    bars, stairs, cells = panels.axes
    bars.barh([0, 1], [3.0, 4.0], height=0.5)
    stairs.stairs([1.0, 2.0], [0.0, 1.0, 3.0])
    heat_map(cells, np.array([[1.0, 2.0], [3.0, 4.0]]), ["low", "high"], ["a", "b"], vmin=0, vmax=4)
    (found,) = parts(panels, "bars")
    assert (found["flat"], found["at"], found["length"], found["width"]) == (True, [0, 1], [3, 4], [0.5, 0.5])
    (steps,) = parts(panels, "line", 1)
    assert list(zip(steps["x"], steps["y"], strict=True)) == [(0, 0), (0, 1), (1, 1), (1, 2), (3, 2), (3, 0)]
    (found,) = parts(panels, "cells", 2)
    assert (found["z"], found["low"], found["high"]) == ([[1, 2], [3, 4]], 0, 4)
    assert described(panels)["panels"][2]["y"]["ticks"]["texts"] == ["low", "high"]


def test_axes_have_label_scale_limits_and_set_ticks() -> None:
    panels = Panels(2, 2, 1.0, lower=0.5)
    log_axis(panels.axes[0], "x", [1, 3])
    panels.axes[0].set_xlim(0.5, 5)
    panels.label("frequency (Hz)", "force (N)", "residual (N)")
    first, second = described(panels)["panels"]
    ticks = {"values": [1, 3], "texts": ["1", "3"]}
    assert first["x"] == {"title": "frequency (Hz)", "log": True, "range": [0.5, 5], "ticks": ticks, "keys": {}}
    assert second["y"]["title"] == "force (N)"  # drawn once for the row, needed where the panel stands alone
    assert second["lower"]["y"]["title"] == "residual (N)"
    assert second["y"]["ticks"] is None


def test_keys_are_what_can_be_chosen() -> None:
    panels = Panels(2, 2, 1.0)
    panel_of(panels.axes[0], "a / force")
    axis_of_tests(panels.axes[1], ["a", "b"])
    (line,) = panels.axes[1].plot([0, 1], [1, 2])
    keyed(line, draw=["1", "2"])
    panels.on_request(panels.axes[0], "draw 3", [0], [1], FLOOR, draw="3")
    assert offers(described(panels)) == {"test": ["a", "b"], "draw": ["3", "1", "2"]}
    (asked,) = parts(panels, "line")
    assert (asked["asked"], asked["keys"]) == (True, {"draw": "3"})


def test_a_figure_may_stay_a_picture() -> None:
    assert described(Panels(1, 1, 1.0), explore=False) is None


@pytest.mark.parametrize(
    ("text", "html"),
    [
        (parameter_label("d_M", "N s/m"), "<i>d</i><sub>M</sub>  (N s/m)"),
        (parameter_label("alpha", "1"), "<i>α</i>  (–)"),
        (r"$\mathdefault{10^{-3}}$", "10<sup>-3</sup>"),
        ("a<b costs $5", "a&lt;b costs $5"),
    ],
)
def test_symbols_become_html_and_the_rest_is_escaped(text, html) -> None:
    assert html_of_math(text) == html
