"""Pictures of the documentation: ``python scripts/docs_pictures.py [NAME ...]`` writes docs/images/NAME.svg.

Without names it draws all. The pictures of a result come from one identification of the bundled campaign, those of a
diagnosis from that campaign and from a simulated one with two effects, those of the gallery from its own code.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

import gallery
import mofit
from mofit import plots
from mofit.data import bundled_campaign
from mofit.diagnosis.result import Diagnosis
from mofit.diagnosis.spectral_classes import CLASS_INDEX, SPECTRAL_CLASSES
from mofit.optimize.searches import effa
from mofit.sampling import verdict

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
#: What the simulated campaign of the diagnosis has beside Table 5 of the paper, in its sines.
TWO_EFFECTS = """
[[effects]]
name = "asymmetric_stiffness"
parameters = { k_a = "1200 N/m" }
kinds = ["sine"]

[[effects]]
name = "wheel_order"
parameters = { A_wc = "14 N", A_ws = "14 N" }
kinds = ["sine"]
"""
#: The rig of the tutorial: its damper has a relaxation time, the Kelvin-Voigt damper has none.
ZENER_DAMPER = """
title = "Zener damper (simulated)"
model = "maxwell_damper"
seed = 1
parameters = { c = 800.0, p = 0.0, d = 0.0, c_M = 60e3, d_M = 2400.0 }

[noise.force]
sd = "4 N"

[defaults]
kind = "sine"
amplitude = "10 mm"
sample_rate = "500 Hz"

[[tests]]
name = "sine_0_5Hz"
frequency = "0.5 Hz"
duration = "20 s"

[[tests]]
name = "sine_2Hz"
frequency = "2 Hz"
duration = "5 s"

[[tests]]
name = "sine_8Hz"
frequency = "8 Hz"
duration = "1.25 s"
"""
STYLE = {
    "svg.hashsalt": "mofit",  # the same picture gives the same bytes
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "white",  # readable on a dark page, too
}
BLUE, ORANGE, GREY = "#1f5fa8", "#d1701c", "#8a929b"

#: Name of a picture -> function that draws it.
PICTURES: dict[str, Callable[[], Figure]] = gallery.pictures()


def picture(draw: Callable[[], Figure]) -> Callable[[], Figure]:
    """Register a picture under its function's name."""
    PICTURES[draw.__name__] = draw
    return draw


@cache
def identified() -> xr.DataTree:
    """The result of ``mofit identify --all-freqs``."""
    with tempfile.TemporaryDirectory() as folder:
        campaign = mofit.read_campaign(bundled_campaign())
        return mofit.identify(campaign, mofit.find_model("maxwell_tyre"), out=Path(folder) / "run")[1]


@cache
def group() -> Diagnosis:
    """The diagnosis of ``mofit diagnose``: two effects that the bundled campaign cannot distinguish."""
    return mofit.diagnose(mofit.read_campaign(bundled_campaign()), mofit.find_model("maxwell_tyre"))


