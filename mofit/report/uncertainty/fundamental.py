"""Posterior predictive bands over frequency: error, and amplitude and phase of the fundamental."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.special import stdtrit

from mofit._typing import FloatArray
from mofit.report.overlay import NINETY, Overlay, by_output, headed, output_unit
from mofit.report.run import Run
from mofit.report.toolkit.axes import all_differ, axis_of_frequencies, axis_of_tests, few_ticks
from mofit.report.toolkit.blocks import Block, Column, Details, Figure, Section, Table, Text
from mofit.report.toolkit.figures import FLOOR, MEASURED, Panels, band_key, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import Unit, compact, number, percent
from mofit.report.uncertainty.loops import predictions

_FEW_PERIODS = 3
"""From so many whole periods on, the uncertainty of the measured fundamental follows from their scatter."""

_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Measured:
    """A quantity of several tests: measured, half-width of its 90 % interval, and of the draws 5, 50 and 95 % quantile.

    Shapes (test,), (test,) and (test, 3).
    """

    value: FloatArray
    error: FloatArray
    draws: FloatArray

    def apart(self) -> NDArray[np.bool_]:
        """Where the 90 % bands of measurement and draws do not overlap, shape (test,)."""
        low, high = self.value - self.error, self.value + self.error
        return np.asarray((low > self.draws[:, 2]) | (high < self.draws[:, 0]))

    def scaled(self, factor: float) -> Measured:
        """In another unit."""
        return Measured(factor * self.value, factor * self.error, factor * self.draws)

    def texts(self) -> tuple[list[str], list[str]]:
        """Cells of a table: the measurement, and the range of the draws."""
        measured = zip(self.value, self.error, strict=True)
        return (
            [f"{number(value, 4)} ± {number(error, 2)}" for value, error in measured],
            [f"{number(low, 4)} … {number(high, 4)}" for low, _, high in self.draws],
        )


@dataclass(frozen=True)
class Fundamental:
    """Amplitude (SI unit) and phase against the input (degrees) of tests with a period, in order of frequency."""

    tests: list[str]
    frequency: FloatArray
    amplitude: Measured
    phase: Measured


@dataclass(frozen=True)
class PredictedErrors:
    """NRMSD of the draws per test, quantiles 5, 50 and 95 %, shape (test, 3), and the noise floor."""

    tests: list[str]
    frequency: FloatArray
    nrmsd: FloatArray
    noise_floor: FloatArray


def lines(time: FloatArray, signals: FloatArray, frequency: float) -> FloatArray:
    r"""Complex amplitudes of signals (k, n) at a frequency, by least squares with a mean; shape (k,).

    :math:`y \approx \bar y + \mathrm{Re}\,(z e^{2 \pi i f t})`.
    """
    angle = 2 * np.pi * frequency * time
    basis = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    fitted = np.linalg.lstsq(basis, signals.T, rcond=None)[0]
    return np.asarray(fitted[0] - 1j * fitted[1])


def extract_fundamental(found: list[Overlay]) -> Fundamental | None:
    """From all sine tests with an input and at least one whole period; None if there is none."""
    rows = sorted((row for overlay in found if (row := _fundamental(overlay)) is not None), key=lambda row: row[1])
    if not rows:
        return None
    tests, frequency, *columns = zip(*rows, strict=True)
    size, size_error, size_draws, phase, phase_error, phase_draws = map(np.array, columns)
    return Fundamental(
        list(tests),
        np.array(frequency),
        Measured(size, size_error, size_draws),
        Measured(phase, phase_error, phase_draws),
    )


def _fundamental(o: Overlay) -> tuple[str, float, float, float, FloatArray, float, float, FloatArray] | None:
    period = o.period if o.period > 0 else (1 / o.frequency if o.frequency > 0 else np.nan)
    if o.excitation != "sine" or not o.input.size or not np.isfinite(period):
        return None
    step = float(np.median(np.diff(o.time)))
    whole = int((o.time[-1] - o.time[0] + step) / period + 1e-6)
    if whole < 1:
        return None
    kept = o.time > o.time[-1] - whole * period + step / 2
    time = o.time[kept]
    both = np.concatenate([o.input[None], o.measured[None], o.draws])[:, kept]
    source, measured, *drawn = lines(time, both, 1 / period)
    if not abs(source) > 0:
        return None
    error = _error(time, both[:2], period, whole, o.noise_sd)
    size, angle = abs(measured), np.angle(measured / source)
    off = np.angle(np.array(drawn) / measured)  # against the measured phase: no jump at 180 degrees
    return (
        o.test, 1 / period,
        float(size), error, np.quantile(np.abs(drawn), _QUANTILES),
        float(np.degrees(angle)), float(np.degrees(error / size)), np.degrees(angle + np.quantile(off, _QUANTILES)),
    )  # fmt: skip


def _error(time: FloatArray, signals: FloatArray, period: float, whole: int, noise_sd: float) -> float:
    """Half-width of the 90 % interval of the measured amplitude.

    By the scatter of the fundamental from period to period, which holds coloured noise as well; by the standard
    deviation of white noise where periods are few.
    """
    if whole < _FEW_PERIODS:
        return float(NINETY * noise_sd * np.sqrt(2 / time.size))
    period_of = np.minimum(((time - time[0]) / period + 1e-9).astype(int), whole - 1)
    each = np.array([lines(time[period_of == k], signals[:, period_of == k], 1 / period) for k in range(whole)])
    turned = each[:, 1] / each[:, 0] * np.abs(each[:, 0])
    variance = np.sum(np.abs(turned - turned.mean()) ** 2) / (2 * (whole - 1))
    return float(stdtrit(2 * (whole - 1), 0.95) * np.sqrt(variance / whole))


def extract_errors(found: list[Overlay]) -> PredictedErrors:
    """Error of every draw on every test."""
    rows = []
    for overlay in found:
        span = float(np.ptp(overlay.measured)) or 1.0
        rows.append(np.sqrt(np.mean((overlay.draws - overlay.measured) ** 2, axis=1)) / span)
    return PredictedErrors(
        [overlay.test for overlay in found],
        np.array([overlay.frequency for overlay in found]),
        np.array([np.quantile(row, _QUANTILES) for row in rows]),
        np.array([overlay.noise_floor for overlay in found]),
    )


def frequency_section(run: Run) -> Section | None:
    """Figure and table of the best mode's predictions over frequency."""
    found = predictions(run)
    if not found:
        return None
    blocks: list[Block] = []
    for output, own in by_output(found).items():
        fundamental, unit = extract_fundamental(own), output_unit(own)
        figure = _figure(extract_errors(own), fundamental, unit, output)
        if fundamental is None:
            blocks.append(figure)
        else:
            table = Details(headed("Table of the fundamental", output), [_table(fundamental, unit)])
            blocks += [Text(fundamental_text(fundamental)), figure, table]
    data = {"errors": extract_errors(found), "fundamental": extract_fundamental(found)}
    return Section("frequency", "Predictive bands over frequency", blocks, data)


