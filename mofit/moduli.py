"""Dynamic moduli as sine tests: the record of each frequency, put together again from what was kept of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Measurement, Procedure

Array = NDArray[np.float64]

#: Periods in which a test grows to its stroke, and settled ones after them.
_RAMP, _SETTLED = 2, 4
#: Samples per period: with 32 Runge-Kutta steps each, relaxation times down to a period / 8000 stay stable.
_SAMPLES = 96


def sine_tests(
    frequency: Array,
    storage: Array,
    loss: Array,
    spread: Array,
    *,
    stroke: float = 1e-3,
    title: str = "dynamic moduli",
    seed: int = 0,
) -> Campaign:
    r"""One sine test per frequency whose settled force is that of the moduli.

    Of a stroke :math:`x = X \sin \omega t` dynamic-mechanical analysis keeps two numbers of the force,
    :math:`F = X (k' \sin \omega t + k'' \cos \omega t)`. Here the two are a record again: two periods of growth, then
    four settled ones of 96 samples, which alone are judged. The growth keeps the mean of the stroke's integral at
    zero, as it is in the settled state, so that no slow branch of a model is left displaced.

    The force has white noise of the level at which k' and k'' found from the record scatter by ``spread``. Nothing of
    it lies on the frequency itself: the moduli that were measured have had their scatter already. Harmonics and
    repetitions were not kept, and hold that noise alone.

    Parameters
    ----------
    frequency
        In Hz, shape (n,), all different.
    storage, loss
        Dynamic stiffness k', k'' in N/m; of a bar of modulus E, :math:`E A / l`. Shape (n,).
    spread
        Standard deviation of both in N/m, (n,); a stationary noise is the same in both phases.
    stroke
        Amplitude in m.
    title
        Of the campaign.
    seed
        Of the noise.

    Returns
    -------
    Campaign
        Tests named ``sine_<f>Hz`` with the channels ``displacement`` and ``force``.
    """
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * np.arange((_RAMP + _SETTLED) * _SAMPLES) / _SAMPLES
    share = np.minimum(phase / (2 * np.pi * _RAMP), 1.0)
    growth = share**3 * (10 - 15 * share + 6 * share**2)
    slope = 30 * share**2 * (1 - share) ** 2 / (2 * np.pi * _RAMP)
    # the derivative of -growth cos: its integral has no mean
    sine, cosine = growth * np.sin(phase) - slope * np.cos(phase), growth * np.cos(phase)
    measurements = []
    for f, k1, k2, sd in zip(frequency, storage, loss, spread, strict=True):
        noise = sd * stroke * np.sqrt(_SETTLED * _SAMPLES / 2) * _without_fundamental(rng.standard_normal(len(phase)))
        procedure = Procedure(
            name=f"sine_{f:.4g}Hz",
            kind="sine",
            time=phase / (2 * np.pi * f),
            inputs={"displacement": stroke * sine},
            frequency=float(f),
            amplitude=stroke,
            transient=_RAMP / float(f),
        )
        force = stroke * (k1 * sine + k2 * cosine) + noise
        measurements.append(Measurement(procedure, {"force": force}, {"displacement": "m", "force": "N"}))
    return Campaign(title, "measured", {}, tuple(measurements))


def _without_fundamental(noise: Array) -> Array:
    """Noise whose settled part has nothing on the frequency of the test."""
    settled = noise[_RAMP * _SAMPLES :]
    lines = np.fft.rfft(settled)
    lines[_SETTLED] = 0.0
    return np.concatenate([noise[: _RAMP * _SAMPLES], np.fft.irfft(lines, len(settled))])