@cache
def several() -> Diagnosis:
    """The diagnosis of a simulated campaign with two effects."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.toml"
        table5 = (ROOT / "data" / "plans" / "table5.toml").read_text(encoding="utf-8")
        plan.write_text(table5 + TWO_EFFECTS, encoding="utf-8")
        return mofit.diagnose(mofit.simulate(plan), mofit.find_model("maxwell_tyre"))


@picture
def result_errors() -> Figure:
    """NRMSD of every test against its noise floor."""
    figure, axes = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
    plots.errors(identified(), ax=axes)
    return figure


@picture
def result_verdicts() -> Figure:
    """A posterior for each verdict, in the unit cube."""
    rng = np.random.default_rng(1)
    examples = [
        rng.normal(0.45, 0.05, 20_000),
        rng.beta(3.0, 3.0, 20_000),
        1 - np.abs(rng.normal(0.0, 0.12, 20_000)),
        np.abs(rng.normal(0.0, 0.12, 20_000)),
        rng.uniform(0.0, 1.0, 20_000),
    ]
    draws = np.stack([np.clip(own, 0, 1) for own in examples], axis=1)
    figure, panels = plt.subplots(1, 5, figsize=(7.6, 1.7), layout="constrained", sharex=True)
    for axes, own, word in zip(panels, draws.T, verdict(draws), strict=True):
        axes.hist(own, bins=np.linspace(0, 1, 31), density=True, color=BLUE, alpha=0.75)
        axes.axhline(1.0, color=GREY, lw=1)  # the prior
        axes.set(yticks=[], xlim=(-0.02, 1.02), xticks=[0, 1], xticklabels=["lower", "upper"])
        axes.set_title(word, fontsize=8.5)
    return figure


@picture
def method_search() -> Figure:
    """The default search on two tests that prefer different points: fireflies over generations, clusters, minima."""
    shifts = np.array([[0.0, 0.0], [0.12, 0.08]])

    def cost(u: np.ndarray) -> np.ndarray:
        return gradients(u)[0]

    def gradients(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v = u[:, None] - shifts
        x, y = np.moveaxis(np.pi * v * [3, 2], -1, 0)
        values = 1.2 - 0.5 * np.cos(x) * np.cos(y) + ((v - 0.55) ** 2).sum(-1)
        slope = np.stack([1.5 * np.pi * np.sin(x) * np.cos(y), np.pi * np.cos(x) * np.sin(y)], -1)
        return values, slope + 2 * (v - 0.55)

    found = effa.search(cost, gradients, 2, np.random.default_rng(1))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 31), np.linspace(0, 1, 31)), axis=-1)
    height = cost(grid.reshape(-1, 2)).mean(axis=1).reshape(31, 31)
    figure, panels = plt.subplots(1, 3, figsize=(8.4, 3.2), layout="constrained", sharey=True)
    colours = plt.get_cmap("tab10")
    single = np.array(found.minimises) >= 0
    for axes, generation in zip(panels, (0, 1, 2), strict=True):
        axes.contour(*grid.transpose(2, 0, 1), height, levels=4, cmap="Greys", linewidths=0.6)
        here, label = found.points[found.generations[generation]], found.generation_labels[generation]
        axes.scatter(*here.T, s=14, c=[colours(k % 10) for k in label])
        axes.plot(*found.archived_points[~single].T, "*", ms=11, color=ORANGE, mec="white", label="minimum of the mean")
        axes.plot(*found.archived_points[single].T, "s", ms=5, mfc="none", mec="black", label="of a single test")
        axes.set(title=f"generation {generation}", xlabel="parameter 1", xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))
    panels[0].set_ylabel("parameter 2, unit cube")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
    return figure


@picture
def method_sandwich() -> Figure:
    """Estimates from coloured noise scatter more than the curvature of the squares says."""
    rng, count, records, pole = np.random.default_rng(2), 400, 300, 0.8
    phase = 2 * np.pi * np.arange(count) / 100
    slopes = np.stack([np.sin(phase), np.ones(count)], axis=1)  # parameters: an amplitude and an offset
    noise = np.zeros((records, count))
    kicks = rng.normal(0, np.sqrt(1 - pole**2), (records, count))
    for k in range(1, count):
        noise[:, k] = pole * noise[:, k - 1] + kicks[:, k]
    lag = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    curvature = slopes.T @ slopes
    scatter = slopes.T @ pole**lag @ slopes
    inverse = np.linalg.inv(curvature)
    figure, axes = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
    axes.plot(*(noise @ slopes @ inverse).T, ".", ms=3, color=GREY, label=f"estimates from {records} records")
    for covariance, colour, label in (
        (inverse, ORANGE, r"$H^{-1}$, 90 %"),
        (inverse @ scatter @ inverse, BLUE, r"$H^{-1} J H^{-1}$, 90 %"),
    ):
        values, vectors = np.linalg.eigh(covariance)
        width, height = 2 * np.sqrt(4.605 * values)  # 90 % of chi-square with 2 degrees of freedom
        turn = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
        axes.add_patch(Ellipse((0, 0), width, height, angle=turn, fill=False, lw=2, color=colour, label=label))
    axes.set(xlabel="error of the amplitude", ylabel="error of the offset")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    return figure


@picture
def method_profile() -> Figure:
    """Profile likelihood of one parameter, its 90 % interval, and the quadratic model of the Laplace approximation."""
    mode = identified()["modes/m1"]
    name = "d_M"
    profile, own = mode["profile"].sel(parameter=name), mode.to_dataset().sel(parameter=name)
    value, height = profile["value"].values, profile["neg_log_posterior"].values
    best, sd = float(own["value"]), float(own["laplace_sd"])
    fine = np.linspace(value[0], value[-1], 200)
    figure, axes = plt.subplots(figsize=(4.4, 2.8), layout="constrained")
    axes.plot(fine, 0.5 * ((fine - best) / sd) ** 2, "--", color=ORANGE, label="Laplace approximation")
    axes.plot(value, height, "o-", ms=4, color=BLUE, label="profile likelihood")
    axes.axhline(1.35, color=GREY, lw=1)
    axes.annotate("1.35: 90 % interval", (best, 1.35), (0, 3), textcoords="offset points", ha="center", color="#555555")
    axes.set(xlabel=f"${name}$ (N s/m)", ylabel="rise of −log posterior", ylim=(0, 5))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    return figure


@picture
def diagnosis_map() -> Figure:
    """Gap per test and spectral class, without effects and with the best model."""
    found = several()
    tests = list(found.before.squares)
    classes = [one for one in SPECTRAL_CLASSES if one.name in {entry.lines for entry in found.before.entries}]
    names, largest = [one.name for one in classes], max(entry.gap for entry in found.before.entries)
    figure, panels = plt.subplots(1, 2, figsize=(7.6, 2.9), layout="constrained", sharey=True)
    for axes, source, title in zip(panels, (found.before, found.after), ("without effects", "best model"), strict=True):
        clear = source.significant(0.01)
        values = np.zeros((len(tests), len(classes)))
        for entry in source.entries:
            row, column = tests.index(entry.test), names.index(entry.lines)
            values[row, column] = entry.gap
            ink = "white" if entry.gap > 0.5 * largest else "black" if entry in clear else GREY
            weight = "bold" if entry in clear else "normal"
            axes.text(column, row, f"{entry.gap:.1f}", ha="center", va="center", color=ink, weight=weight, fontsize=7)
        axes.imshow(values, cmap="Blues", vmin=0, vmax=largest, aspect="auto")
        axes.set_xticks(range(len(classes)), [one.label for one in classes], fontsize=7)
        axes.set_yticks(range(len(tests)), tests, fontsize=7)
        axes.set_title(f"{title}: gap (N)", fontsize=8.5)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    return figure


@picture
def diagnosis_held_out() -> Figure:
    """Loops of each test, measured and predicted by the fit to the others, without the effect and with it."""
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.toml"
        plan.write_text(ZENER_DAMPER, encoding="utf-8")
        found = mofit.diagnose(mofit.simulate(plan), mofit.find_model("kelvin_voigt_damper"))
    shrinkage = found.shrinkage and found.shrinkage.of("test")
    assert shrinkage is not None
    figure, panels = plt.subplots(1, 3, figsize=(7.6, 2.5), layout="constrained")
    problem = found.observed.problem
    predictions = [one for hold_out in shrinkage.hold_outs for one in hold_out.predictions]
    for axes, one in zip(panels, predictions, strict=True):
        test = problem.measurements[problem.tests.index(one.test)]
        count = round(1 / (test.experiment.frequency * test.experiment.step))
        shown = np.unique(np.linspace(0, count, 126).astype(int))  # one period, not all of its samples
        stroke, force = (test.channel(name)[one.start + shown] for name in ("displacement", "force"))
        axes.plot(1e3 * stroke, force, ".", ms=3, color=GREY, label="measured")
        axes.plot(1e3 * stroke, one.before[shown], "--", color=ORANGE, label="predicted without the effect")
        axes.plot(1e3 * stroke, one.after[shown], color=BLUE, label="predicted with the effect")
        axes.set_title(one.test, fontsize=8.5)
        axes.set_xlabel("stroke (mm)")
    panels[0].set_ylabel("force (N)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure


@picture
def diagnosis_models() -> Figure:
    """Criterion of the candidate models above the best one."""
    found = group().attribution
    ten, hundred = 2 * np.log(10), 2 * np.log(100)  # so many times less probable
    models = [*found.models[:6], next(one for one in found.models if not one.effects)][::-1]
    above = [one.criterion - found.best.criterion for one in models]
    labels = [" + ".join(one.effects) or "no effect" for one in models]
    figure, axes = plt.subplots(figsize=(6.4, 2.4), layout="constrained")
    axes.axvspan(0, ten, color=BLUE, alpha=0.25, lw=0, label="indistinguishable")
    axes.axvspan(ten, hundred, color=GREY, alpha=0.25, lw=0, label="not ruled out")
    axes.plot(above, labels, "o", color=BLUE)
    axes.set_xscale("symlog", linthresh=10)
    axes.set(xlabel="EBIC above the best model", xlim=(-1, 2 * max(above)))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
    return figure


@picture
def diagnosis_lines() -> Figure:
    """Power of the whitened residual of one test without effects, by class of lines."""
    found, test = several(), "sine_2_00Hz"
    observed, fitted = found.observed, found.attribution.baseline
    record = observed.problem.tests.index(test)
    own = observed.record == record
    line, kinds = observed.line[own], observed.spectral_class[own]
    power = np.bincount(line, fitted.residual[: len(own)][own] ** 2) / np.bincount(line)
    frequency, kind = observed.records[record][2].frequencies, np.zeros(len(power), dtype=int)
    kind[line] = kinds
    low = frequency < 25  # above there is nothing but noise
    frequency, kind, power = frequency[low], kind[low], power[low]
    figure, axes = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
    colours = {"other": "#c8cdd2", "odd": BLUE, "even": ORANGE, "rotating": "#2f8f5b", "slow": "#8a4fa3", "dc": "black"}
    for name, colour in colours.items():
        here = kind == CLASS_INDEX[name]
        label = next(one.phrase for one in SPECTRAL_CLASSES if one.name == name).removeprefix("the ")
        axes.plot(frequency[here], power[here], ".", ms=4 if name == "other" else 8, color=colour, label=label)
    axes.axhline(1.0, color=GREY, lw=1)
    axes.set(yscale="log", ylim=(0.02, None), xlim=(-0.3, 25), xlabel="frequency (Hz)", ylabel="power over noise")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


def main(names: list[str]) -> None:
    """Draw the pictures named, or all."""
    IMAGES.mkdir(exist_ok=True)
    with plt.rc_context(STYLE):
        for name in names or PICTURES:
            figure = PICTURES[name]()
            figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None, "Creator": None})
            plt.close(figure)
            print(f"docs/images/{name}.svg")


if __name__ == "__main__":
    main(sys.argv[1:])
