r"""Relaxation lengths and frequency responses of a tyre from a run, with their intervals.

Two definitions of the relaxation length :math:`\sigma`, the way that a tyre rolls until its force follows the slip:

- *low frequency*: :math:`\sigma = -v \, \mathrm{d} \arg H / \mathrm{d} \omega` at :math:`\omega = 0`, the lag of a slow
  slip as a length. For the tyres here it is :math:`f_G / c` with the tangent stiffness c of the carcass: the cornering
  stiffness over the lateral stiffness at zero slip (Pacejka, "Tire and Vehicle Dynamics", 3rd ed., chapter 7);
- *63 % step response*: the way after a small step of the slip at which the force has made :math:`1 - 1/e` of its change
  (the practice of rigs). In a first-order tyre without damper both are the same.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.models import Model
from mofit.prediction.draws import posterior_draws
from mofit.prediction.frequency_response import Linearisation, LinearResponse
from mofit.results import parameter_layout
from mofit.results.fmu.scales import input_sizes
from mofit.results.fmu.values import condition_starts, parameter_starts
from mofit.simulation.requirements import TIME_CONDITIONS

#: what may be the slip of a tyre, and the output that follows it
PAIRS = (
    ("slip_angle", "lateral_force"),
    ("slip_angle", "self_aligning_torque"),
    ("slip_ratio", "longitudinal_force"),
)
SPEED = "longitudinal_velocity"
DEFINITIONS = ("low frequency", "63 % step response")
#: parameter draws behind an interval, and the seed that takes them
DRAWS, SEED = 400, 0
#: slips at which lengths are given, as shares of the largest one that was tested
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: frequencies of a Bode plot, Hz
FREQUENCIES = np.geomspace(0.05, 20.0, 61)
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class OperatingPoint:
    """A slip (rad for an angle, 1 for a ratio) under conditions in SI units, from an input to an output."""

    source: str
    output: str
    slip: float
    conditions: dict[str, float]


@dataclass(frozen=True)
class TyreResponses:
    """Linear responses of a run's tyre at operating points: for each one the systems of all draws."""

    model: Model
    points: tuple[OperatingPoint, ...]
    systems: tuple[LinearResponse, ...]

    def lengths(self) -> list[dict[str, FloatArray]]:
        """Of every point the 5, 50 and 95 % quantile of the relaxation length [m] by its definition."""
        found = []
        for point, system in zip(self.points, self.systems, strict=True):
            speed = abs(point.conditions[SPEED])
            times = (system.lag(), system.rise_time(1 - np.exp(-1)))
            found.append({name: _quantiles(speed * time) for name, time in zip(DEFINITIONS, times, strict=True)})
        return found

    def bode(self) -> Iterator[tuple[OperatingPoint, FloatArray, FloatArray]]:
        """Of every point at zero slip the quantiles of gain and phase [deg] over `FREQUENCIES`, shapes (3, k)."""
        for point, system in zip(self.points, self.systems, strict=True):
            if point.slip == 0:
                transfer = system.transfer(2 * np.pi * FREQUENCIES)
                # the sign of the gain is no phase
                turned = transfer * np.sign(system.gain())[:, None]
                phase = np.degrees(np.unwrap(np.angle(turned), axis=1))
                yield point, _quantiles(np.abs(transfer)), _quantiles(phase)


def tyre_responses(tree: xr.DataTree, model: Model) -> TyreResponses:
    """Linearise a run's tyre at every combination of conditions that was tested, from zero to the largest slip.

    Raises
    ------
    InputError
        If the model is no tyre with a state, or has no speed.
    """
    where = f"model '{model.name}'"
    inputs, outputs = ({c.name for c in group} for group in (model.inputs, model.outputs))
    pairs = [pair for pair in PAIRS if pair[0] in inputs and pair[1] in outputs]
    if not pairs or SPEED not in {c.name for c in model.conditions}:
        hint = "Take a run of a rolling tyre: slip angle or slip ratio in, force out, and a longitudinal velocity"
        raise InputError.of(where, "it is no rolling tyre, so it has no relaxation length", hint)
    draws, conditions = parameter_draws(tree, model), _tested(tree, model)
    largest = input_sizes(tree, model)
    points, systems = [], []
    for source, output in pairs:
        linear = Linearisation(model, source, output)
        slips = [share * largest.get(source, 0.0) for share in SHARES]
        for own in conditions:
            for slip in dict.fromkeys(slips):
                points.append(OperatingPoint(source, output, slip, own))
                systems.append(linear.at(slip, draws, own))
    return TyreResponses(model, tuple(points), tuple(systems))


def parameter_draws(tree: xr.DataTree, model: Model) -> FloatArray:
    """Posterior draws of all parameters of a model, (N, p) in its order; what has no draws has its one value."""
    space = parameter_layout(tree).space
    own = posterior_draws(tree, DRAWS, SEED)
    whole = np.empty((len(own), len(model.parameters)))
    starts = parameter_starts(tree, model)
    for k, parameter in enumerate(model.parameters):
        free = parameter.name in space.names
        whole[:, k] = own[:, space.index(parameter.name)] if free else starts[parameter.name].value
    return whole


def _tested(tree: xr.DataTree, model: Model) -> list[dict[str, float]]:
    """Every combination of the model's conditions in the tests, in their order."""
    names = [c.name for c in model.conditions]
    node = tree.children.get("conditions")
    if node is None:
        return [{name: start.value for name, start in condition_starts(tree, model).items()}]
    values = node.dataset["value"].sel(condition=names).values
    tell = [k for k, name in enumerate(names) if name not in TIME_CONDITIONS]
    found: dict[tuple[str, ...], FloatArray] = {}
    for row in values:
        # numbers that differ by rounding are the same condition
        found.setdefault(tuple(f"{row[k]:.6g}" for k in tell), row)
    return [dict(zip(names, map(float, row), strict=True)) for row in found.values()]


def _quantiles(values: FloatArray) -> FloatArray:
    return np.asarray(np.quantile(values, QUANTILES, axis=0, method="inverted_cdf"))


def _head(responses: TyreResponses) -> list[str]:
    return ["input", "output", "slip", *(f"{c.name} [{c.unit}]" for c in responses.model.conditions)]


def _cells(point: OperatingPoint) -> list[str]:
    return [point.source, point.output, repr(point.slip), *map(repr, point.conditions.values())]


def relaxation_csv(responses: TyreResponses) -> str:
    """One row per operating point and definition: slip, conditions, and q05, q50, q95 of the relaxation length in m."""
    rows: list[Sequence[str]] = [[*_head(responses), "definition", "q05", "q50", "q95", "unit"]]
    for point, lengths in zip(responses.points, responses.lengths(), strict=True):
        for definition, values in lengths.items():
            rows.append([*_cells(point), definition, *map(repr, values.tolist()), "m"])
    return _written(rows)


def bode_csv(responses: TyreResponses) -> str:
    """One row per condition and frequency: q05, q50 and q95 of the gain (output over input, SI) and the phase [deg]."""
    columns = [f"{what}_{q}" for what in ("gain", "phase") for q in ("q05", "q50", "q95")]
    rows: list[Sequence[str]] = [[*_head(responses), "frequency [Hz]", *columns]]
    for point, gain, phase in responses.bode():
        for k, frequency in enumerate(FREQUENCIES):
            numbers = (frequency, *gain[:, k], *phase[:, k])
            rows.append([*_cells(point), *(repr(float(number)) for number in numbers)])
    return _written(rows)


def _written(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
