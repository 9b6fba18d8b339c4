"""How many minima a multi-start search has probably not seen yet."""

from __future__ import annotations

import math


def expected_unseen(points: int, minima: int) -> float:
    r"""Posterior expectation of the number of minima not yet seen.

    .. math:: \frac{w (n - 1)}{n - w - 2} - w = \frac{w (w + 1)}{n - w - 2}

    for :math:`n` uniform points whose basins are known and belong to :math:`w` distinct minima; every number of minima
    and every division of the box among them is equally likely beforehand. Infinite while :math:`n \le w + 2`.

    Parameters
    ----------
    points
        n.
    minima
        w.

    References
    ----------
    Boender and Rinnooy Kan, "Bayesian stopping rules for multistart global optimization methods", Mathematical
    Programming 37 (1987).
    """
    return minima * (minima + 1) / (points - minima - 2) if points > minima + 2 else math.inf


def unseen_volume(points: int, minima: int) -> float:
    r"""Posterior expectation of the share of the box in basins not yet seen, :math:`w (w + 1) / (n (n - 1))`."""
    return min(minima * (minima + 1) / (points * (points - 1)), 1.0) if points > 1 else 1.0
