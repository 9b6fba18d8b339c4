"""The outputs of one record at draws of the parameters."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign, Measurement
from mofit.data.signals import SignalAnalysis
from mofit.errors import InputError
from mofit.models import BlackBoxSystem, Model, System, build_system
from mofit.parameters import Parameter, ParameterSpace
from mofit.prediction.draws import posterior_draws
from mofit.prediction.scoped import ScopedValue, scoped_parameters, scoped_values
from mofit.problem.scoped_covariance import scoped_covariance
from mofit.results import parameter_layout
from mofit.simulation import ExperimentData, Simulator, experiment_data, measured_outputs
from mofit.simulation.evaluation.draws import outputs_at
from mofit.simulation.experiment import LEADS
from mofit.simulation.ranges import data_scales, scaled
from mofit.simulation.requirements import analysed
from mofit.simulation.scoped_simulator import ScopedSimulator
from mofit.simulation.scopes import Scopes

#: Draws of the parameters: 5 % quantiles within 1.5 % of probability. Of long records fewer, but not less than these,
#: so that their outputs take at most so many numbers.
DRAWS, FEWEST_DRAWS, MOST_NUMBERS = 200, 20, 32_000_000
#: Integration error that is allowed, relative to the output's range.
TOLERANCE = 1e-5
#: Draws that decide for how long the inputs of a record are led in, and the share of the error that this must remove.
_FEW, _NEARER = 8, 1e-3
#: Room around the draws for which the integration steps are chosen, relative to their extent.
_ROOM = 0.05


@dataclass(frozen=True)
class Response:
    """Outputs of a record at draws (D, n, ny), where its scoped values come from, and the record as simulated."""

    outputs: FloatArray
    scoped: tuple[ScopedValue, ...]
    experiment: ExperimentData


@dataclass(frozen=True)
class Identified:
    """A run and its model: what responds to a record."""

    tree: xr.DataTree
    model: Model
    jobs: int = 1

    @cached_property
    def system(self) -> System:
        """The model in vector form."""
        return build_system(self.model)

    @property
    def seed(self) -> int:
        """That of the run."""
        return int(self.tree.attrs["seed"])

    @cached_property
    def _configuration(self) -> dict[str, Any]:
        return dict(json.loads(self.tree.attrs["configuration"]))

    @cached_property
    def _known(self) -> dict[str, FloatArray]:
        """Draws of the free parameters by name, and values of the fixed ones."""
        layout = parameter_layout(self.tree)
        columns = posterior_draws(self.tree, DRAWS, self.seed).T
        fixed = {name: np.full(DRAWS, value) for name, value in layout.fixed.items()}
        return fixed | dict(zip(layout.space.names, columns, strict=True))

    def scoped(self, measurement: Measurement) -> tuple[Parameter, ...]:
        """Parameters with a value per test or condition, in ranges for the record."""
        campaign = Campaign("record", "measured", {}, (measurement,))
        model = scaled(self.model, data_scales(self.model, campaign))
        return scoped_parameters(model.parameters, self._configuration, list(self._known))

    def response(self, measurement: Measurement) -> Response:
        """The outputs of a record from its first sample, at all draws whose simulation succeeds.

        Raises
        ------
        InputError
            If it succeeds at none.
        """
        model, measured = self.model, measured_outputs(self.model, measurement)
        analysis = analysed(model, measurement) if measured else _NOTHING
        experiment = experiment_data(model, measurement, analysis, False)
        scoped = scoped_values(self.tree, self.scoped(measurement), measurement, bool(measured))
        count = int(np.clip(MOST_NUMBERS // experiment.measured.size, FEWEST_DRAWS, DRAWS))
        sets = self._sets(scoped, count)
        if analysis.steady_from_start and model.dynamic and measurement.experiment.transient is None:
            experiment = self._led(experiment, measurement, analysis, sets)
        fitted = [one.parameter for one in scoped if one.source == "fitted"]
        if fitted:
            sets = self._fitted(experiment, measurement, fitted, sets, analysis.period)
        outputs = self._outputs(experiment, sets)
        good = np.isfinite(outputs).all(axis=(1, 2))
        if not good.any():
            message = f"model '{model.name}' gives no finite output at any draw of the run"
            raise InputError.of(f"test '{measurement.name}'", message, "Check its inputs and conditions")
        return Response(outputs[good], tuple(scoped), experiment)

    def _led(
        self, experiment: ExperimentData, measurement: Measurement, analysis: SignalAnalysis, sets: FloatArray
    ) -> ExperimentData:
        """The record with its inputs led in as long as that brings the outputs nearer to those measured.

        See `mofit.identification.steady_start`.
        """
        length = measurement.experiment.length + measurement.experiment.step
        best, error = experiment, np.inf
        for lengths in (0, *LEADS):
            led = experiment_data(self.model, measurement, replace(analysis, lead=lengths * length), False)
            squares = float(np.median(self._simulator(led, sets[:_FEW]).cost(sets[:_FEW]).sum(axis=1)))
            if not squares < (1 - _NEARER) * error:
                break
            best, error = led, squares
        return best

    def _sets(self, scoped: Sequence[ScopedValue], count: int) -> FloatArray:
        """Values of all parameters, (count, np); those that are fitted have any."""
        rng = np.random.default_rng((self.seed, 1))
        values = dict(self._known)
        for one in scoped:
            values[one.parameter.name] = one.draws(self._known, DRAWS, rng)
        return np.stack([values[name][:count] for name in self.system.parameters], axis=1)

    def _fitted(
        self,
        experiment: ExperimentData,
        measurement: Measurement,
        fitted: Sequence[Parameter],
        sets: FloatArray,
        period: float | None,
    ) -> FloatArray:
        """The sets (D, np) with values fitted to the record at each, moved by what is not known of them.

        Their covariance is that of a fit of this record with its coloured residual, see
        `mofit.problem.scoped_covariance`, at the set in the middle.
        """
        scopes = Scopes.of(ParameterSpace(tuple(fitted)), [measurement])
        simulator = ScopedSimulator(
            self.system, [experiment], (), scopes, jobs=self.jobs, tolerance=TOLERANCE, box=_around(sets)
        )
        best, weights = simulator.best(sets), np.ones(len(experiment.fitted))
        middle = sets[np.argsort(np.sum(best.cost, axis=1))[len(sets) // 2]][None]
        (covariance,) = scoped_covariance(simulator, middle, [period], weights, (0.0, 0.0))
        rng = np.random.default_rng((self.seed, 2))
        moved = rng.multivariate_normal(np.zeros(len(covariance)), covariance, len(sets))
        found = sets.copy()
        found[:, simulator.columns] = scopes.space.from_unit(np.clip(best.unit[:, 0] + moved, 0.0, 1.0))
        return found

    def _outputs(self, experiment: ExperimentData, sets: FloatArray) -> FloatArray:
        """The outputs (D, n, ny) at sets (D, np); those of a costly simulator are simulated at some of them."""
        simulator = self._simulator(experiment, sets)
        if isinstance(self.system, BlackBoxSystem):
            return outputs_at(simulator, self.system.space, sets, self.seed)
        (outputs,) = simulator.simulate(sets)
        return outputs

    def _simulator(self, experiment: ExperimentData, sets: FloatArray) -> Simulator:
        """One of its own for every record, so that no other record changes its integration steps."""
        return Simulator(self.system, [experiment], (), jobs=self.jobs, tolerance=TOLERANCE, box=_around(sets))


def _around(sets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Bounds of the sets (D, np) with some room; what is positive stays so."""
    low, high = sets.min(axis=0), sets.max(axis=0)
    room = _ROOM * (high - low)
    return np.where(low > 0, np.maximum(low - room, 0.5 * low), low - room), high + room


#: What is known of a record without an output: it is not scored.
_NOTHING = SignalAnalysis(None, 0, 0.0, 0.0, {}, "", {})