def fundamental_text(found: Fundamental) -> str:
    """On how many tests the bands of measurement and draws overlap."""
    apart = [found.tests[k] for k in np.flatnonzero(found.amplitude.apart() | found.phase.apart())]
    if not apart:
        return "On every test the measured fundamental and the draws agree within their 90 % bands."
    return (
        f"On {len(apart)} of {len(found.tests)} tests the 90 % bands of the measured fundamental and the draws do not "
        f"overlap: {', '.join(apart)}. The uncertainty of the parameters does not explain that; the form of the model "
        "may."
    )


def _figure(errors: PredictedErrors, found: Fundamental | None, unit: Unit, output: str) -> Figure:
    legend = [
        dot_key(MEASURED, "measured, 90 %", size=4),
        band_key(mode_colour(0), "draws, 5–95 %", 0.5),
        line_key(FLOOR, "noise floor", lw=2),
    ]
    panels = Panels(
        1 if found is None else 3, 3, 1.7, legend=legend, lower=0.85, margin=(0.75, 0.6, 0.15), gap=(0.8, 0.8)
    )
    _draw_errors(errors, panels.axes[-1], panels.lower[-1])
    if found is not None:
        amplitude = found.amplitude.scaled(unit.factor)
        rows = (
            ("amplitude of the fundamental", f"amplitude ({unit.name})", amplitude, "%", 100 / amplitude.value),
            ("phase against the input", "phase (°)", found.phase, "°", np.ones_like(found.phase.value)),
        )
        for (title, name, values, off, scale), axes, below in zip(rows, panels.axes, panels.lower, strict=False):
            _draw_line(found.frequency, values, scale, axes, below)
            axes.set(title=title, ylabel=name)
            below.set_ylabel(f"deviation ({off})")
    return panels.figure(
        headed("Amplitude, phase and error over frequency with their bands", output),
        "Above: the values. Below: the deviation of the draws from the measured amplitude in per cent and from the "
        "measured phase in degrees, with the 90 % band of the measurement around 0; and the ratio of the error to the "
        "noise floor.",
        good="the band of the draws crosses the bars of the measurement, and the error is close to the noise floor.",
        bad="a drift over frequency beyond the bars: the model's stiffness or damping varies with frequency "
        "differently from the specimen's.",
        finding=_agreement(found) if found is not None else "The error of every test beside its noise floor.",
    )


