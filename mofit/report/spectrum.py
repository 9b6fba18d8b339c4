"""Amplitude spectra of broadband tests: the output, and what the model leaves over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import Unit
from mofit.report.page import Figure
from mofit.report.run import Array
from mofit.report.style import BASELINE, FLOOR, MEASURED, cluster_colour, image_of, legend_above, line_key, panels

if TYPE_CHECKING:
    from mofit.report.overlay import Overlay

_FEWEST = 16


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes over frequency (Hz), SI units; `noise` is the expected amplitude of white noise of the test's sd."""

    test: str
    frequency: Array
    measured: Array
    residual: Array
    baseline_residual: Array
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


def _amplitude(signal: Array) -> Array:
    return 2 / signal.size * np.abs(np.fft.rfft(signal))[1:]


def draw_spectrum(spectrum: Spectrum, unit: Unit, axes: Axes) -> Axes:
    """Amplitudes as dots over frequency, and the noise as a line."""
    dots: dict[str, Any] = {"ls": "none", "marker": ".", "ms": 2.0, "rasterized": True}
    axes.plot(spectrum.frequency, unit.factor * spectrum.measured, color=MEASURED, **dots)
    if spectrum.baseline_residual.size:
        axes.plot(spectrum.frequency, unit.factor * spectrum.baseline_residual, color=BASELINE, **dots)
    axes.plot(spectrum.frequency, unit.factor * spectrum.residual, color=cluster_colour(0), **dots)
    if spectrum.noise > 0:
        axes.axhline(unit.factor * spectrum.noise, color=FLOOR, lw=2)
    axes.set_yscale("log")
    axes.set_title(spectrum.test)
    axes.set_xlabel("frequency (Hz)")
    return axes


def spectra_figure(spectra: Sequence[Spectrum], unit: Unit, baseline: str, solution: str) -> Figure:
    """A panel per broadband test."""
    canvas, axes, _ = panels(len(spectra), 2, 2.1, margin=(0.75, 0.5, 0.1, 0.65))
    for k, (spectrum, panel) in enumerate(zip(spectra, axes, strict=True)):
        draw_spectrum(spectrum, unit, panel)
        if k % 2 == 0:
            panel.set_ylabel(unit.label("amplitude"))
    dot: dict[str, Any] = {"ls": "none", "marker": "."}
    handles = [line_key(MEASURED, "measured", **dot), line_key(cluster_colour(0), f"left over by {solution}", **dot)]
    if baseline:
        handles.append(line_key(BASELINE, f"left over by {baseline}", **dot))
    legend_above(canvas, [*handles, line_key(FLOOR, "noise level", lw=2)])
    return Figure(
        image_of(canvas),
        "Amplitude spectra of output and residual per broadband test",
        "Amplitude spectrum of the output and of what the model leaves over.",
        good="what is left over lies on the noise level at all frequencies.",
        bad="peaks above the noise level: near a resonance the frequency or damping is off, between the excited "
        "lines a "
        "nonlinearity is missing.",
    )
