"""One test as the kernel sees it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PPoly

from mofit.errors import Fault
from mofit.model import System

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """One test prepared for the kernel.

    Parameters
    ----------
    name
        Of the test.
    step
        Sampling interval, s.
    inputs
        Shape (n, nu).
    hold
        How the inputs run between samples. ``"cubic"``: the not-a-knot cubic spline (two continuous
        derivatives), so that sampling does not limit the accuracy of smooth inputs; ``"linear"``:
        straight lines, for steps.
    conditions
        Shape (nc,).
    measured
        Shape (n, ny); no nan (zero where the weight is zero).
    weights
        Shape (n, ny); zero drops a sample.
    """

    name: str
    step: float
    inputs: Array
    hold: str
    conditions: Array
    measured: Array
    weights: Array

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.inputs)

    @cached_property
    def data(self) -> Array:
        """Per sample: 1 if any output has a weight, the measured outputs, the weights; shape (n, 1 + 2 ny)."""
        flag = np.any(self.weights != 0, axis=1, keepdims=True)
        return np.ascontiguousarray(np.hstack([flag, self.measured, self.weights]).astype(float))

    @cached_property
    def address(self) -> int:
        """Of `data`."""
        return self.data.ctypes.data

    @cached_property
    def curve(self) -> PPoly:
        """The inputs over time."""
        time = np.arange(self.samples) * self.step
        inputs = np.asarray(self.inputs, dtype=float)
        if self.samples == 1:
            return PPoly(inputs[None], np.array([0.0, self.step]))
        if self.hold == "linear":
            return PPoly(np.stack([np.diff(inputs, axis=0) / self.step, inputs[:-1]]), time)
        return CubicSpline(time, inputs, axis=0)

    @cached_property
    def _slope(self) -> PPoly:
        return self.curve.derivative()

    def _within(self, time: Array) -> Array:
        return np.minimum(time, (self.samples - 1) * self.step)

    def at(self, time: Array) -> Array:
        """Inputs at times, shape (nu, len(time)); constant after the last sample."""
        return np.asarray(self.curve(self._within(time)).T)

    def slope(self, time: Array) -> Array:
        """Time derivative of the inputs (from the right at samples), shape (nu, len(time))."""
        return np.asarray(self._slope(self._within(time)).T)

    def faults(self, system: System) -> list[Fault]:
        """What does not fit the system."""
        n, ny = self.samples, len(system.outputs)
        where = f"test '{self.name}'"
        found = [
            Fault(where, f"{what} have shape {np.shape(value)}, not {shape}", "Give one column per channel")
            for what, value, shape in (
                ("inputs", self.inputs, (n, len(system.inputs))),
                ("measured outputs", self.measured, (n, ny)),
                ("weights", self.weights, (n, ny)),
                ("conditions", self.conditions, (len(system.conditions),)),
            )
            if np.shape(value) != shape
        ]
        if n == 0 or not self.step > 0:
            found.append(Fault(where, f"{n} samples every {self.step} s", "Give samples on a uniform time grid"))
        if self.hold not in ("cubic", "linear"):
            found.append(Fault(where, f"hold is '{self.hold}'", "Use 'cubic' or 'linear'"))
        for what, value in (("inputs", self.inputs), ("measured outputs", self.measured), ("weights", self.weights)):
            if not np.all(np.isfinite(value)):
                found.append(Fault(where, f"{what} hold nan or infinite values", "Set weight and value to 0 there"))
        return found
