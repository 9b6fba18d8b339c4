"""How much the slope of the likelihood scatters at a minimum: by noise, and by what the model misses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtri

from mofit.joint import JointProblem
from mofit.objectives import Score, join_scores
from mofit.problem import Problem
from mofit.signals import NoiseProcess, noise_process

Array = NDArray[np.float64]

#: A gap is one if the lines that repeat stand out of the noise so clearly that chance does it this rarely.
_CHANCE = 0.01


def score(problem: Problem | JointProblem, point: Array) -> Score:
    """Of every test at a point (d,); see `mofit.objectives.Score`."""
    if isinstance(problem, JointProblem):
        parts = [score(problem.main, point)]
        for companion in problem.companions:
            own, index, stretch = problem.share(companion, point[None])
            parts.append(score(companion, own[0]).spread(index, stretch[0], len(point)))
        return join_scores(parts)
    sums, weights = problem.sums(point[None]), problem.noise.weights
    slope = problem.space.slope(problem.space.from_unit(point))
    stored = problem.simulator.sensitivities(problem.full(point[None]))
    processes, columns = [], []
    for t, (output, slopes) in enumerate(stored):
        found, scaled = _records(problem, t, output[0], slopes[0] * slope)
        processes.append(found)
        columns.append(scaled)
    excess, gap_freedom = _gap([process for found in processes for process in found], len(point))
    noise, gap, freedom = [], [], []
    for found, scaled in zip(processes, columns, strict=True):
        pairs = list(zip(found, scaled, strict=True))
        noise.append(sum(process.information(own) for process, own in pairs))
        gap.append(sum(process.information(own, _on_lines(process, excess)) for process, own in pairs))
        freedom.append(sum(process.typical_freedom(own) for process, own in pairs))
    return Score(
        slope=weights[:, None] * sums.gradient[0],
        normal=weights[:, None, None] * sums.normal[0],
        noise=weights[:, None, None] ** 2 * np.array(noise),
        gap=weights[:, None, None] ** 2 * np.array(gap),
        freedom=np.array(freedom),
        gap_freedom=gap_freedom,
        gap_squares=excess,
    )


def _records(problem: Problem, test: int, output: Array, slopes: Array) -> tuple[list[NoiseProcess], list[Array]]:
    """Noise of every output of a test and its sensitivities (n, d), relative to its range, over the judged samples."""
    drive, period = problem.drives[test], problem.records[test].period
    processes, columns = [], []
    for i in range(output.shape[1]):
        used = drive.weights[:, i] > 0
        scale = np.sqrt(drive.weights[used, i])
        simulated = output[used, i] * scale
        residual = drive.measured[used, i] * scale - simulated
        processes.append(noise_process(residual, simulated, np.asarray(drive.step * np.flatnonzero(used)), period))
        columns.append(slopes[used, i] * scale[:, None])
    return processes, columns


def _gap(processes: list[NoiseProcess], parameters: int) -> tuple[tuple[float, float], float]:
    """Squared amplitude on the fundamental and on the harmonics beyond the noise, and the degrees of freedom behind it.

    Relative to the range of the output, as all residuals are, and so the same for all tests. The fit has taken up to
    one degree of freedom per parameter out of the two that each fundamental has.
    """
    lined = [process for process in processes if len(process.lines)]
    pairs = [
        np.stack([4 / p.count * p.repeated, 4 / p.count * p.spectrum[p.lines], p.freedom[p.lines]], axis=1)
        for p in lined
    ]
    first = np.array([pair[0] for pair in pairs]).reshape(-1, 3)
    higher = np.concatenate([pair[1:] for pair in pairs] or [np.empty((0, 3))])
    freedom = float(max(2 * len(first) - parameters, 0))
    return (_excess(first, freedom), _excess(higher, 2.0 * len(higher))), max(freedom, 1.0)


def _excess(lines: Array, freedom: float) -> float:
    """What a line has beyond the noise, from what it has, the noise and its degrees of freedom; 0 if by chance."""
    if freedom <= 0:
        return 0.0
    power, noise, known = lines.T
    if 2 / freedom * np.sum(power / noise) < fdtri(freedom, np.median(known), 1 - _CHANCE):
        return 0.0
    return max(float(2 / freedom * np.sum(power) - np.mean(noise)), 0.0)


def _on_lines(process: NoiseProcess, excess: tuple[float, float]) -> Array:
    """The spectrum of the gap on the bins of a record."""
    spectrum = np.zeros_like(process.spectrum)
    spectrum[process.lines[:1]], spectrum[process.lines[1:]] = process.count / 4 * np.array(excess)
    return spectrum
