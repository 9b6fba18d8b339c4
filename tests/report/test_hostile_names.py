"""Names and titles of others stand on every page and in every figure as they are: neither markup nor math."""

from __future__ import annotations

import base64
import re
from dataclasses import replace

import matplotlib.pyplot as plt
import pytest
import result_trees
import synthetic_rigs

from mofit import plots
from mofit.report import build_report, build_uncertainty
from mofit.results import write_result

#: letters, then what would be markup, an attribute's end, broken math, math that draws, and a formula
HOSTILE = [
    "t <script>alert(1)<",
    "t <img src=x onerror=alert(1)>",
    't" onload="alert(1)',
    r"t $\frac{x$",
    "t $a$ $",
    "t {{ 7 }}",
]


def hostile_tree():
    rig = synthetic_rigs.damper()
    trials = [replace(trial, name=name) for trial, name in zip(rig.trials, HOSTILE, strict=False)]
    return result_trees.make_result(
        replace(rig, title="<script>alert(2)</script> $\\frac{$", trials=tuple(trials)), steps=20
    )


@pytest.mark.slow
def test_pages_show_them_as_text(tmp_path):
    tree = hostile_tree()
    write_result(tree, tmp_path)
    for page in (build_report(tmp_path), build_uncertainty(tmp_path)):
        text = page.read_text(encoding="utf-8")
        assert "<script>alert" not in text
        assert "<img src=x" not in text
        assert '" onload=' not in text
        assert "&lt;script&gt;alert(2)" in text
        drawings = [base64.b64decode(code).decode() for code in re.findall(r"svg\+xml;base64,([A-Za-z0-9+/=]+)", text)]
        assert not [drawing for drawing in drawings if "<script" in drawing or "<img" in drawing]
        assert [drawing for drawing in drawings if r"t $\frac{x$" in drawing]


@pytest.mark.parametrize("test", [HOSTILE[0], HOSTILE[3]])
def test_plots_take_them(test):
    tree = hostile_tree()
    figure, axes = plt.subplots()
    plots.loop(tree, test, ax=axes)
    plots.errors(tree, ax=axes)
    figure.canvas.draw()
    plt.close(figure)