def _agreement(found: Fundamental) -> str:
    """On how many tests measurement and draws agree."""
    apart = int((found.amplitude.apart() | found.phase.apart()).sum())
    return f"Measurement and draws agree on {len(found.tests) - apart} of {len(found.tests)} tests."


def _draw_line(x: FloatArray, found: Measured, scale: FloatArray, axes: Axes, below: Axes) -> None:
    colour = mode_colour(0)
    deviation = (found.draws - found.value[:, None]) * scale[:, None]
    bars: dict[str, Any] = {"color": MEASURED, "ls": "none", "marker": "o", "elinewidth": 0.9}
    for panel, draws, dot in ((axes, found.draws, ""), (below, deviation, ".")):
        panel.fill_between(x, draws[:, 0], draws[:, 2], color=colour, alpha=0.4, lw=0)
        panel.plot(x, draws[:, 1], color=colour, lw=1.2, marker=dot, ms=4)
    axes.errorbar(x, found.value, found.error, ms=4, **bars)
    below.errorbar(x, 0 * x, found.error * scale, ms=3.2, **bars)
    if all_differ(x):
        axis_of_frequencies(axes, x)
    few_ticks(axes, None, 4)
    few_ticks(below, None, 3)
    below.set_xlabel("frequency (Hz)")


def _draw_errors(errors: PredictedErrors, axes: Axes, below: Axes) -> None:
    over = all_differ(errors.frequency)
    order = np.argsort(errors.frequency, kind="stable") if over else np.arange(len(errors.tests))
    nrmsd, floor = 100 * errors.nrmsd[order], 100 * errors.noise_floor[order]
    if over:
        x = errors.frequency[order]
        axis_of_frequencies(axes, x)
        below.set_xlabel("frequency (Hz)")
    else:
        x = axis_of_tests(below, errors.tests)
    ratio = nrmsd / np.where(floor > 0, floor, np.nan)[:, None]
    for panel, band in ((axes, nrmsd), (below, ratio)):
        panel.vlines(x, band[:, 0], band[:, 2], color=mode_colour(0), lw=5, alpha=0.4)
        panel.plot(x, band[:, 1], color=mode_colour(0), lw=1.0, marker=".", ms=4)
        few_ticks(panel, None, 4 if panel is axes else 3)
    axes.plot(x, floor, color=FLOOR, lw=2)
    below.axhline(1, color=FLOOR, lw=2)
    axes.set_ylim(bottom=0)
    axes.set(title="NRMSD", ylabel="NRMSD (%)")
    below.set_ylabel("ratio to floor (–)")


def _table(found: Fundamental, unit: Unit) -> Table:
    amplitude = found.amplitude.scaled(unit.factor)
    sizes, size_draws = amplitude.texts()
    phases, phase_draws = found.phase.texts()
    deviation = amplitude.draws[:, 1] / amplitude.value - 1
    return Table(
        [
            Column("Test", found.tests),
            Column("Frequency (Hz)", [compact(hertz, 4) for hertz in found.frequency]),
            Column(f"Amplitude ({unit.name})", sizes),
            Column("Draws", size_draws),
            Column("Deviation", [percent(value) for value in deviation]),
            Column("Phase (°)", phases),
            Column("Draws", phase_draws),
        ],
        "Fundamental of each test: measured with its 90 % interval, and the 5–95 % range of the draws.",
    )
