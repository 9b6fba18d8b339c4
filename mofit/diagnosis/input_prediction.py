r"""Records that do not repeat: what past inputs predict of the residual is a gap, what is left beside that is noise.

An output-error model may leave a coloured residual and be right; wrong is one whose residual depends on the input. So
the residual is regressed on functions of past inputs and of the model's own response to them, and on what rotates,

.. math:: e(t) = \sum_j c_j\, \varphi_j(u(s), \hat y(s); s \le t) + n(t),

by generalised least squares, in turn with the spectrum of the noise n.

References
----------
Ljung, "System Identification" (1999), ch. 16: independence of residuals and past inputs.
Ljung, "Model validation and model error modelling" (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from mofit._typing import FloatArray
from mofit.data.signals import noise_process, thin_svd
from mofit.diagnosis.past_inputs import decaying, predictors
from mofit.diagnosis.spectral_classes import ORDER, highest_excited
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.diagnosis.whitening import Whitening

#: Rounds in which prediction and noise are estimated in turn.
_ROUNDS = 3
#: p-value from which on what the functions leave of a free decay is noise.
_MISFIT = 1e-3
#: Relative singular value below which a combination of functions is none.
_RANK = 1e-6
#: Least share of a line's noise that the regression is taken to leave.
_LEAST_KEPT = 1e-3


def with_noise_beside_prediction(observed: WhitenedData, simulated: Sequence[FloatArray]) -> WhitenedData:
    """The tests with the noise of all records that do not repeat, and the functions that predict their residual.

    Parameters
    ----------
    observed
        The tests.
    simulated
        Outputs of the fitted model per test, (samples, outputs).
    """
    processes, functions = {}, {}
    for output in sorted({output for _, output, w in observed.records if not w.periods}):
        own = [(test, w) for test, of, w in observed.records if of == output and not w.periods]
        found = predictors(observed, own, output, simulated)
        columns = [_centred(one, w) for (_, w), one in zip(own, found, strict=True)]
        noisy = _noise(observed, own, output, simulated, columns)
        for (test, _), w, one in zip(own, noisy, columns, strict=True):
            processes[test, output], functions[test, output] = w.process, one
    again = whiten(observed.problem, observed.calibrations, observed.simulators, processes)
    return replace(again, predictors=tuple(functions.get((test, output)) for test, output, _ in again.records))


def _noise(
    observed: WhitenedData,
    own: Sequence[tuple[int, Whitening]],
    output: int,
    simulated: Sequence[FloatArray],
    columns: Sequence[FloatArray],
) -> list[Whitening]:
    """Whitening of every record, by the spectrum of what the functions (samples, q) of each leave of its residual."""
    experiments = observed.problem.experiments
    signals = [simulated[test][:, output] for test, _ in own]
    residuals = [
        _centred((experiments[test].measured[:, output] - signal)[:, None], w)
        for (test, w), signal in zip(own, signals, strict=True)
    ]
    records = [_with_noise(w, one, signal) for (_, w), one, signal in zip(own, residuals, signals, strict=True)]
    for _ in range(_ROUNDS):
        rows = [w.rows(one) for w, one in zip(records, columns, strict=True)]
        white = np.concatenate([w.rows(one)[:, 0] for w, one in zip(records, residuals, strict=True)])
        coefficients, leverage = _regressed(np.concatenate(rows), white)
        of_records = np.split(leverage, np.cumsum([len(one) for one in rows])[:-1])
        rests = [residual - one @ coefficients[:, None] for residual, one in zip(residuals, columns, strict=True)]
        records = [
            _with_noise(w, rest, signal, _absorbed(w, rest, residual, own_leverage))
            for w, rest, residual, signal, own_leverage in zip(
                records, rests, residuals, signals, of_records, strict=True
            )
        ]
    if not decaying(observed, own):
        return records
    unpredicted = zip(records, _unpredicted(own, residuals, columns), signals, strict=True)
    beyond = [_with_noise_beyond(w, rest, signal) for w, rest, signal in unpredicted]
    moving = [_moving(w, signal) for w, signal in zip(records, signals, strict=True)]
    return beyond if _misfit(records, beyond, moving) else records


def _with_noise(w: Whitening, rest: FloatArray, signal: FloatArray, taken: FloatArray | float = 0.0) -> Whitening:
    """The whitening with the noise of a signal (samples, 1), of whose lines (lines,) a share was absorbed by a fit."""
    used = slice(w.start, w.start + w.count)
    time = np.asarray(w.step * np.arange(w.count), dtype=np.float64)
    process = noise_process(rest[used, 0], signal[used], time, None, without_lines=True, taken=taken)
    return replace(w, process=process)


def _absorbed(w: Whitening, rest: FloatArray, whole: FloatArray, leverage: FloatArray) -> FloatArray:
    r"""Share of the noise on every line that a fit has absorbed, (lines,): of a ``whole`` signal it left the ``rest``.

    With the leverage :math:`\tau` of the rows noise leaves :math:`1 - \tau` of its power, what a wrong model leaves
    does not; but noise is no more than the whole holds there. Of noise, the smaller of the two is expected to have
    :math:`1 - \sqrt\tau / 2` of its power: both are chi-square, with a correlation of :math:`1 - \tau`.
    """
    used = slice(w.start, w.start + w.count)
    parts = np.bincount(w.line_of_row, minlength=len(w.frequencies))
    tau = np.bincount(w.line_of_row, leverage, len(parts)) / np.maximum(parts, 1)
    left, held = (np.abs(np.fft.rfft(one[used, 0])) ** 2 for one in (rest, whole))
    kept = np.clip(1 - tau, _LEAST_KEPT, 1.0)
    power = np.minimum(left / kept, held) / (1 - np.sqrt(1 - kept) / 2)
    return np.asarray(1 - np.maximum(left, _LEAST_KEPT**2 * held) / np.maximum(power, np.finfo(float).tiny))


def _unpredicted(
    own: Sequence[tuple[int, Whitening]], residuals: Sequence[FloatArray], columns: Sequence[FloatArray]
) -> list[FloatArray]:
    """What the functions (samples, q) of all records leave of their residuals (samples, 1), by least squares."""
    used = [slice(w.start, w.start + w.count) for _, w in own]
    rows, rest = (
        np.concatenate([one[here] for one, here in zip(several, used, strict=True)]) for several in (columns, residuals)
    )
    coefficients, _ = _regressed(rows, rest[:, 0])
    return [residual - one @ coefficients[:, None] for residual, one in zip(residuals, columns, strict=True)]


def _with_noise_beyond(w: Whitening, rest: FloatArray, signal: FloatArray) -> Whitening:
    """The whitening with the noise of a free decay, as it is on the lines beyond those of the motion and its harmonics.

    The functions need not follow what the model misses there; what they leave is no noise: a decay by friction ends.
    All is tapered, so that nothing of the motion leaks to the other lines from the record's ends.
    """
    used = slice(w.start, w.start + w.count)
    taper = np.hanning(w.count)
    tapered = rest[used, 0] * taper / np.sqrt(np.mean(taper**2))
    time = np.asarray(w.step * np.arange(w.count), dtype=np.float64)
    process = noise_process(tapered, np.zeros(w.count), time, None, without_lines=True, unknown=_moving(w, signal))
    return replace(w, process=process)


def _moving(w: Whitening, signal: FloatArray) -> NDArray[np.bool_]:
    """Lines of a decay's motion (samples,) and of its low harmonics, half of all at most, (lines,)."""
    number, used = np.arange(len(w.frequencies)), signal[w.start : w.start + w.count]
    return np.asarray(number <= min(ORDER * highest_excited(used * np.hanning(w.count)), len(number) // 2))


def _misfit(records: Sequence[Whitening], beyond: Sequence[Whitening], moving: Sequence[NDArray[np.bool_]]) -> bool:
    """Whether what is left on the lines of the motion is more than the noise of the others lets expect in all records.

    Coloured noise is stronger there, too, and those others hardly tell how much: that is in their degrees of freedom.
    """
    evidence = 0.0
    for left, noise, lines in zip(records, beyond, moving, strict=True):
        ratio = float(np.mean((left.process.spectrum / noise.process.spectrum)[lines]))
        freedom = float(np.median(noise.process.degrees_of_freedom[lines]))
        p = float(fdtrc(2 * int(lines.sum()), freedom, ratio))
        evidence -= 2 * np.log(max(p, np.finfo(float).tiny))
    return bool(chdtrc(2 * len(records), evidence) < _MISFIT)


def _regressed(rows: FloatArray, white: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients (q,) of columns (rows, q), and the leverage of every row."""
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    vectors, values, turned = thin_svd(rows / size)
    kept = values > _RANK * values[0]
    coefficients = turned[kept].T @ ((vectors[:, kept].T @ white) / values[kept]) / size
    return coefficients, np.asarray(np.sum(vectors[:, kept] ** 2, axis=1))


def _centred(columns: FloatArray, w: Whitening) -> FloatArray:
    """Signals (samples, k) without their means over the samples used: of a constant no input is the cause."""
    return np.asarray(columns - columns[w.start : w.start + w.count].mean(axis=0))
