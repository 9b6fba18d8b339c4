"""Equivalents of Figures 7 to 10 of Hackl et al. 2016 on the bundled campaign."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from mofit.problem import Problem
from mofit.report.calibration import draw_stage, extract_stages
from mofit.report.run import Run
from mofit.report.toolkit.figures import BASELINE, MEASURED, MODE_COLOURS, styled
from paper_tables import NAMES, TABLE_3, UNITS, WIDE, FloatArray, frequency


def draw_all(
    problem: Problem,
    tree: xr.DataTree,
    shown: dict[float, tuple[FloatArray, FloatArray]],
    errors: dict[str, FloatArray],
    folder: Path,
) -> None:
    """Write figure_7.png to figure_10.png into a folder."""
    with styled():
        draw_stages(Run(tree), folder)
        draw_areas(shown, folder)
        draw_comparison(problem, tree, errors, folder)


def draw_stages(run: Run, folder: Path) -> None:
    """Figures 7 and 8."""
    for number, stage in zip((7, 8), extract_stages(run), strict=True):
        figure, (axes, residual) = plt.subplots(2, 1, figsize=(6, 4.6), sharex=True, height_ratios=(3, 1))
        draw_stage(stage, axes, residual)
        figure.savefig(folder / f"figure_{number}.png", dpi=110, bbox_inches="tight")
        plt.close(figure)


def draw_areas(shown: dict[float, tuple[FloatArray, FloatArray]], folder: Path) -> None:
    """Figure 9."""
    figure, axes = plt.subplots(2, 3, figsize=(10, 6), layout="constrained")
    pairs = ((0, 1), (1, 2), (0, 2))
    for row, title in enumerate(("final fireflies", "bests of clusters")):
        for column, (first, second) in enumerate(pairs):
            spot = axes[row, column]
            for colour, (hertz, groups) in zip(MODE_COLOURS, shown.items(), strict=False):
                spot.plot(
                    *groups[row][:, [first, second]].T, "o", ms=5, color=colour, mec="white", label=f"{hertz:g} Hz"
                )
            spot.plot(*np.array(list(TABLE_3.values()))[:, [first, second]].T, "x", color=MEASURED, label="Table 3")
            spot.set(
                xlabel=f"{NAMES[first]} ({UNITS[first]})", ylabel=f"{NAMES[second]} ({UNITS[second]})",
                xlim=(-0.03 * WIDE[first], 1.03 * WIDE[first]), ylim=(-0.03 * WIDE[second], 1.03 * WIDE[second]),
            )  # fmt: skip
        axes[row, 0].set_title(f"{title} with less error than Kelvin–Voigt")
    axes[0, 2].legend(ncols=2)
    figure.savefig(folder / "figure_9.png", dpi=110)
    plt.close(figure)


def draw_comparison(problem: Problem, tree: xr.DataTree, errors: dict[str, FloatArray], folder: Path) -> None:
    """Figure 10: force of one test, and the NRMSD of every test and model."""
    test = min(problem.tests, key=lambda name: abs(frequency(problem, name) - 2.5))
    measured, mode = np.ravel(tree["observed_data"][test].values), tree["modes/m1"]
    simulated = {
        "Maxwell, jointly": (np.ravel(mode["prediction"][test].values), MODE_COLOURS[0]),
        "Kelvin–Voigt": (np.ravel(tree["baseline/prediction"][test].values), BASELINE),
    }
    experiment = problem.experiments[problem.tests.index(test)]
    angle, time = np.rad2deg(experiment.inputs[:, 0]), experiment.step * np.arange(len(measured))
    period = slice(-int(2 / (frequency(problem, test) * experiment.step)), None)
    figure, ((left, right), (below, spare)) = plt.subplots(2, 2, figsize=(10, 7), layout="constrained")
    for axes, x in ((left, time), (right, angle)):
        axes.plot(x[period], measured[period], ".", ms=3, color=MEASURED, label="measured (simulated rig)")
        for name, (force, colour) in simulated.items():
            axes.plot(x[period], force[period], color=colour, label=name)
        axes.set_ylabel("lateral force (N)")
    left.set(xlabel="time (s)", title=f"{frequency(problem, test):g} Hz")
    right.set_xlabel("slip angle (deg)")
    right.legend(loc="upper left")
    hertz = [frequency(problem, name) for name in problem.tests]
    for (name, values), style in zip(
        errors.items(), (("s-", BASELINE), ("^-", MODE_COLOURS[1]), ("o-", MODE_COLOURS[0])), strict=True
    ):
        below.plot(hertz, 100 * values, style[0], color=style[1], label=name)
    floor = tree["per_frequency"]["nrmsd"].values[:, 0]
    below.plot(hertz, 100 * floor, ":", color=MEASURED, label="exact minimum of each test")
    below.set(xlabel="frequency (Hz)", ylabel="NRMSD (%)", ylim=(0, None))
    below.legend()
    spare.plot(hertz, errors["Kelvin–Voigt"] / errors["Maxwell, jointly"], "o-", color=MODE_COLOURS[0])
    spare.axhline(1, color=BASELINE)
    spare.set(xlabel="frequency (Hz)", ylabel="NRMSD, Kelvin–Voigt over Maxwell", ylim=(0, None))
    figure.savefig(folder / "figure_10.png", dpi=110)
    plt.close(figure)
