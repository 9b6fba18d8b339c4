"""Posterior predictive bands over frequency: error, and amplitude and phase of the fundamental."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator
from scipy.special import stdtrit

from mofit.report.display import Unit, compact, number, percent
from mofit.report.overlay import output_unit
from mofit.report.page import Block, Details, Figure, Section, Table, Text
from mofit.report.per_frequency import thinned
from mofit.report.run import Array, Run
from mofit.report.style import FLOOR, MEASURED, cluster_colour, few_ticks, image_of, legend_above, line_key, panels
from mofit.report.uncertainty.predictive import NINETY, Prediction, extract_predictions

_FEW_PERIODS = 3
"""From so many whole periods on, the scatter between them tells how well the measured fundamental is known."""


@dataclass(frozen=True)
class Fundamental:
    """Amplitude (SI unit) and phase against the input (degrees) of tests with a period, in order of frequency.

    Measured with the half-width of its 90 % interval; of the draws the 5, 50 and 95 % quantiles, shape (test, 3).
    """

    tests: list[str]
    frequency: Array
    amplitude: Array
    amplitude_error: Array
    phase: Array
    phase_error: Array
    amplitude_draws: Array
    phase_draws: Array


@dataclass(frozen=True)
class Errors:
    """NRMSD of the draws per test, quantiles 5, 50 and 95 %, shape (test, 3), and the noise floor."""

    tests: list[str]
    frequency: Array
    nrmsd: Array
    noise_floor: Array


def lines(time: Array, signals: Array, frequency: float) -> Array:
    r"""Complex amplitudes of signals (k, n) at a frequency, by least squares with a mean; shape (k,).

    :math:`y \approx \bar y + \mathrm{Re}\,(z e^{2 \pi i f t})`.
    """
    angle = 2 * np.pi * frequency * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    fitted = np.linalg.lstsq(basis, signals.T, rcond=None)[0]
    return np.asarray(fitted[0] - 1j * fitted[1])


def extract_fundamental(found: list[Prediction]) -> Fundamental | None:
    """From all tests with an input and a period of which at least one whole one was judged; None if there is none."""
    rows = [row for p in found if (row := _fundamental(p)) is not None]
    if not rows:
        return None
    rows.sort(key=lambda row: row[1])
    tests = [row[0] for row in rows]
    return Fundamental(tests, *(np.array([row[k] for row in rows]) for k in range(1, 8)))


def _fundamental(p: Prediction) -> tuple[str, float, float, float, float, float, Array, Array] | None:
    overlay = p.overlay
    period = overlay.period if overlay.period > 0 else (1 / p.frequency if p.frequency > 0 else np.nan)
    if overlay.kind != "sine" or not overlay.input.size or not np.isfinite(period):
        return None
    step = float(np.median(np.diff(overlay.time)))
    whole = int((overlay.time[-1] - overlay.time[0] + step) / period + 1e-6)
    if whole < 1:
        return None
    kept = overlay.time > overlay.time[-1] - whole * period + step / 2
    time = overlay.time[kept]
    both = np.concatenate([overlay.input[None], overlay.measured[None], p.draws])[:, kept]
    source, measured, *drawn = lines(time, both, 1 / period)
    if not abs(source) > 0:
        return None
    turn = source / abs(source)
    error = _error(time, both[:2], period, whole, overlay.noise_sd)
    size, angle = abs(measured), np.angle(measured / turn)
    off = np.angle(np.array(drawn) / measured)  # against the measured phase: no jump at 180 degrees
    return (
        overlay.test, 1 / period, float(size), error, float(np.degrees(angle)), float(np.degrees(error / size)),
        np.quantile(np.abs(drawn), [0.05, 0.5, 0.95]), np.degrees(angle + np.quantile(off, [0.05, 0.5, 0.95])),
    )  # fmt: skip


def _error(time: Array, signals: Array, period: float, whole: int, noise_sd: float) -> float:
    """Half-width of the 90 % interval of the measured amplitude.

    By the scatter of the fundamental from period to period, which holds coloured noise as well; of the white noise's
    standard deviation where periods are few.
    """
    if whole < _FEW_PERIODS:
        return float(NINETY * noise_sd * np.sqrt(2 / time.size))
    number_of = np.minimum(((time - time[0]) / period + 1e-9).astype(int), whole - 1)
    each = np.array([lines(time[number_of == k], signals[:, number_of == k], 1 / period) for k in range(whole)])
    turned = each[:, 1] / each[:, 0] * np.abs(each[:, 0])
    variance = np.sum(np.abs(turned - turned.mean()) ** 2) / (2 * (whole - 1))
    return float(stdtrit(2 * (whole - 1), 0.95) * np.sqrt(variance / whole))


def extract_errors(found: list[Prediction]) -> Errors:
    """Error of every draw on every test."""
    rows = []
    for p in found:
        span = float(np.ptp(p.overlay.measured)) or 1.0
        rows.append(np.sqrt(np.mean((p.draws - p.overlay.measured) ** 2, axis=1)) / span)
    return Errors(
        [p.overlay.test for p in found],
        np.array([p.frequency for p in found]),
        np.array([np.quantile(row, [0.05, 0.5, 0.95]) for row in rows]),
        np.array([p.noise_floor for p in found]),
    )


def frequency_section(run: Run) -> Section | None:
    """Figure and table of the best solution's predictions over frequency."""
    found = extract_predictions(run, run.clusters[0])
    if not found:
        return None
    errors, fundamental = extract_errors(found), extract_fundamental(found)
    blocks: list[Block] = [_figure(errors, fundamental, output_unit([p.overlay for p in found]))]
    if fundamental is not None:
        blocks = [Text(words(fundamental)), *blocks, Details("Table of the fundamental", [_table(fundamental, found)])]
    return Section(
        "frequency",
        "Predictive bands over frequency",
        blocks,
        {"errors": errors, "fundamental": fundamental},
    )


