"""Noise with a long memory: 1/f."""

import numpy as np


def long_memory(rng: np.random.Generator, count: int) -> np.ndarray:
    """1/f noise by Kasdin's filter of white noise with a standard deviation of 1, long after it began."""
    steps = np.arange(1, count + 4000)
    weights = np.cumprod(np.concatenate([[1.0], (steps - 0.5) / steps]))
    return np.convolve(rng.standard_normal(count + 4000), weights)[4000 : count + 4000]
