"""What the kernel benchmark computes: the paper's tyre on nine sine tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.kernel import Drive
from mofit.library.maxwell_tyre import MaxwellTyre
from mofit.model import System, build_system

Array = NDArray[np.float64]

FREQUENCIES = (0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0)
FREE = ("d_y", "c_M", "d_M")


@dataclass(frozen=True)
class Task:
    """Sine tests of 1 degree at 40 km/h, 630 samples at 100 Hz each: 5,670 Runge-Kutta steps for all of them.

    The measured outputs are noise; every sample counts.
    """

    samples: int = 630
    step: float = 0.01
    amplitude: float = math.radians(1.0)
    conditions: tuple[float, ...] = (40 / 3.6, 1.0, 0.01)

    @cached_property
    def system(self) -> System:
        """The model in vector form."""
        return build_system(MaxwellTyre())

    @cached_property
    def time(self) -> Array:
        """Sampling times of every test, s."""
        return np.asarray(np.arange(self.samples) * self.step, dtype=float)

    @property
    def steps(self) -> int:
        """Steps of one evaluation of all tests."""
        return self.samples * len(FREQUENCIES)

    @cached_property
    def nominal(self) -> Array:
        """A parameter set."""
        return np.array([parameter.nominal for parameter in MaxwellTyre.parameters])

    def parameters(self, count: int) -> Array:
        """Sets around it in the free parameters, (count, np)."""
        p = np.tile(self.nominal, (count, 1))
        free = [self.system.parameters.index(name) for name in FREE]
        p[:, free] *= np.random.default_rng(1).uniform(0.8, 1.2, (count, len(FREE)))
        return p

    @cached_property
    def drives(self) -> list[Drive]:
        """The tests."""
        rng = np.random.default_rng(0)
        return [
            Drive(
                name=f"{frequency:g} Hz",
                step=self.step,
                inputs=self.amplitude * np.sin(2 * np.pi * frequency * self.time)[:, None],
                hold="cubic",
                conditions=np.array(self.conditions),
                measured=1000 * rng.normal(size=(self.samples, 1)),
                weights=np.ones((self.samples, 1)),
            )
            for frequency in FREQUENCIES
        ]
