"""Batches of parameter sets through all tests: outputs, cost, Gauss-Newton terms, sensitivities."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.kernel.drive import Drive
from mofit.kernel.rule import Rule
from mofit.kernel.runner import Runner
from mofit.kernel.stepping import Stepping
from mofit.model import System

Array = NDArray[np.float64]


class Simulator:
    """Runs batches of parameter sets through tests.

    Parameters
    ----------
    system
        The model in vector form.
    drives
        The tests.
    free
        Names of the parameters that results are differentiated by (default: all).
    jobs
        Number of threads. Results are the same, bit for bit, for any number.
    tolerance
        Allowed error of the integration relative to the range of the outputs.
    box
        Bounds (lower, upper) of all parameters, in which sets will lie: the method and its number of steps are
        then chosen by a rule that is calibrated once, at first use. Without it both are measured for each set,
        which takes several times as long as what is asked for.
    steps
        Fixed number of Runge-Kutta steps per sampling interval instead.

    Raises
    ------
    InputError
        If a test does not fit the system, or a free parameter is unknown.
    """

    def __init__(
        self,
        system: System,
        drives: Sequence[Drive],
        free: Sequence[str] | None = None,
        *,
        jobs: int = 1,
        tolerance: float = 1e-6,
        box: tuple[ArrayLike, ArrayLike] | None = None,
        steps: int | None = None,
    ) -> None:
        self.system, self.drives, self.tolerance = system, tuple(drives), tolerance
        self.free = tuple(system.parameters if free is None else free)
        unknown = [name for name in self.free if name not in system.parameters]
        raise_errors(
            [Fault(f"parameter '{name}'", "unknown name", did_you_mean(name, system.parameters)) for name in unknown]
            + [fault for drive in self.drives for fault in drive.faults(system)]
            + ([] if box is None else self._box_faults(box))
        )
        self._runner = Runner(system, self.drives, self.free, jobs)
        self._stepping = Stepping(system, self.drives, self.free, tolerance, box, steps, jobs)

    def select(self, index: Sequence[int]) -> Simulator:
        """The same on some of the tests; what is compiled and calibrated is shared."""
        other = copy.copy(self)
        other.drives = tuple(self.drives[i] for i in index)
        other._runner = self._runner.select(index)
        return other

    def within(self, box: tuple[ArrayLike, ArrayLike], tolerance: float | None = None) -> Simulator:
        """The same for sets in another box (or to another tolerance), e.g. around a minimum; code is shared.

        A small box takes fewer steps: the rule need not cover the stiffest corner of a large one.
        """
        raise_errors(self._box_faults(box))
        other = copy.copy(self)
        other.tolerance = self.tolerance if tolerance is None else tolerance
        other._stepping = self._stepping.within(box, other.tolerance)
        return other

    def with_steps(self, steps: int) -> Simulator:
        """The same with a fixed number of Runge-Kutta steps per sampling interval; code is shared."""
        other = copy.copy(self)
        other._stepping = self._stepping.fixed(steps)
        return other

    def with_drives(self, drives: Sequence[Drive]) -> Simulator:
        """The same held against other outputs, or cut short: drives whose inputs are the same as far as they go.

        Code is shared, and the integration is that of the former drives.
        """
        other = copy.copy(self)
        other.drives = tuple(drives)
        other._runner = self._runner.with_drives(other.drives)
        other._stepping = self._stepping.with_drives(self.drives, other.drives)
        return other

    def on_tests(self, drives: Sequence[Drive], steps: int) -> Simulator:
        """The same on other tests, with a fixed number of Runge-Kutta steps; code is shared."""
        raise_errors(fault for drive in drives for fault in drive.faults(self.system))
        other = self.with_steps(steps)
        other.drives = tuple(drives)
        other._runner = self._runner.on_tests(drives)
        return other

    def without_tables(self) -> Simulator:
        """The same with the memory given back that speeds up the next call."""
        other = copy.copy(self)
        other._runner = self._runner.on_tests(self.drives)
        return other

    @property
    def steps(self) -> int | None:
        """Fixed number of Runge-Kutta steps per sampling interval; None if they are chosen."""
        return self._stepping.steps

    @property
    def rules(self) -> list[Rule]:
        """How each test is integrated, by stiffness; empty without a ``box``."""
        return self._stepping.rules(self.drives)

    def simulate(self, p: ArrayLike) -> list[Array]:
        """Outputs of every test, each (N, n, ny), for parameter sets ``p`` of shape (N, np)."""
        return [values[..., 0] for values in self._stored(p, derivatives=False)]

    def sensitivities(self, p: ArrayLike) -> list[tuple[Array, Array]]:
        """Outputs (N, n, ny) and their derivatives by the free parameters (N, n, ny, nf), of every test."""
        return [(values[..., 0], values[..., 1:]) for values in self._stored(p, derivatives=True)]

    def cost(self, p: ArrayLike) -> Array:
        r"""Weighted squares :math:`\sum_k \sum_y w_{ky} (y_{ky} - m_{ky})^2` per set and test, (N, T); nan: failed."""
        return self._reduced(p, derivatives=False)[..., 0]

    def gauss_newton(self, p: ArrayLike) -> tuple[Array, Array, Array]:
        r"""Cost (N, T), :math:`J^T W r` (N, T, nf) and :math:`J^T W J` (N, T, nf, nf), with J = dy/dfree."""
        sums = self._reduced(p, derivatives=True)
        nf = len(self.free)
        normal = np.empty((*sums.shape[:2], nf, nf))
        upper = np.triu_indices(nf)
        normal[..., upper[0], upper[1]] = normal[..., upper[1], upper[0]] = sums[..., 1 + nf :]
        return sums[..., 0], sums[..., 1 : 1 + nf], normal

    def _box_faults(self, box: tuple[ArrayLike, ArrayLike]) -> list[Fault]:
        names = self.system.parameters
        return [
            Fault(f"box, {which} bounds", f"shape {np.shape(bound)}, not ({len(names)},)", f"Bound {', '.join(names)}")
            for which, bound in zip(("lower", "upper"), box, strict=True)
            if np.shape(bound) != (len(names),)
        ]

    def _stored(self, p: ArrayLike, derivatives: bool) -> list[Array]:
        p = self._checked(p)
        return self._runner.stored(p, self._stepping.choices(p, self.drives), derivatives)

    def _reduced(self, p: ArrayLike, derivatives: bool) -> Array:
        p = self._checked(p)
        sums = self._runner.reduced(p, self._stepping.choices(p, self.drives), derivatives)
        sums[~np.isfinite(sums[..., 0])] = np.nan
        return sums

    def _checked(self, p: ArrayLike) -> Array:
        p = np.ascontiguousarray(np.atleast_2d(np.asarray(p, dtype=float)))
        if p.ndim != 2 or p.shape[1] != len(self.system.parameters):
            raise InputError.of(
                "parameter sets",
                f"shape {p.shape} does not end in {len(self.system.parameters)}",
                f"Give one column per parameter: {', '.join(self.system.parameters)}",
            )
        return p
