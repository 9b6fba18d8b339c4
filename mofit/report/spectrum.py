"""Amplitude spectra of broadband tests: the output, and the residual of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.overlay import Overlay
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.figures import BASELINE, FLOOR, MEASURED, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import Unit

_FEWEST = 16
"""Samples that a spectrum needs."""


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes over frequency (Hz), SI units; `noise` is the expected amplitude of white noise of the test's sd."""

    test: str
    frequency: FloatArray
    measured: FloatArray
    residual: FloatArray
    baseline_residual: FloatArray
    noise: float


def extract_spectra(overlays: Sequence[Overlay]) -> list[Spectrum]:
    r"""Amplitude spectra :math:`2 |Y_k| / n` of the whole records.

    White noise of standard deviation σ has amplitudes of mean :math:`\sigma \sqrt{\pi / n}` (Rayleigh).
    """
    spectra = []
    for overlay in overlays:
        n = overlay.time.size
        if n < _FEWEST:
            continue
        step = float(np.median(np.diff(overlay.time)))
        baseline = overlay.measured - overlay.baseline if overlay.baseline.size else None
        spectra.append(
            Spectrum(
                test=overlay.test,
                frequency=np.asarray(np.fft.rfftfreq(n, step)[1:], dtype=float),
                measured=_amplitude(overlay.measured),
                residual=_amplitude(overlay.measured - overlay.simulated),
                baseline_residual=_amplitude(baseline) if baseline is not None else np.empty(0),
                noise=overlay.noise_sd * float(np.sqrt(np.pi / n)),
            )
        )
    return spectra


def _amplitude(signal: FloatArray) -> FloatArray:
    return 2 / signal.size * np.abs(np.fft.rfft(signal))[1:]


def draw_spectrum(spectrum: Spectrum, unit: Unit, axes: Axes) -> Axes:
    """Amplitudes as dots over frequency, and the noise as a line."""
    dots: dict[str, Any] = {"ls": "none", "marker": ".", "ms": 2.0, "rasterized": True}
    axes.plot(spectrum.frequency, unit.factor * spectrum.measured, color=MEASURED, **dots)
    if spectrum.baseline_residual.size:
        axes.plot(spectrum.frequency, unit.factor * spectrum.baseline_residual, color=BASELINE, **dots)
    axes.plot(spectrum.frequency, unit.factor * spectrum.residual, color=mode_colour(0), **dots)
    if spectrum.noise > 0:
        axes.axhline(unit.factor * spectrum.noise, color=FLOOR, lw=2)
    axes.set_yscale("log")
    axes.set_title(spectrum.test)
    return axes


def spectra_figure(spectra: Sequence[Spectrum], unit: Unit, baseline: str, mode: str) -> Figure:
    """A panel per broadband test."""
    legend = [dot_key(MEASURED, "measured", marker="."), dot_key(mode_colour(0), f"residual of {mode}", marker=".")]
    if baseline:
        legend.append(dot_key(BASELINE, f"residual of {baseline}", marker="."))
    panels = Panels(len(spectra), 2, 2.1, legend=[*legend, line_key(FLOOR, "noise level", lw=2)])
    for spectrum, axes in zip(spectra, panels.axes, strict=True):
        draw_spectrum(spectrum, unit, axes)
    panels.label("frequency (Hz)", unit.label("amplitude"))
    return panels.figure(
        "Amplitude spectra of output and residual per broadband test",
        "Amplitude spectrum of the output and of the residual.",
        good="the residual equals the noise level at all frequencies.",
        bad="peaks above the noise level: near a resonance the frequency or damping is wrong, between the excited "
        "lines a nonlinearity is missing.",
    )
