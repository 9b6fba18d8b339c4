"""Pictures of the gallery: what the code in docs/gallery.md draws; scripts/docs_pictures.py writes them."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from contextlib import chdir
from functools import cache, partial
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

import mofit

PAGE = Path(__file__).resolve().parents[1] / "docs" / "gallery.md"
#: The rig: a Kelvin-Voigt damper on four sines.
RIG = """
title = "Damper rig (simulated)"
model = "kelvin_voigt_damper"
seed = 1
parameters = { c = 2000.0, p = 0.0, d = 1500.0, F_0 = 0.0 }

[noise.force]
sd = "2 N"

[defaults]
kind = "sine"
sample_rate = "100 Hz"
"""
TEST = """
[[tests]]
name = "sine_{frequency:g}Hz"
frequency = "{frequency:g} Hz"
amplitude = "{amplitude:g} mm"
periods = {periods}
"""
STROKES = ((0.5, 20, 4), (1.0, 20, 6), (2.0, 10, 8), (4.0, 5, 12))


def blocks() -> tuple[str, dict[str, str]]:
    """The code that the page begins with, and that of each picture by its name."""
    text = PAGE.read_text(encoding="utf-8")
    code = r"```python\n([^`]*)```\n"
    found = re.findall(code + r"\n!\[[^\]]+\]\(images/(gallery_\w+)\.svg\)", text)
    return re.search(code, text)[1], {name: own for own, name in found}  # type: ignore[index]


@cache
def place() -> tempfile.TemporaryDirectory[str]:
    """A folder with the plan of the rig and the run that the page opens."""
    folder = tempfile.TemporaryDirectory()
    tests = (TEST.format(frequency=f, amplitude=a, periods=n) for f, a, n in STROKES)
    plan = Path(folder.name) / "rig.toml"
    plan.write_text(RIG + "".join(tests), encoding="utf-8")
    mofit.identify(mofit.simulate(plan), "kelvin_voigt_damper", out=plan.parent / "runs" / "damper")
    return folder


def drawn(code: str) -> Figure:
    """The figure that some code of the page draws."""
    with chdir(place().name):
        plt.figure(figsize=(5.8, 3.4), layout="constrained")
        exec(blocks()[0] + code, {})
        return plt.gcf()


def pictures() -> dict[str, Callable[[], Figure]]:
    """Name of each picture of the page -> function that draws it."""
    return {name: partial(drawn, code) for name, code in blocks()[1].items()}
