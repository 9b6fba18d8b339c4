r"""Sensitivities of the outputs of a test, and the matrices that follow from them and the noise.

With the sensitivities S of the outputs to the parameters over the samples used in the fit, and the covariance
:math:`\Sigma` of their noise, the Fisher information and the Cramér-Rao bound are

.. math:: F = S^T \Sigma^{-1} S, \qquad \operatorname{cov} \hat\theta \ge (F_1 + F_2 + \dots + P)^{-1}

for independent tests and a prior of precision P. :math:`\Sigma` is diagonal on the bins of the Fourier transform
(circulant) between the levels of the noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mofit._typing import FloatArray
from mofit.data.signals import NoiseProcess
from mofit.experimental_design.noise_model import NoiseModel, bin_weights, combined, independent_share, mean_variance
from mofit.models import System
from mofit.simulation import ExperimentData, Simulator

#: Allowed error of the integration relative to the output's range.
TOLERANCE = 1e-6
#: Numbers held at a time: 128 MB.
_AT_ONCE = 16_000_000
#: Up to so many simulations, choosing the integrator's steps for a box of parameters costs more than it saves.
_FEW = 256


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Outputs and sensitivities of one test at N parameter samples: ny outputs that it has, n samples, p parameters."""

    test: str
    """Name of the test."""
    step: float
    """Sampling interval [s]."""
    outputs: tuple[FloatArray, ...]
    """Simulated outputs at the samples used in the fit, per output (N, n_y)."""
    jacobians: tuple[FloatArray, ...]
    """Their derivatives with respect to the parameters in SI units, per output (N, n_y, p)."""
    ranges: FloatArray
    """Range of every output, by which the identification normalises, (ny,)."""
    noise: tuple[tuple[tuple[NoiseProcess, ...], ...], ...]
    """Independent parts of the noise, per output and parameter sample."""

    @cached_property
    def fisher(self) -> FloatArray:
        """Fisher information, shape (N, p, p); nan where the simulation fails."""
        return np.sum(
            [
                [_fisher(own, combined(parts)) for own, parts in zip(jacobians, noise, strict=True)]
                for jacobians, noise in zip(self.jacobians, self.noise, strict=True)
            ],
            axis=0,
        )

    def spectrum(self, output: int = 0, sample: int = 0) -> tuple[FloatArray, FloatArray]:
        """Frequencies (k,) in Hz and whitened sensitivities (k, p), complex; their squares sum to the information."""
        noise = combined(self.noise[output][sample])
        return np.asarray(np.fft.rfftfreq(noise.count, self.step)), _whitened(self.jacobians[output][sample], noise)

    @cached_property
    def hessian(self) -> FloatArray:
        """Gauss-Newton Hessian H of the weighted sum of squares that the identification minimises, (N, p, p)."""
        return np.sum(
            [
                weight[:, None, None] * (np.einsum("nki,nkj->nij", own, own) / width**2)
                for own, width, weight in zip(self.jacobians, self.ranges, self.weight, strict=True)
            ],
            axis=0,
        )

    @cached_property
    def score_covariance(self) -> FloatArray:
        """Covariance J of the gradient of half that sum, (N, p, p)."""
        return np.sum(
            [
                weight[:, None, None] ** 2 * (np.stack([
                    np.sum([part.score_covariance(jacobian) for part in parts], axis=0)
                    for jacobian, parts in zip(own, noise, strict=True)
                ]) / width**4)
                for own, noise, width, weight in zip(self.jacobians, self.noise, self.ranges, self.weight, strict=True)
            ],
            axis=0,
        )  # fmt: skip

    @property
    def count(self) -> FloatArray:
        """Number of samples of every output used in the fit, (ny,)."""
        return np.array([float(own.shape[1]) for own in self.outputs])

    @cached_property
    def noise_variance(self) -> FloatArray:
        """Variance of the noise of every output over its squared range, (ny, N)."""
        return np.array([
            [mean_variance(combined(parts)) / width**2 for parts in own]
            for own, width in zip(self.noise, self.ranges, strict=True)
        ])  # fmt: skip

    @cached_property
    def independent(self) -> FloatArray:
        """Expected number of independent samples of every output, as the identification counts them, (ny, N)."""
        whole = [[combined(parts) for parts in own] for own in self.noise]
        return np.array([[independent_share(part) * part.count for part in own] for own in whole])

    @cached_property
    def weight(self) -> FloatArray:
        r"""Weight of the squares of every output, :math:`\nu / (n v)` as in `mofit.problem.Noise`, (ny, N)."""
        return np.asarray(self.independent / (self.count[:, None] * self.noise_variance))

    def first(self) -> Sensitivity:
        """The same at the first parameter sample only."""
        return replace(
            self,
            outputs=tuple(own[:1] for own in self.outputs),
            jacobians=tuple(own[:1] for own in self.jacobians),
            noise=tuple(own[:1] for own in self.noise),
        )


