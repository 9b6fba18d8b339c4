r"""What a test can tell of the parameters: its Fisher information, from exact sensitivities and the noise it will have.

With the derivatives S of the outputs by the parameters over the judged samples and the covariance :math:`\Sigma` of
their noise,

.. math:: F = S^T \Sigma^{-1} S, \qquad \operatorname{cov} \hat\theta \ge (F_1 + F_2 + \dots + P)^{-1}

for independent tests and a prior of precision P. :math:`\Sigma` is diagonal on the bins of the Fourier transform
(circulant) between the levels of the noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Procedure
from mofit.identifiability.noise import (
    DEFAULT_NOISE,
    ChannelNoise,
    NoiseOf,
    bin_weights,
    independent_share,
    power,
    together,
)
from mofit.identifiability.procedures import planned_drives
from mofit.kernel import Drive, Simulator
from mofit.model import Model, System, build_system
from mofit.signals import NoiseProcess

Array = NDArray[np.float64]

#: Allowed error of the integration relative to the output's range.
TOLERANCE = 1e-6
#: Numbers held at a time: 128 MB.
_AT_ONCE = 16_000_000
#: Parameter sets times tests that count as few.
_FEW = 256
#: An eigenvalue of a matrix of unit diagonal below this is that of a flat direction, a component above `_PART` of it.
_FLAT, _PART = 1e-11, 1e-3


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What one test shows of the parameters, at N parameter sets; ny outputs, n judged samples, p parameters.

    Parameters
    ----------
    test
        Its name.
    step
        Sampling interval, s.
    outputs
        Simulated outputs of the judged samples, per output (N, n_y).
    slopes
        Their derivatives by the parameters in SI units, per output (N, n_y, p).
    ranges
        Range of every output by which the identification divides, (ny,).
    noise
        Independent parts of the noise, per output and parameter set.
    """

    test: str
    step: float
    outputs: tuple[Array, ...]
    slopes: tuple[Array, ...]
    ranges: Array
    noise: tuple[tuple[tuple[NoiseProcess, ...], ...], ...]

    @cached_property
    def information(self) -> Array:
        """Fisher information, shape (N, p, p)."""
        return np.sum(
            [
                [_information(own, together(parts)) for own, parts in zip(slopes, noise, strict=True)]
                for slopes, noise in zip(self.slopes, self.noise, strict=True)
            ],
            axis=0,
        )

    def lines(self, output: int = 0, point: int = 0) -> tuple[Array, Array]:
        """Frequencies (k,) in Hz and whitened derivatives (k, p), complex, whose squares sum up to the information."""
        noise = together(self.noise[output][point])
        return np.asarray(np.fft.rfftfreq(noise.count, self.step)), _whitened(self.slopes[output][point], noise)

    @cached_property
    def normal(self) -> Array:
        """Weighted Gauss-Newton matrix of the squares that the identification minimises, shape (N, p, p)."""
        sums = sum(
            np.einsum("nki,nkj->nij", own, own) / width**2 for own, width in zip(self.slopes, self.ranges, strict=True)
        )
        return np.asarray(self._weight[:, None, None] * sums)

    @cached_property
    def scatter(self) -> Array:
        """Covariance of the slope of half those squares, shape (N, p, p)."""
        sums = sum(
            np.stack([
                np.sum([part.information(slopes) for part in parts], axis=0)
                for slopes, parts in zip(own, noise, strict=True)
            ]) / width**4
            for own, noise, width in zip(self.slopes, self.noise, self.ranges, strict=True)
        )  # fmt: skip
        return np.asarray(self._weight[:, None, None] ** 2 * sums)

    @cached_property
    def _weight(self) -> Array:
        r"""Of the test's squares, :math:`\nu / (n v)` as `mofit.objectives.Noise` has it, shape (N,)."""
        count = sum(own.shape[1] for own in self.outputs)
        weights = []
        for parts in zip(*self.noise, strict=True):
            whole = [together(own) for own in parts]
            variance = np.mean([power(own) / width**2 for own, width in zip(whole, self.ranges, strict=True)])
            independent = sum(independent_share(own) * own.count for own in whole)
            weights.append(independent / (count * variance))
        return np.array(weights)

    def at(self, points: slice) -> Sensitivity:
        """The same at some of its parameter sets."""
        return Sensitivity(
            self.test, self.step, tuple(own[points] for own in self.outputs),
            tuple(own[points] for own in self.slopes), self.ranges, tuple(own[points] for own in self.noise),
        )  # fmt: skip


def sensitivities(
    system: System,
    drives: Sequence[Drive],
    values: Array,
    noises: Sequence[Sequence[NoiseOf]],
    names: Sequence[str],
    jobs: int = 1,
    tolerance: float = TOLERANCE,
) -> Iterator[Sensitivity]:
    """Sensitivities of every test, one after the other.

    Parameters
    ----------
    system
        The model.
    drives
        The tests; samples without weight are not judged.
    values
        All of the system's parameters, shape (N, p_all).
    noises
        Of every test, per output.
    names
        Parameters that the outputs are differentiated by.
    jobs, tolerance
        As in `mofit.kernel.Simulator`.
    """
    values = np.atleast_2d(values)
    # a rule of how to integrate in the sets' box costs as much as measuring it for so many sets
    few = len(values) * len(drives) <= _FEW
    box = None if few else (values.min(axis=0), values.max(axis=0))
    simulator = Simulator(system, drives, names, jobs=jobs, tolerance=tolerance, box=box)
    for chosen in _in_portions(drives, len(values) * (1 + len(names))):
        part = simulator.select(chosen)
        for place, (outputs, slopes) in zip(chosen, part.sensitivities(values), strict=True):
            yield _sensitivity(drives[place], outputs, slopes, noises[place])


