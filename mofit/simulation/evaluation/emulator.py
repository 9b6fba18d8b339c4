r"""An emulator of the response: a simulator that costs nothing, around one point.

The responses of a test at K parameter sets span a space of few dimensions (principal components, by the weights of the
fit). Its coordinates c are smooth functions of the parameters (`mofit.simulation.evaluation.surface`):

.. math:: y(p) \approx \bar y + B \, c(z), \quad z = L^{-1} (u(p) - u_0)

with the unit coordinates u and a covariance :math:`L L^T` that whitens the posterior. Squares of residuals follow from
c alone: :math:`r_0^T W r_0 + 2 c^T B^T W r_0 + c^T B^T W B c`.

References
----------
Higdon, Gattiker, Williams, Rightley: Computer model calibration using high-dimensional output, JASA 103 (2008).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.simulation.evaluation.surface import Surface
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.time_grid import StepChoice

#: Share of the responses' spread, squared, that the components may leave out.
_LEFT_OUT = 1e-10


@dataclass(frozen=True)
class Coordinates:
    """Whitened coordinates of the free parameters."""

    space: ParameterSpace
    """The free parameters that the simulator differentiates by."""
    columns: tuple[int, ...]
    """Their places among all parameters."""
    centre: FloatArray
    """Unit coordinates of the point, (d,)."""
    root: FloatArray
    """L, lower triangular, (d, d)."""

    def of(self, p: FloatArray) -> FloatArray:
        """Coordinates z (N, d) of parameter sets (N, np)."""
        unit = self.space.to_unit(p[:, self.columns])
        return np.asarray(np.linalg.solve(self.root, (unit - self.centre).T).T)

    def rates(self, p: FloatArray) -> FloatArray:
        """Derivatives of z by the values of the parameters, (N, d, d)."""
        rate = 1.0 / self.space.derivative(p[:, self.columns])
        return np.asarray(np.linalg.inv(self.root)[None] * rate[:, None, :])


@dataclass(frozen=True)
class _Components:
    """The responses of one test: mean (n, ny), components (m, n, ny), and which columns of the surface they have."""

    mean: FloatArray
    basis: FloatArray
    columns: slice
    sums: dict[int, tuple[ExperimentData, FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)

    def quadratic(self, experiment: ExperimentData) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Constant (ny,), linear (ny, m) and quadratic part (ny, m, m) of the squares; remembered by the test."""
        if id(experiment) not in self.sums:
            residual = np.where(experiment.weights > 0, self.mean - experiment.measured, 0.0)
            weighted = experiment.weights * self.basis
            self.sums[id(experiment)] = (
                experiment,  # kept, so that no other gets its id
                np.einsum("ky,ky->y", experiment.weights, residual**2),
                np.einsum("mky,ky->ym", weighted, residual),
                np.einsum("mky,jky->ymj", weighted, self.basis, optimize=True),
            )
        return self.sums[id(experiment)][1:]


