r"""A signal that is missing in a model, and how the model's states move with it, from the errors of its outputs.

It is a random walk w, and the linearised model passes it on,

.. math:: \delta x_{k+1} = \Phi_k\, \delta x_k + \gamma_k w_k + \gamma'_k w_{k+1}, \qquad
    w_{k+1} = w_k + \eta_k, \qquad e_k = C_k\, \delta x_k + d_k w_k + v_k

with the errors e of the outputs, their noise v, and the step :math:`\eta` of the walk. A Kalman filter gives the
probability of the errors and, with the smoother of Bryson and Frazier, which inverts no matrix, :math:`\delta x`.

References
----------
Bierman: Fixed interval smoothing with discrete measurements. International Journal of Control 18 (1973).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.linear_response import LinearResponse


@dataclass(frozen=True)
class MissingSignal:
    """Signals w missing on q quantities, one at a time, in a test of n samples with y outputs.

    The s states are the x ones of the model and w, relative to their largest magnitudes.

    Parameters
    ----------
    scale
        Those of the model's states and w, (q, s).
    advance, push
        From sample to sample, (n - 1, q, s, s), and by the step of the walk, (n - 1, q, s).
    seen
        What of the states the outputs show, (n, y, q, s).
    errors, variance
        Of the outputs, (n, y), not a number where nothing is measured; and of their noise, (y,).
    """

    scale: FloatArray
    advance: FloatArray
    push: FloatArray
    seen: FloatArray
    errors: FloatArray
    variance: FloatArray

    @classmethod
    def of(
        cls,
        response: LinearResponse,
        quantities: Sequence[int],
        scales: FloatArray,
        spread: FloatArray,
        errors: FloatArray,
        variance: FloatArray,
    ) -> MissingSignal:
        """From the linearised motion, the magnitudes of the quantities (q,) and of the states (x,)."""
        x, q, n = len(spread), len(quantities), len(errors)
        scale = np.column_stack([np.tile(np.where(spread > 0, spread, 1.0), (q, 1)), scales])
        driven = response.driven[:, :, quantities]
        now, then = (response.here @ driven[:-1]).transpose(0, 2, 1), (response.there @ driven[1:]).transpose(0, 2, 1)
        advance = np.zeros((n - 1, q, x + 1, x + 1))
        advance[..., :x, :x], advance[..., :x, x], advance[..., x, x] = response.advance[:, None], now + then, 1.0
        push = np.concatenate([then, np.ones((n - 1, q, 1))], axis=2)
        shown = np.broadcast_to(response.seen[:, :, None], (n, len(variance), q, x))
        seen = np.concatenate([shown, response.direct[:, :, quantities, None]], axis=3)
        relative = advance * scale[:, None, :] / scale[:, :, None]
        return cls(scale, relative, push * (scales[:, None] / scale), seen * scale, errors, variance)

    def log_likelihoods(self, steps: FloatArray) -> FloatArray:
        """Of the errors, for each of some steps (g,) of the walk; (q, g)."""
        found = np.zeros((len(self.scale), len(steps)))
        for _, _, updates in self._filtered(np.tile(steps, (len(self.scale), 1))):
            for one in updates:
                found -= 0.5 * (np.log(one.variance) + one.innovation**2 / one.variance)
        return np.where(np.isfinite(found), found, -np.inf)

    def smoothed(self, steps: FloatArray) -> FloatArray:
        """By how much the model's states move, for one step (q,) of the walk per quantity; (n, q, x)."""
        past, ahead, found = list(self._filtered(steps[:, None])), np.zeros((len(steps), 1, self.scale.shape[1])), []
        for k in reversed(range(len(past))):
            mean, covariance, updates = past.pop()
            found.append((mean - np.sum(covariance * ahead[..., None, :], axis=-1))[:, 0])
            for one in reversed(updates):
                told = np.sum(one.gain * ahead, axis=-1) + one.innovation / one.variance
                ahead = ahead - one.seen * told[..., None]
            if k:
                ahead = np.sum(self.advance[k - 1][:, None] * ahead[..., None], axis=-2)
        moved = (np.stack(found[::-1]) * self.scale)[..., :-1]
        return moved if np.isfinite(moved).all() else np.zeros_like(moved)

    def _filtered(self, steps: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, list[_Update]]]:
        """Mean (q, g, s) and covariance (q, g, s, s) of the states at every sample, and what updated them.

        For steps (q, g) of the walk. Before the first sample a state may be anywhere within its magnitude.
        """
        s = self.scale.shape[1]
        mean, covariance = np.zeros((*steps.shape, s)), np.tile(np.eye(s), (*steps.shape, 1, 1))
        squares = steps[..., None, None] ** 2
        for k, errors in enumerate(self.errors):
            if k:
                advance, push = self.advance[k - 1][:, None], self.push[k - 1]
                mean = (advance @ mean[..., None])[..., 0]
                covariance = advance @ covariance @ advance.swapaxes(-1, -2)
                covariance += squares * (push[:, :, None] * push[:, None, :])[:, None]
            updates = []
            for j in np.flatnonzero(np.isfinite(errors)):
                seen = self.seen[k, j][:, None]
                row = np.sum(covariance * seen[..., None, :], axis=-1)
                variance = np.sum(row * seen, axis=-1) + self.variance[j]
                innovation, gain = errors[j] - np.sum(mean * seen, axis=-1), row / variance[..., None]
                mean = mean + gain * innovation[..., None]
                covariance = covariance - gain[..., :, None] * row[..., None, :]
                updates.append(_Update(seen, innovation, variance, gain))
            yield mean, covariance, updates


@dataclass(frozen=True)
class _Update:
    """What a measured sample tells: the states that it shows, what is new, and the gain of the Kalman filter."""

    seen: FloatArray
    innovation: FloatArray
    variance: FloatArray
    gain: FloatArray
