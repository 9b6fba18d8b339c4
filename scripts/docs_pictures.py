"""Pictures of the documentation: ``python scripts/docs_pictures.py [NAME ...]`` writes docs/images/NAME.svg.

Without names it draws all. The pictures of a result come from one identification of the bundled campaign.
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

import mofit
from mofit import plots
from mofit.data.examples import bundled_campaign
from mofit.optimize.searches import mlsl
from mofit.sampling import verdict

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
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
PICTURES: dict[str, Callable[[], Figure]] = {}


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
    """Multi-level single linkage on a function with several minima."""

    def cost(u: np.ndarray) -> np.ndarray:
        return (
            1.2 - 0.5 * np.cos(3 * np.pi * u[:, :1]) * np.cos(2 * np.pi * u[:, 1:]) + ((u - 0.6) ** 2).sum(1)[:, None]
        )

    def gradients(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = (np.pi * u * [3, 2]).T
        slope = np.stack([1.5 * np.pi * np.sin(x) * np.cos(y), 1.0 * np.pi * np.cos(x) * np.sin(y)], 1)
        return cost(u), (slope + 2 * (u - 0.6))[:, None, :]

    found = mlsl.search(cost, gradients, 2, np.random.default_rng(1))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41)), axis=-1)
    figure, axes = plt.subplots(figsize=(4.4, 3.4), layout="constrained")
    height = cost(grid.reshape(-1, 2)).reshape(41, 41)
    axes.contour(*grid.transpose(2, 0, 1), height, levels=5, cmap="Blues_r", linewidths=0.7)
    axes.plot(*found.points.T, ".", ms=3, color=GREY, label=f"evaluated points ({len(found.points)})")
    axes.plot(*found.points[found.archived].T, "o", ms=6, color=ORANGE, mec="white", label="minima found")
    axes.set(xlabel="parameter 1, unit cube", ylabel="parameter 2, unit cube", xlim=(0, 1), ylim=(0, 1))
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)
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
