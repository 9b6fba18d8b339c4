"""Each plot draws into the axes that it is given, returns them, and names quantity and unit on them."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import result_trees
import synthetic_rigs
from matplotlib.axes import Axes

from mofit import plots
from mofit.errors import InputError
from mofit.report.toolkit.figures import mode_colour

TREE = result_trees.make_result(synthetic_rigs.tyre(), steps=20)
TEST = next(name for name, kind in zip(TREE["test"].values, TREE["excitation"].values, strict=True) if kind == "sine")
FREE = [str(name) for name in TREE["modes/m1"]["parameter"].values]
#: plot of one axes -> arguments, and what its axes are labelled
PLOTS = {
    plots.loop: ((TEST,), ("slip angle (°)", "lateral force (kN)")),
    plots.errors: ((), ("", "NRMSD (%)")),
    plots.marginal: ((FREE[0],), (None, "")),
    plots.corner: ((), ("", "")),
    plots.search: ((FREE[0], FREE[1]), (None, None)),
}


@pytest.fixture(autouse=True)
def _closed():
    yield
    plt.close("all")


@pytest.mark.parametrize("plot", PLOTS, ids=lambda plot: plot.__name__)
def test_a_plot_takes_and_returns_its_axes(plot):
    arguments, labels = PLOTS[plot]
    figure, (ax, other) = plt.subplots(1, 2)
    assert plot(TREE, *arguments, ax=ax) is ax
    assert ax.has_data()
    assert not other.has_data()
    for label, expected in zip((ax.get_xlabel(), ax.get_ylabel()), labels, strict=True):
        assert label == expected if expected is not None else "(" in label or "$" in label
    figure.canvas.draw()


@pytest.mark.parametrize("plot", PLOTS, ids=lambda plot: plot.__name__)
def test_without_axes_a_plot_draws_into_the_current_ones(plot):
    ax = plt.figure().add_subplot()
    assert plot(TREE, *PLOTS[plot][0]) is ax


def test_the_trace_has_its_residual_below():
    above, below = plots.trace(TREE, TEST)
    assert isinstance(above, Axes)
    assert above.figure is below.figure
    assert below.get_xlabel() == "time (s)"
    measured = above.lines[0].get_ydata()
    simulated = next(line for line in above.lines[1:] if line.get_linestyle() == "-").get_ydata()
    left = [line.get_ydata() for line in below.lines if len(line.get_ydata()) == len(measured)]
    scale = np.ptp(left[-1]) / np.ptp(measured - simulated)
    np.testing.assert_allclose(left[-1], scale * (measured - simulated), atol=1e-9 * scale)
    axes = plt.subplots(2)[1]
    assert plots.trace(TREE, TEST, axes=axes) == tuple(axes)


def test_the_loop_shows_what_was_measured():
    ax = plots.loop(TREE, TEST)
    observed = 1e-3 * TREE["observed_data"][TEST].values
    assert set(np.round(ax.lines[0].get_ydata(), 9)) <= set(np.round(observed, 9))
    assert [text.get_text() for text in ax.get_legend().get_texts()][:2] == ["measured", "model, m1"]


@pytest.mark.parametrize("of", ["comparison", "design"])
def test_expected_standard_deviations_have_a_dot_per_parameter_and_a_colour_per_experiment(of):
    sd = {"a": (0.5, 0.1), "b": (0.02, 0.01)}
    if of == "comparison":
        index = pd.MultiIndex.from_product([["slow", "fast"], sd], names=["experiment", "parameter"])
        table = pd.DataFrame({"relative_sd": [sd[name][k] for k in (0, 1) for name in sd]}, index=index)
    else:
        columns = ["relative_sd_before", "relative_sd"]
        table = pd.DataFrame(list(sd.values()), index=pd.Index(list(sd)), columns=columns)
    ax = plots.expected_sd(table, plt.figure().add_subplot())
    entries = ["slow", "fast"] if of == "comparison" else ["before", "with the design"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == entries
    assert [list(line.get_xdata()) for line in ax.lines] == [[50.0, 2.0], [10.0, 1.0]]
    assert [line.get_color() for line in ax.lines] == [mode_colour(0), mode_colour(1)]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["$a$", "$b$"]
    with pytest.raises(InputError, match="no expected standard deviations"):
        plots.expected_sd(pd.DataFrame({"value": [1.0]}))


@pytest.mark.parametrize(
    ("plot", "arguments", "what"),
    [
        (plots.loop, (TEST[:-1] + "x",), f"test .*{TEST}"),
        (plots.trace, (TEST, "m7"), "mode 'm7'"),
        (plots.marginal, (FREE[0] + "x",), f"parameter .*{FREE[0]}"),
        (plots.corner, ("m0",), "mode 'm0'"),
        (plots.search, (FREE[0], "y"), "parameter 'y'"),
    ],
)
def test_an_unknown_name_is_one_clear_error(plot, arguments, what):
    with pytest.raises(InputError, match=what):
        plot(TREE, *arguments)


def test_a_run_without_search_says_so():
    bare = result_trees.make_result(synthetic_rigs.damper(), optional=False, steps=20)
    with pytest.raises(InputError, match="no search"):
        plots.search(bare, "c")
