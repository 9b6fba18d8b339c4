"""The spectrum of what a model leaves of every test, beside that of the noise model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from mofit._typing import FloatArray
from mofit.data.signals import noise_process
from mofit.report.overlay import NINETY, Overlay, headed
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.figures import (
    BASELINE,
    FLOOR,
    MEASURED,
    Panels,
    band_key,
    dot_key,
    line_key,
    mode_colour,
    panel_of,
)
from mofit.report.toolkit.formatting import Unit, number

_FEWEST = 16
"""Samples that a spectrum needs."""
_SHOWN = 12
"""Tests that are drawn: those of which most is left."""


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes over frequency (Hz), SI units.

    `noise` is the expected amplitude of the noise at each frequency, `low` and `high` its 90 % band; `left` is the
    root mean square of the residual relative to the output's range. `repeats` tells whether the noise is what differs
    from period to period; else it is the residual itself, smoothed.
    """

    test: str
    frequency: FloatArray
    measured: FloatArray
    residual: FloatArray
    baseline_residual: FloatArray
    noise: FloatArray
    low: FloatArray
    high: FloatArray
    left: float
    repeats: bool


def extract_spectra(overlays: Sequence[Overlay]) -> list[Spectrum]:
    r"""Amplitude spectra :math:`2 |Y_k| / n` of the whole records.

    Noise of spectrum S has amplitudes of mean :math:`\sqrt{\pi S_k / n}` (Rayleigh); the band of :math:`\log S` is
    that of its degrees of freedom, see `mofit.data.signals.noise_process`.
    """
    return [_spectrum(overlay) for overlay in overlays if overlay.time.size >= _FEWEST]


def _spectrum(o: Overlay) -> Spectrum:
    residual, count = o.measured - o.simulated, o.time.size
    process = noise_process(residual, o.simulated, o.time, o.period if np.isfinite(o.period) else None)
    noise = np.sqrt(np.pi * process.spectrum / count)[1:]
    band = np.exp(NINETY / 2 * np.sqrt(2 / process.degrees_of_freedom))[1:]
    return Spectrum(
        test=o.test,
        frequency=np.asarray(np.fft.rfftfreq(count, float(np.median(np.diff(o.time))))[1:], dtype=float),
        measured=_amplitude(o.measured),
        residual=_amplitude(residual),
        baseline_residual=_amplitude(o.measured - o.baseline) if o.baseline.size else np.empty(0),
        noise=noise,
        low=noise / band,
        high=noise * band,
        left=float(np.sqrt(np.mean(residual**2)) / (np.ptp(o.measured) or 1.0)),
        repeats=process.harmonics.size > 0,
    )


def _amplitude(signal: FloatArray) -> FloatArray:
    return np.asarray(2 / signal.size * np.abs(np.fft.rfft(signal))[1:])


def draw_spectrum(spectrum: Spectrum, unit: Unit, axes: Axes) -> Axes:
    """Amplitudes as dots over frequency, and the noise as a line with its band."""
    dots: dict[str, Any] = {"ls": "none", "marker": ".", "ms": 2.0, "rasterized": True}
    axes.plot(spectrum.frequency, unit.factor * spectrum.measured, color=MEASURED, **dots)
    if spectrum.baseline_residual.size:
        axes.plot(spectrum.frequency, unit.factor * spectrum.baseline_residual, color=BASELINE, **dots)
    axes.plot(spectrum.frequency, unit.factor * spectrum.residual, color=mode_colour(0), **dots)
    low, high = unit.factor * spectrum.low, unit.factor * spectrum.high
    axes.fill_between(spectrum.frequency, low, high, color=FLOOR, alpha=0.5, lw=0, rasterized=True)
    axes.plot(spectrum.frequency, unit.factor * spectrum.noise, color=FLOOR, lw=1.5)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())  # most of the time to draw a panel
    top = unit.factor * float(np.max(spectrum.measured))
    axes.set_ylim(0.05 * unit.factor * float(np.min(spectrum.noise)) or None, 2 * top if top > 0 else None)
    panel_of(axes, spectrum.test)
    return axes


def _highest(spectra: Sequence[Spectrum]) -> str:
    """The line of the residual that stands highest above the noise band."""
    above = [spectrum.residual / np.maximum(spectrum.high, np.finfo(float).tiny) for spectrum in spectra]
    k = int(np.argmax([ratio.max() for ratio in above]))
    line = int(np.argmax(above[k]))
    return (
        f"The residual stands highest above the noise in {spectra[k].test} at {number(spectra[k].frequency[line])} Hz: "
        f"{number(float(above[k][line]), 2)}× the upper edge of the band."
    )


def spectra_figure(spectra: Sequence[Spectrum], unit: Unit, baseline: str, mode: str, output: str) -> Figure:
    """A panel per test; of many tests those of which most is left."""
    most = np.argsort([-spectrum.left for spectrum in spectra], kind="stable")[:_SHOWN]
    shown = [spectra[k] for k in sorted(most)]
    legend = [dot_key(MEASURED, "measured", marker="."), dot_key(mode_colour(0), f"residual of {mode}", marker=".")]
    if baseline:
        legend.append(dot_key(BASELINE, f"residual of {baseline}", marker="."))
    legend += [line_key(FLOOR, "noise model", lw=1.5), band_key(FLOOR, "its 90 % band", 0.5)]
    panels = Panels(len(shown), 3, 1.9, legend=legend, margin=(0.75, 0.6, 0.1), gap=(0.6, 0.6))
    for spectrum, axes in zip(shown, panels.axes, strict=True):
        draw_spectrum(spectrum, unit, axes)
    panels.label("frequency (Hz)", unit.label("amplitude"))
    repeats = [spectrum.repeats for spectrum in shown]
    says = "The noise is what differs from period to period."
    if not any(repeats):
        says = "No test is periodic: the noise model is the residual, smoothed, and shows its colour, not a gap."
    elif not all(repeats):
        says += " Of tests that are not periodic it is the residual, smoothed."
    few = f" Of {len(spectra)} tests the {_SHOWN} with the largest residual." if len(spectra) > _SHOWN else ""
    return panels.figure(
        headed("Spectra of output and residual beside the noise model", output),
        f"Amplitude spectrum of the output and of the residual. {says}{few}",
        good="the residual is scattered around the noise model at all frequencies.",
        bad="peaks above it: near a resonance the frequency or damping is wrong, at multiples of the excited "
        "frequency or between the excited lines a nonlinearity is missing.",
        finding=_highest(shown),
    )
