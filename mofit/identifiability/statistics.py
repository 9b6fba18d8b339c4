r"""What tests tell an estimate, as numbers that add up from test to test.

mofit's estimate minimises weighted squares; with their curvature H and the covariance J of their slope its precision
is :math:`H J^{-1} H` (`mofit.objectives.curvature`). H and J of tests add up, separately for every stage: the tests of
a calibration stage are fitted by themselves, and enter as a prior. With S stages before the main identification

.. math:: M = \sum_{g=0}^{S} H_g J_g^{-1} H_g + B, \qquad H_g = \sum_{t \in g} H_t, \quad J_g = \sum_{t \in g} J_t

where B is what the bounds alone say. Where all noise is white and known, :math:`J = H` and M is the Fisher information.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Procedure
from mofit.identifiability.fisher import TOLERANCE, sensitivities
from mofit.identifiability.noise import DEFAULT_NOISE, ChannelNoise
from mofit.identifiability.procedures import planned_drives
from mofit.library import find_model
from mofit.model import Model, Stage, build_system

Array = NDArray[np.float64]

#: Curvature below this share of the mean is that of a direction of which a test says nothing.
_FLAT = 1e-12


@dataclass(frozen=True)
class Group:
    """Tests that are fitted together: those of the main identification (no ``stage``), or of a calibration stage."""

    model: Model
    stage: Stage | None = None

    @property
    def settled(self) -> bool:
        """Whether only what comes after the transient of a test is judged."""
        return self.stage is not None and self.stage.settled


def groups(model: Model) -> tuple[Group, ...]:
    """The main identification and the calibration stages of a model."""
    return (Group(model), *(Group(find_model(stage.model), stage) for stage in model.stages))


def group_of(model: Model, kind: str) -> int:
    """Place in `groups` of the tests of a kind: the stage that takes them, else the main identification."""
    for number, stage in enumerate(model.stages, start=1):
        if kind in stage.procedures:
            return number
    return 0


@dataclass(frozen=True)
class Statistics:
    """What tests tell in relative changes of the parameters, and the largest magnitude of each output.

    Parameters
    ----------
    values
        Shape (T, N, G, 2, d, d): test, parameter point, group, H or J.
    information
        Fisher information, (T, N, d, d).
    peaks
        Largest magnitude of each of the main model's outputs over the points, (T, outputs); nan for tests of a stage.
    """

    values: Array
    information: Array
    peaks: Array


def statistics(
    model: Model,
    procedures: Sequence[Procedure],
    values: Array,
    scales: Array,
    noise: Mapping[str, ChannelNoise],
    jobs: int = 1,
    periods: int | None = None,
    tolerance: float = TOLERANCE,
) -> Statistics:
    """H and J of every test, all of a group and all parameter points in one run of the kernel.

    Parameters
    ----------
    model
        The model that is identified.
    procedures
        The tests.
    values
        Parameter sets (N, d) in the order of the model's parameters.
    scales
        What a relative change is measured by, (N, d).
    noise
        By output.
    jobs
        Threads; results do not depend on it.
    periods
        Periodic tests are simulated for so many periods only, and what a settled period tells counts as often as the
        test has more: for searches among many.
    tolerance
        Of the integration, relative to the outputs' range.
    """
    names = [parameter.name for parameter in model.parameters]
    every = groups(model)
    shape = (len(procedures), len(values), len(every), 2, len(names), len(names))
    found, peaks = np.zeros(shape), np.full((len(procedures), len(model.outputs)), np.nan)
    information = np.zeros((*shape[:2], *shape[-2:]))
    places = np.array([group_of(model, procedure.kind) for procedure in procedures], dtype=int)
    for number, group in enumerate(every):
        which = np.flatnonzero(places == number).tolist()
        if not which:
            continue
        own = [names.index(parameter.name) for parameter in group.model.parameters]
        tests = {i: _shortened(procedures[i], periods) for i in which}
        different = {_key(test): test for test in tests.values()}
        drives = planned_drives(group.model, list(different.values()), values[0, own], jobs, settled=group.settled)
        noises = [noise.get(channel.name, DEFAULT_NOISE) for channel in group.model.outputs]
        told = sensitivities(
            build_system(group.model),
            drives,
            values[:, own],
            [noises] * len(drives),
            [names[i] for i in own],
            jobs,
            tolerance,
        )
        own_square = np.ix_(np.array(own), np.array(own))
        scale = scales[:, own][:, :, None] * scales[:, own][:, None, :]
        alike = {key: [i for i in which if _key(tests[i]) == key] for key in different}
        for members, drive, test in zip(alike.values(), drives, told, strict=True):
            own_values = np.stack([test.normal * scale, test.scatter * scale], axis=1)
            for place in members:
                left_out = drive.samples - np.count_nonzero(drive.weights[:, 0])
                more = (len(procedures[place].time) - left_out) / (drive.samples - left_out)
                found[place, :, number][..., own_square[0], own_square[1]] = more * own_values
                information[place][:, own_square[0], own_square[1]] = more * test.information * scale
                if number == 0:
                    peaks[place] = [np.max(np.abs(outputs)) for outputs in test.outputs]
    return Statistics(found, information, peaks)


def _shortened(procedure: Procedure, periods: int | None) -> Procedure:
    """A periodic test with its first periods only."""
    if periods is None or not procedure.frequency:
        return procedure
    count = round(periods / (procedure.frequency * procedure.step))
    if count >= len(procedure.time):
        return procedure
    inputs = {name: values[:count] for name, values in procedure.inputs.items()}
    return replace(procedure, time=procedure.time[:count], inputs=inputs)


def _key(procedure: Procedure) -> tuple[object, ...]:
    """Equal for tests that are driven and judged alike."""
    signals = tuple((name, np.asarray(values).tobytes()) for name, values in sorted(procedure.inputs.items()))
    return signals, procedure.step, procedure.kind, procedure.hold, tuple(sorted(procedure.conditions.items()))


def precision(sums: Array) -> Array:
    r"""Precision :math:`\sum_g H_g J_g^{-1} H_g` of the estimate, (..., d, d), from sums (..., G, 2, d, d)."""
    normal, scatter = sums[..., 0, :, :], sums[..., 1, :, :]
    size = normal.shape[-1]
    trace = np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    ratio = np.trace(scatter, axis1=-2, axis2=-1)[..., None, None] / np.maximum(trace, np.finfo(float).tiny)
    flat = _FLAT * trace / size * np.eye(size)
    silent = ~(trace > 0)
    safe = np.where(silent, np.eye(size), scatter + ratio * flat)
    own = np.where(silent, 0.0, normal + flat)
    return np.asarray((np.swapaxes(own, -1, -2) @ np.linalg.solve(safe, own)).sum(axis=-3))
