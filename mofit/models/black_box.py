"""A user's own simulator: any function from one test and parameters to outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mofit._typing import FloatArray


@dataclass(frozen=True)
class Record:
    """One test as a user's simulator sees it."""

    name: str
    time: FloatArray
    """Shape (n,), s; uniform, begins at 0."""
    inputs: Mapping[str, FloatArray]
    """Samples per input channel, (n,) each, in SI units."""
    conditions: Mapping[str, float]
    """Constants of the test, in SI units."""
