"""Dynamic mechanical analysis (DMA): dynamic moduli as records of sine tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign, Experiment, Measurement
from mofit.quantities import known_unit

#: Periods in which the amplitude grows, and steady ones after them.
_RAMP, _STEADY = 2, 4
#: Samples per period: with 32 Runge-Kutta steps each, relaxation times down to a period / 8000 stay stable.
_SAMPLES = 96


def sine_tests(
    frequency: FloatArray,
    storage: FloatArray,
    loss: FloatArray,
    standard_deviation: FloatArray,
    *,
    stroke: float = 1e-3,
    channels: tuple[str, str] = ("displacement", "force"),
    names: Sequence[str] = (),
    title: str = "dynamic moduli",
    seed: int = 0,
) -> Campaign:
    r"""One sine test per frequency whose steady force has the given moduli.

    For a stroke :math:`x = X \sin \omega t` DMA keeps two numbers of the force,
    :math:`F = X (k' \sin \omega t + k'' \cos \omega t)`. The record made from them has two periods of growth, then four
    steady ones of 96 samples, which alone are used. During the growth the integral of the stroke has zero mean, as in
    the steady state, so that no slow branch of a model is left displaced.

    The force has white noise of the level at which k' and k'' found from the record have ``standard_deviation``. The
    frequency itself has no noise: the measured moduli contain theirs. Harmonics and repetitions hold noise alone,
    because DMA does not keep them.

    Parameters
    ----------
    frequency
        In Hz, shape (n,).
    storage, loss
        Dynamic stiffness k', k'' in N/m; of a bar of modulus E, :math:`E A / l`. Shape (n,).
    standard_deviation
        Of both in N/m, shape (n,); stationary noise is the same in both phases.
    stroke
        Amplitude in m; of a strain a number.
    channels
        Names of input and output: of moduli in Pa ``("strain", "stress")``.
    names
        Of the tests, shape (n,); by default ``sine_<f>Hz``.
    title
        Of the campaign.
    seed
        Of the noise.

    Returns
    -------
    Campaign
        One test per frequency, with these channels.
    """
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * np.arange((_RAMP + _STEADY) * _SAMPLES) / _SAMPLES
    share = np.minimum(phase / (2 * np.pi * _RAMP), 1.0)
    growth = share**3 * (10 - 15 * share + 6 * share**2)
    slope = 30 * share**2 * (1 - share) ** 2 / (2 * np.pi * _RAMP)
    # the derivative of -growth cos: its integral has no mean
    sine, cosine = growth * np.sin(phase) - slope * np.cos(phase), growth * np.cos(phase)
    units = {name: known_unit(name) or "1" for name in channels}
    measurements = []
    labels = names or [f"sine_{f:.4g}Hz" for f in frequency]
    for name, f, k1, k2, sd in zip(labels, frequency, storage, loss, standard_deviation, strict=True):
        noise = sd * stroke * np.sqrt(_STEADY * _SAMPLES / 2) * _without_fundamental(rng.standard_normal(len(phase)))
        experiment = Experiment(
            name=name,
            kind="sine",
            time=phase / (2 * np.pi * f),
            inputs={channels[0]: stroke * sine},
            frequency=float(f),
            amplitude=stroke,
            transient=_RAMP / float(f),
        )
        force = stroke * (k1 * sine + k2 * cosine) + noise
        measurements.append(Measurement(experiment, {channels[1]: force}, units))
    return Campaign(title, "measured", {}, tuple(measurements))


def _without_fundamental(noise: FloatArray) -> FloatArray:
    """Noise whose steady part is zero at the frequency of the test."""
    steady = noise[_RAMP * _SAMPLES :]
    lines = np.fft.rfft(steady)
    lines[_STEADY] = 0.0
    return np.concatenate([noise[: _RAMP * _SAMPLES], np.fft.irfft(lines, len(steady))])