class Emulator:
    """Stands for the simulations of tests; see `mofit.simulation.engines.Engine`.

    Parameters
    ----------
    coordinates
        Of the parameter sets.
    experiments
        The tests, by name.
    sets, responses
        Parameter sets (K, np), and outputs (K, n, ny) of every test at them.
    importance
        Weight of every test in what the surface fits, (T,).
    volumes
        Further numbers to emulate, (K,): what scoped parameters add to a negative log likelihood.
    seed
        Of the starts for the lengths of the process.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        experiments: Sequence[ExperimentData],
        sets: FloatArray,
        responses: Sequence[FloatArray],
        importance: FloatArray,
        volumes: FloatArray,
        seed: int,
    ) -> None:
        self.coordinates = coordinates
        self._components: dict[str, _Components] = {}
        columns: list[FloatArray] = []
        start = 0
        for experiment, values, weight in zip(experiments, responses, importance, strict=True):
            mean, basis, own = _principal(values, experiment.weights)
            self._components[experiment.name] = _Components(mean, basis, slice(start, start + own.shape[1]))
            columns.append(np.sqrt(weight) * own)
            start += own.shape[1]
        scale = np.concatenate([np.full(own.shape[1], w**-0.5) for own, w in zip(columns, importance, strict=True)])
        z, rng = coordinates.of(sets), np.random.default_rng(seed)
        self._surface, self._scale = Surface.fitted(z, np.concatenate(columns, axis=1), rng), scale
        self._volume = Surface.fitted(z, volumes[:, None], rng) if np.any(volumes) else None

    @property
    def error(self) -> float:
        """Leave-one-out error of the weighted responses, root of the sum of squares."""
        return self._surface.error

    def without_tables(self) -> Emulator:
        """Itself."""
        return self

    def log_volume(self, p: FloatArray) -> FloatArray:
        """The further numbers at sets (N, np), (N,)."""
        return np.zeros(len(p)) if self._volume is None else self._volume(self.coordinates.of(p))[:, 0]

    def reduced(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> FloatArray:
        """Sums per set, test and output, (N, T, ny, terms)."""
        c, slopes = self._coefficients(p, derivatives)
        found = []
        for experiment in experiments:
            one = self._components[experiment.name]
            constant, linear, square = one.quadratic(experiment)
            own = c[:, one.columns]
            bent = np.einsum("ymj,nj->nym", square, own)
            cost = constant + np.einsum("nym,nm->ny", bent + 2 * linear, own)
            # rounding may leave a square a little below 0
            terms = [np.maximum(cost, 0.0)[..., None]]
            if derivatives:
                mine = slopes[:, one.columns]
                terms.append(np.einsum("nym,nmf->nyf", linear + bent, mine))
                matrix = np.einsum("nmf,ymj,njg->nyfg", mine, square, mine, optimize=True)
                row, column = np.triu_indices(mine.shape[-1])
                terms.append(matrix[..., row, column])
            found.append(np.concatenate(terms, axis=-1))
        return np.stack(found, axis=1)

    def stored(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> list[FloatArray]:
        """Outputs and their derivatives, (N, n, ny, 1 + nf) per test."""
        c, slopes = self._coefficients(p, derivatives)
        found = []
        for experiment in experiments:
            one = self._components[experiment.name]
            columns = np.concatenate([c[:, one.columns, None], slopes[:, one.columns]], axis=-1)
            values = np.einsum("mky,nmf->nkyf", one.basis, columns, optimize=True)
            values[..., 0] += one.mean
            found.append(values)
        return found

    def _coefficients(self, p: FloatArray, derivatives: bool) -> tuple[FloatArray, FloatArray]:
        """Coordinates c (N, M) of all tests, and their derivatives by the free parameters (N, M, nf or 0)."""
        z = self.coordinates.of(p)
        if not derivatives:
            return self._surface(z) * self._scale, np.zeros((len(p), len(self._scale), 0))
        values, slopes = self._surface.with_slopes(z)
        return values * self._scale, np.einsum("nmz,nzf->nmf", slopes * self._scale[:, None], self.coordinates.rates(p))


def _principal(values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean (n, ny), components (m, n, ny) and coordinates (K, m) of responses (K, n, ny), by weights (n, ny)."""
    mean = values.mean(axis=0)
    spread = (values - mean).reshape(len(values), -1)
    weighted = spread * np.sqrt(weights).ravel()
    squares, vectors = np.linalg.eigh(weighted @ weighted.T)
    squares, vectors = np.maximum(squares[::-1], 0.0), vectors[:, ::-1]
    rest = 1.0 - np.cumsum(squares) / max(squares.sum(), np.finfo(float).tiny)
    kept = max(1, int(np.argmax(rest <= _LEFT_OUT)) + 1) if squares.sum() > 0 else 1
    size = np.sqrt(np.maximum(squares[:kept], np.finfo(float).tiny))
    basis = (vectors[:, :kept] / size).T @ spread
    return mean, basis.reshape(kept, *mean.shape), vectors[:, :kept] * size