def words(found: Fundamental) -> str:
    """On how many tests the bands of measurement and draws overlap."""
    apart = [
        test
        for k, test in enumerate(found.tests)
        if _apart(found.amplitude[k], found.amplitude_error[k], found.amplitude_draws[k])
        or _apart(found.phase[k], found.phase_error[k], found.phase_draws[k])
    ]
    if not apart:
        return "On every test the measured fundamental and the draws agree within their 90 % bands."
    return (
        f"On {len(apart)} of {len(found.tests)} tests the measured fundamental lies off the draws by more than both "
        f"90 % bands: {', '.join(apart)}. The spread of the parameters doesn't explain that; the model's form would."
    )


def _apart(measured: float, error: float, draws: Array) -> bool:
    return bool(measured - error > draws[2] or measured + error < draws[0])


def _figure(errors: Errors, found: Fundamental | None, unit: Unit) -> Figure:
    count = 1 if found is None else 3
    canvas, axes, below = panels(count, 3, 1.7, lower=0.85, margin=(0.75, 0.6, 0.15, 0.65), gap=(0.8, 0.8))
    _draw_errors(errors, axes[-1], below[-1])
    if found is not None:
        f = unit.factor
        _draw_line(found, f * found.amplitude, f * found.amplitude_error, f * found.amplitude_draws, axes[0], below[0],
                   100 / (f * found.amplitude))  # fmt: skip
        axes[0].set_title("amplitude of the fundamental")
        axes[0].set_ylabel(unit.name)
        below[0].set_ylabel("off by (%)")
        _draw_line(found, found.phase, found.phase_error, found.phase_draws, axes[1], below[1],
                   np.ones_like(found.phase))  # fmt: skip
        axes[1].set_title("phase against the input")
        axes[1].set_ylabel("°")
        below[1].set_ylabel("off by (°)")
    legend_above(
        canvas,
        [
            line_key(MEASURED, "measured, 90 %", ls="none", marker="o", ms=4),
            line_key(cluster_colour(0), "draws, 5–95 %", lw=6, alpha=0.5),
            line_key(FLOOR, "noise floor", lw=2),
        ],
    )
    return Figure(
        image_of(canvas),
        "Amplitude, phase and error over frequency with their bands",
        "Above the values, below what the draws are off: from the measured amplitude in per cent, from the measured "
        "phase in degrees (90 % band of the measurement around 0), and from the noise floor as a ratio.",
        good="the draws' band crosses the bars of the measurement, and the error is close to the noise floor.",
        bad="a drift over frequency beyond the bars: the model's stiffness or damping depends on frequency in another "
        "way than the specimen's.",
    )