def sensitivities(
    system: System,
    experiments: Sequence[ExperimentData],
    values: FloatArray,
    noises: Sequence[Sequence[NoiseModel]],
    names: Sequence[str],
    jobs: int = 1,
    tolerance: float = TOLERANCE,
) -> Iterator[Sensitivity]:
    """Sensitivities of every test, one after the other.

    Values of all of the system's parameters have shape (N, p_all), noises are by test and output, derivatives are with
    respect to the named parameters. Samples without weight are not used. See `mofit.simulation.Simulator`.
    """
    values = np.atleast_2d(values)
    few = len(values) * len(experiments) <= _FEW
    box = None if few else (values.min(axis=0), values.max(axis=0))
    simulator = Simulator(system, experiments, names, jobs=jobs, tolerance=tolerance, box=box)
    for chosen in _portions(experiments, len(values) * (1 + len(names))):
        part = simulator.select(chosen)
        for place, (outputs, jacobians) in zip(chosen, part.sensitivities(values), strict=True):
            yield _sensitivity(experiments[place], outputs, jacobians, noises[place])


def _portions(experiments: Sequence[ExperimentData], columns: int) -> Iterator[list[int]]:
    """Places of the tests, as many together as fit into memory."""
    portion: list[int] = []
    size = 0
    for place, experiment in enumerate(experiments):
        own = experiment.samples * columns * experiment.measured.shape[1]
        if portion and size + own > _AT_ONCE:
            yield portion
            portion, size = [], 0
        portion.append(place)
        size += own
    if portion:
        yield portion


def _sensitivity(
    experiment: ExperimentData, outputs: FloatArray, jacobians: FloatArray, noises: Sequence[NoiseModel]
) -> Sensitivity:
    used = {i: experiment.weights[:, i] > 0 for i in experiment.fitted}
    return Sensitivity(
        test=experiment.name,
        step=experiment.step,
        outputs=tuple(outputs[:, own, i] for i, own in used.items()),
        jacobians=tuple(jacobians[:, own, i] for i, own in used.items()),
        ranges=np.array([experiment.weights[own, i].max() ** -0.5 for i, own in used.items()]),
        noise=tuple(tuple(noises[i](signal, own) for signal in outputs[:, :, i]) for i, own in used.items()),
    )


def _whitened(jacobian: FloatArray, noise: NoiseProcess) -> FloatArray:
    """Sensitivities (n, p) on the bins of the Fourier transform over the noise there, (k, p)."""
    bins = np.fft.rfft(jacobian / noise.level[:, None], axis=0)
    return np.asarray(bins * np.sqrt(bin_weights(noise.count) / (noise.spectrum * noise.count))[:, None])


def _fisher(jacobian: FloatArray, noise: NoiseProcess) -> FloatArray:
    if not np.all(np.isfinite(jacobian)):
        return np.full((jacobian.shape[1],) * 2, np.nan)
    whitened = _whitened(jacobian, noise)
    return np.asarray((whitened.conj().T @ whitened).real)
