"""Covariance of the likelihood's gradient at a minimum: by noise, and by what the model misses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from hashlib import sha256
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import fdtri

from mofit._typing import FloatArray
from mofit.data.signals import NoiseProcess, noise_process
from mofit.problem.curvature_adjustment import Score, normal_variance
from mofit.problem.likelihood import TestSums
from mofit.simulation import ExperimentData

#: Samples up to which the noise of a test is kept: it takes several times their memory.
_SHORT_TEST = 20_000
#: Largest p-value at which lines that repeat count as a gap rather than noise.
_CHANCE = 0.01


def score_covariance(
    sums: TestSums,
    weights: FloatArray,
    experiments: Sequence[ExperimentData],
    periods: Sequence[float | None],
    responses: Iterable[tuple[FloatArray, FloatArray]],
    memory: FloatArray | None = None,
) -> Score:
    """The score of every objective at one point; see `mofit.problem.Score`.

    Parameters
    ----------
    sums
        Cost, gradient and Gauss-Newton matrix of every objective there, one point.
    weights
        Weight of each objective's squares.
    experiments, periods
        The tests, and the period of each in s, None where it has none.
    responses
        Of every test: outputs (n, ny) and their sensitivities by the unit coordinates (n, ny, d). Each is
        dropped before the next is asked for.
    memory
        What other records tell of the noise of each objective (`mofit.problem.Noise`).
    """
    noise, lines, freedom, own_memory, powers = [], [], [], [], list[FloatArray]()
    responses, others = iter(responses), iter(np.zeros((len(weights), 1)) if memory is None else memory)
    for experiment, period in zip(experiments, periods, strict=True):
        # handed on, not held: a response and the processes of a test are as large as its record
        for own, on_lines, known, power, told in _moments(experiment, period, *next(responses), others):
            noise.append(own)
            own_memory.append(told)
            lines.append(on_lines)
            freedom.append(known)
            powers.append(power)
    excess, gap_freedom = _gap([own for own in powers if len(own)], sums.gradient.shape[-1])
    gap = np.einsum("e,tedf->tdf", np.array(excess), np.array(lines))
    return Score(
        slope=weights[:, None] * sums.gradient[0],
        normal=weights[:, None, None] * sums.normal[0],
        noise=weights[:, None, None] ** 2 * np.array(noise),
        gap=weights[:, None, None] ** 2 * gap,
        freedom=np.array(freedom),
        gap_freedom=gap_freedom,
        gap_squares=excess,
        memory=np.array(own_memory),
    )


def scatter(
    experiments: Sequence[ExperimentData],
    periods: Sequence[float | None],
    weights: FloatArray,
    responses: Iterable[tuple[FloatArray, FloatArray]],
    gap_squares: tuple[float, float],
) -> FloatArray:
    """Covariance of every objective's weighted gradient by noise and a known gap, (K, L, L); see `score_covariance`.

    What follows takes it for that of a normal distribution: the noise is as large as `Score.for_a_normal` has it.
    """
    found = []
    responses = iter(responses)
    for experiment, period in zip(experiments, periods, strict=True):
        for process, slopes in _residual_noise(experiment, period, *next(responses)):
            noise = process.score_covariance(slopes) * normal_variance(process.effective_degrees_of_freedom(slopes))
            found.append(noise + process.score_covariance(slopes, _on_lines(process, gap_squares)))
    return weights[:, None, None] ** 2 * np.array(found)


def _moments(
    experiment: ExperimentData,
    period: float | None,
    output: FloatArray,
    slopes: FloatArray,
    memory: Iterator[FloatArray],
) -> list[tuple[FloatArray, list[FloatArray], float, FloatArray, FloatArray]]:
    """Of every output in a test: covariance of the score by noise and by gaps, and of the noise what follows.

    Its degrees of freedom, the line powers, and what the record tells of long memory.

    The gaps are 1 on the fundamental, and 1 on the harmonics. The true one is linear in the excess,
    which is known only when all tests have been seen.
    """
    found = []
    for alone, own in _residual_noise(experiment, period, output, slopes):
        process = alone.beside(next(memory))
        lines = [process.score_covariance(own, _on_lines(process, unit)) for unit in ((1.0, 0.0), (0.0, 1.0))]
        freedom = process.effective_degrees_of_freedom(own)
        found.append((process.score_covariance(own), lines, freedom, _line_powers(process), process.memory))
    return found


#: Of a test: what its noise was found from last, and that of every output.
_noise: WeakKeyDictionary[ExperimentData, tuple[bytes, dict[int, NoiseProcess]]] = WeakKeyDictionary()


def _known_noise(
    experiment: ExperimentData, period: float | None, output: FloatArray, slopes: FloatArray
) -> dict[int, NoiseProcess]:
    """Noise of every output of a test as far as it was found before, and a place for what is found.

    What other records tell of the noise comes later, when the fit to this one stays.
    """
    if experiment.samples > _SHORT_TEST:
        return {}
    digest = sha256(repr(period).encode() + output.tobytes() + slopes.tobytes()).digest()
    if experiment not in _noise or _noise[experiment][0] != digest:
        _noise[experiment] = digest, {}
    return _noise[experiment][1]


def _residual_noise(
    experiment: ExperimentData, period: float | None, output: FloatArray, slopes: FloatArray
) -> Iterator[tuple[NoiseProcess, FloatArray]]:
    """Noise of every output measured in a test and its sensitivities (n, d), relative to its range, where used."""
    known = _known_noise(experiment, period, output, slopes)
    for i in experiment.fitted:
        used = experiment.weights[:, i] > 0
        scale = np.sqrt(experiment.weights[used, i])
        simulated = output[used, i] * scale
        residual = experiment.measured[used, i] * scale - simulated
        time, own = np.asarray(experiment.step * np.flatnonzero(used)), slopes[used, i] * scale[:, None]
        if i not in known:
            known[i] = noise_process(residual, simulated, time, period, fitted=own)
        yield known[i], own


def _line_powers(process: NoiseProcess) -> FloatArray:
    """Squared amplitude, that of the noise and its degrees of freedom on fundamental and harmonics, (lines, 3)."""
    p = process
    return np.stack(
        [4 / p.count * p.harmonic_power, 4 / p.count * p.spectrum[p.harmonics], p.degrees_of_freedom[p.harmonics]],
        axis=1,
    )


def _gap(lines: list[FloatArray], parameters: int) -> tuple[tuple[float, float], float]:
    """Squared amplitude on the fundamental and on the harmonics beyond the noise, and the degrees of freedom behind it.

    Relative to the range of the output, as all residuals are, and so the same for all tests. The fit has taken up to
    one degree of freedom per parameter out of the two that each fundamental has.

    ``lines`` are those of the records that have some, see `_line_powers`.
    """
    first = np.array([own[0] for own in lines]).reshape(-1, 3)
    higher = np.concatenate([np.empty((0, 3)), *[own[1:] for own in lines]])
    freedom = float(max(2 * len(first) - parameters, 0))
    return (_excess(first, freedom), _excess(higher, 2.0 * len(higher))), max(freedom, 1.0)


def _excess(lines: FloatArray, freedom: float) -> float:
    """What a line has beyond the noise, from what it has, the noise and its degrees of freedom; 0 if by chance."""
    if freedom <= 0:
        return 0.0
    power, noise, known = lines.T
    if 2 / freedom * np.sum(power / noise) < fdtri(freedom, np.median(known), 1 - _CHANCE):
        return 0.0
    return max(float(2 / freedom * np.sum(power) - np.mean(noise)), 0.0)


def _on_lines(process: NoiseProcess, excess: tuple[float, float]) -> FloatArray:
    """The spectrum of the gap on the bins of a record."""
    spectrum = np.zeros_like(process.spectrum)
    spectrum[process.harmonics[:1]], spectrum[process.harmonics[1:]] = process.count / 4 * np.array(excess)
    return spectrum