def _draw_line(
    found: Fundamental, value: Array, error: Array, draws: Array, axes: Axes, below: Axes, scale: Array
) -> None:
    x, colour = found.frequency, cluster_colour(0)
    axes.fill_between(x, draws[:, 0], draws[:, 2], color=colour, alpha=0.4, lw=0)
    axes.plot(x, draws[:, 1], color=colour, lw=1.2)
    axes.errorbar(x, value, error, color=MEASURED, ls="none", marker="o", ms=4, elinewidth=0.9)
    off = (draws - value[:, None]) * scale[:, None]
    below.fill_between(x, off[:, 0], off[:, 2], color=colour, alpha=0.4, lw=0)
    below.plot(x, off[:, 1], color=colour, lw=1.2, marker=".", ms=4)
    below.errorbar(x, 0 * x, error * scale, color=MEASURED, ls="none", marker="o", ms=3.2, elinewidth=0.9)
    _over_frequency(x, axes)
    few_ticks(axes, None, 4)
    few_ticks(below, None, 3)
    below.set_xlabel("frequency (Hz)")


def _draw_errors(errors: Errors, axes: Axes, below: Axes) -> None:
    over = bool(np.isfinite(errors.frequency).all() and len(set(errors.frequency)) == len(errors.tests) > 1)
    order = np.argsort(errors.frequency, kind="stable") if over else np.arange(len(errors.tests))
    x = errors.frequency[order] if over else np.arange(len(errors.tests), dtype=float)
    nrmsd, floor, colour = 100 * errors.nrmsd[order], 100 * errors.noise_floor[order], cluster_colour(0)
    ratio = nrmsd / np.where(floor > 0, floor, np.nan)[:, None]
    for panel, band in ((axes, nrmsd), (below, ratio)):
        panel.vlines(x, band[:, 0], band[:, 2], color=colour, lw=5, alpha=0.4)
        panel.plot(x, band[:, 1], color=colour, lw=1.0, marker=".", ms=4)
        few_ticks(panel, None, 4 if panel is axes else 3)
    axes.plot(x, floor, color=FLOOR, lw=2)
    below.axhline(1, color=FLOOR, lw=2)
    axes.set_ylim(bottom=0)
    axes.set_title("NRMSD")
    axes.set_ylabel("%")
    below.set_ylabel("× floor")
    if over:
        _over_frequency(x, axes)
        below.set_xlabel("frequency (Hz)")
    else:
        below.set_xticks(x, [errors.tests[k] for k in order], rotation=35, ha="right")


def _over_frequency(x: Array, axes: Axes) -> None:
    if x.min() > 0 and x.max() > 3 * x.min():
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_locator(FixedLocator(thinned(x)))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")


def _table(found: Fundamental, predictions: list[Prediction]) -> Table:
    unit = output_unit([p.overlay for p in predictions])
    f = unit.factor
    rows = []
    for k, test in enumerate(found.tests):
        draws = [f"{number(f * low, 4)} … {number(f * high, 4)}" for low, _, high in found.amplitude_draws[k : k + 1]]
        phases = [f"{number(low, 4)} … {number(high, 4)}" for low, _, high in found.phase_draws[k : k + 1]]
        rows.append(
            [
                test, compact(found.frequency[k], 4),
                f"{number(f * found.amplitude[k], 4)} ± {number(f * found.amplitude_error[k], 2)}", *draws,
                percent(found.amplitude_draws[k, 1] / found.amplitude[k] - 1),
                f"{number(found.phase[k], 4)} ± {number(found.phase_error[k], 2)}", *phases,
            ]
        )  # fmt: skip
    return Table(
        ["Test", "Frequency (Hz)", f"Amplitude ({unit.name})", "Draws", "Off by", "Phase (°)", "Draws"],
        rows,
        "Fundamental of each test: measured with its 90 % interval, and the 5–95 % range of the draws.",
    )