def _in_portions(drives: Sequence[Drive], columns: int) -> Iterator[list[int]]:
    """Places of the tests, as many together as fit into memory."""
    portion: list[int] = []
    size = 0
    for place, drive in enumerate(drives):
        own = drive.samples * columns * drive.measured.shape[1]
        if portion and size + own > _AT_ONCE:
            yield portion
            portion, size = [], 0
        portion.append(place)
        size += own
    if portion:
        yield portion


def _sensitivity(drive: Drive, outputs: Array, slopes: Array, noises: Sequence[NoiseOf]) -> Sensitivity:
    judged = [drive.weights[:, i] > 0 for i in range(outputs.shape[2])]
    return Sensitivity(
        test=drive.name,
        step=drive.step,
        outputs=tuple(outputs[:, used, i] for i, used in enumerate(judged)),
        slopes=tuple(slopes[:, used, i] for i, used in enumerate(judged)),
        ranges=np.array([drive.weights[used, i].max() ** -0.5 for i, used in enumerate(judged)]),
        noise=tuple(
            tuple(noise(signal, used) for signal in outputs[:, :, i])
            for i, (noise, used) in enumerate(zip(noises, judged, strict=True))
        ),
    )


def test_information(
    model: Model,
    procedures: Sequence[Procedure],
    values: Array,
    noise: Mapping[str, ChannelNoise],
    names: Sequence[str],
    jobs: int = 1,  # noqa: PT028  # not a pytest function
) -> Array:
    """Fisher information of every test.

    Parameters
    ----------
    model
        What answers to the tests.
    procedures
        The tests; no measured output is needed.
    values
        Parameter sets, (N, p_all) in the order of ``model.parameters``; transients are those at the first.
    noise
        By output; one of 1 % of the range where an output is not named.
    names
        Parameters of the information, in SI units.
    jobs
        Threads; results do not depend on it.

    Returns
    -------
    Array
        Shape (N, T, p, p); nan where a simulation fails.
    """
    values = np.atleast_2d(np.asarray(values, dtype=float))
    drives = planned_drives(model, procedures, values[0], jobs)
    own = [noise.get(channel.name, DEFAULT_NOISE) for channel in model.outputs]
    found = sensitivities(build_system(model), drives, values, [own] * len(drives), names, jobs)
    return np.stack([test.information for test in found], axis=1)


test_information.__test__ = False  # type: ignore[attr-defined]  # not a pytest function


def covariance(information: Array, prior_precision: Array | float = 0.0) -> Array:
    """Covariance of an estimate, the inverse of information (..., p, p) plus a prior's precision (p, p).

    A parameter that takes part in a direction of which nothing is known has an infinite variance (its covariances with
    others are nan), instead of an exception; information that is not finite gives nan.
    """
    total = np.asarray(information, dtype=float) + prior_precision
    finite = np.asarray(np.isfinite(total).all(axis=(-2, -1)))
    total = np.where(finite[..., None, None], total, np.eye(total.shape[-1]))
    size = np.sqrt(np.maximum(np.diagonal(total, axis1=-2, axis2=-1), 0.0))
    silent = size == 0
    size = np.where(silent, 1.0, size)
    scaled = total / (size[..., :, None] * size[..., None, :])
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
    flat = eigenvalues < _FLAT
    inverse = np.where(flat, 0.0, 1 / np.where(flat, 1.0, eigenvalues))
    result = np.einsum("...ik,...k,...jk->...ij", vectors, inverse, vectors)
    result /= size[..., :, None] * size[..., None, :]
    lost = silent | (np.where(flat[..., None, :], np.abs(vectors), 0.0) > _PART).any(axis=-1)
    result = np.where(lost[..., :, None] | lost[..., None, :], np.nan, result)
    diagonal = np.where(lost, np.inf, np.diagonal(result, axis1=-2, axis2=-1))
    place = np.arange(total.shape[-1])
    result[..., place, place] = diagonal
    return np.where(finite[..., None, None], result, np.nan)


def _whitened(slopes: Array, noise: NoiseProcess) -> Array:
    """Derivatives (n, p) on the bins of the Fourier transform over the noise there, (k, p)."""
    bins = np.fft.rfft(slopes / noise.level[:, None], axis=0)
    return np.asarray(bins * np.sqrt(bin_weights(noise.count) / (noise.spectrum * noise.count))[:, None])


def _information(slopes: Array, noise: NoiseProcess) -> Array:
    if not np.all(np.isfinite(slopes)):
        return np.full((slopes.shape[1],) * 2, np.nan)
    scaled = _whitened(slopes, noise)
    return np.asarray((scaled.conj().T @ scaled).real)
