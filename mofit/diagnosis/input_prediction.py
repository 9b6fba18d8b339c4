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

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import f as fisher

from mofit._typing import FloatArray
from mofit.data.signals import noise_process, thin_svd
from mofit.diagnosis.spectral_classes import ORDER, highest_excited, rotational_orders
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.diagnosis.whitening import Whitening
from mofit.simulation.requirements import exciting_channel, undriven

#: Powers of a signal at every lag, and the number of lags.
_POWERS, _LAGS = (1, 2, 3), 10
#: Longest lag as a share of the shortest record: nine tenths of its samples have their past.
_LONGEST = 0.1
#: Half turns by which the response of a free decay may slip in a record.
_SLIPS = 6
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
        kinds = (_functions(observed, own, output, simulated), _turning(observed, own), _halved(observed, own))
        columns = [_centred(np.concatenate(several, axis=1), w) for (_, w), *several in zip(own, *kinds, strict=True)]
        found = _noise(observed, own, output, simulated, columns)
        for (test, _), w, one in zip(own, found, columns, strict=True):
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
        taken = np.split(leverage, np.cumsum([len(one) for one in rows])[:-1])
        records = [
            _with_noise(w, residual - one @ coefficients[:, None], signal, residual, share)
            for w, residual, one, signal, share in zip(records, residuals, columns, signals, taken, strict=True)
        ]
    if not _decaying(observed, own):
        return records
    rests = zip(records, _unpredicted(own, residuals, columns), signals, strict=True)
    beyond = [_with_noise_beyond(w, rest, signal) for w, rest, signal in rests]
    moving = [_moving(w, signal) for w, signal in zip(records, signals, strict=True)]
    return beyond if _misfit(records, beyond, moving) else records


def _with_noise(
    w: Whitening, rest: FloatArray, signal: FloatArray, whole: FloatArray | None = None, taken: FloatArray | None = None
) -> Whitening:
    r"""The whitening with the noise of a signal (samples, 1): the rest of a ``whole`` one that a fit has left.

    Of its rows the fit has absorbed a share :math:`\tau` (rows,): noise leaves :math:`1 - \tau` of its power, what a
    wrong model leaves it does not; but noise is no more than the whole holds. Of noise, the smaller of the two is
    expected to have :math:`1 - \sqrt\tau / 2` of its power: both are chi-square, with a correlation of
    :math:`1 - \tau`.
    """
    used = slice(w.start, w.start + w.count)
    time = np.asarray(w.step * np.arange(w.count), dtype=np.float64)
    share: FloatArray | float = 0.0
    if whole is not None and taken is not None:
        parts = np.bincount(w.line_of_row, minlength=len(w.frequencies))
        absorbed = np.bincount(w.line_of_row, taken, len(parts)) / np.maximum(parts, 1)
        left, held = (np.abs(np.fft.rfft(one[used, 0])) ** 2 for one in (rest, whole))
        kept = np.clip(1 - absorbed, _LEAST_KEPT, 1.0)
        power = np.minimum(left / kept, held) / (1 - np.sqrt(1 - kept) / 2)
        share = 1 - np.maximum(left, _LEAST_KEPT**2 * held) / np.maximum(power, np.finfo(float).tiny)
    process = noise_process(rest[used, 0], signal[used], time, None, without_lines=True, taken=share)
    return replace(w, process=process)


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
        evidence -= 2 * float(fisher.logsf(ratio, 2 * int(lines.sum()), freedom))
    return bool(chi2.sf(evidence, 2 * len(records)) < _MISFIT)


def _decaying(observed: WhitenedData, own: Sequence[tuple[int, Whitening]]) -> bool:
    """Whether all records are free decays."""
    problem = observed.problem
    return all(undriven(problem.model, problem.measurements[test].experiment) for test, _ in own)


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


def _functions(
    observed: WhitenedData, own: Sequence[tuple[int, Whitening]], output: int, simulated: Sequence[FloatArray]
) -> Iterator[FloatArray]:
    """Functions of past inputs and of the model's response to them, (samples, q) per record, on the same scales."""
    problem = observed.problem
    experiments = [problem.measurements[test].experiment for test, _ in own]
    measured = [one.name for one in problem.model.inputs if all(one.name in each.inputs for each in experiments)]
    groups = [[each.inputs[name] for each in experiments] for name in measured]
    groups.append([simulated[test][:, output] for test, _ in own])
    longest = _LONGEST * min(w.count * w.step for _, w in own)
    lags = np.concatenate([[0.0], np.geomspace(min(w.step for _, w in own), longest, _LAGS - 1)])
    scaled = [standard for group in groups if (standard := _standardised(group, own)) is not None]
    decays = _decaying(observed, own)
    for place, (test, w) in enumerate(own):
        order = 2 * place / max(len(own) - 1, 1) - 1
        found = [np.empty((len(simulated[test]), 0))]  # constant inputs predict nothing
        found += [_of_signal(signals[place], w, lags, order) for signals in scaled]
        found += [_slipping(signals[place], w, order) for signals in scaled if decays]
        yield np.concatenate(found, axis=1)


def _turning(observed: WhitenedData, own: Sequence[tuple[int, Whitening]]) -> list[FloatArray]:
    """Cosine and sine of what rotates, (samples, q) per record: its angle is another one in each."""
    found = []
    for test, w in own:
        measurement = observed.problem.measurements[test]
        rates = list(rotational_orders(measurement).values())
        phase = 2 * np.pi * w.step * np.outer(np.arange(len(measurement.time)), rates)
        found.append(np.concatenate([np.cos(phase), np.sin(phase)], axis=1))
    return _each_alone(found)


def _halved(observed: WhitenedData, own: Sequence[tuple[int, Whitening]]) -> list[FloatArray]:
    r"""What answers at half the input's frequency, (samples, q) per record: a power of the input never does.

    Of the input's analytic signal :math:`a e^{i \phi}` cosine and sine of :math:`\phi / 2` times a, and a gain that
    changes over the record. Which of two periods such a motion follows is another one in each.
    """
    problem, found = observed.problem, []
    for test, w in own:
        measurement = problem.measurements[test]
        driven = not undriven(problem.model, measurement.experiment)
        values = np.asarray(measurement.channel(exciting_channel(problem.model, measurement))) * driven
        analytic = np.fft.ifft(2 * np.fft.rfft(values - values.mean()), len(values))
        half = np.abs(analytic) * np.exp(0.5j * np.unwrap(np.angle(analytic)))
        alone = np.stack([half.real, half.imag], axis=1)
        found.append(np.concatenate([alone, alone * _elapsed(w, len(half))[:, None]], axis=1))
    return _each_alone(found)


def _each_alone(blocks: Sequence[FloatArray]) -> list[FloatArray]:
    """Columns (samples, q) per record with a coefficient of their own in each: zeros stand in those of the others."""
    ends = np.cumsum([block.shape[1] for block in blocks])
    found = [np.zeros((len(block), ends[-1])) for block in blocks]
    for wide, block, end in zip(found, blocks, ends, strict=True):
        wide[:, end - block.shape[1] : end] = block
    return found


def _elapsed(w: Whitening, count: int) -> FloatArray:
    """Time of every sample: -1 at the first one used, 1 at the last."""
    return np.asarray(np.clip(2 * (np.arange(count) - w.start) / max(w.count - 1, 1) - 1, -1.0, 1.0))


def _standardised(signals: Sequence[FloatArray], own: Sequence[tuple[int, Whitening]]) -> list[FloatArray] | None:
    """A signal of all records, of mean 0 and variance 1; None if it is constant."""
    used = np.concatenate([one[w.start : w.start + w.count] for one, (_, w) in zip(signals, own, strict=True)])
    sd = float(used.std())
    return [(one - used.mean()) / sd for one in signals] if sd > 1e-12 * np.abs(used).max() else None


def _rate(signal: FloatArray) -> FloatArray:
    """Change from sample to sample, with a standard deviation of 1."""
    rate = np.gradient(signal)
    return np.asarray(rate / max(float(rate.std()), np.finfo(float).tiny))


def _slipping(signal: FloatArray, w: Whitening, order: float) -> FloatArray:
    """The signal and its rate, slowly modulated: a free decay of another frequency slips against it by whole turns."""
    number = np.arange(len(signal))
    angle = np.pi * np.outer((number - w.start) / max(w.count - 1, 1), np.arange(1, _SLIPS + 1))
    slow = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    columns = np.concatenate([one[:, None] * slow for one in (signal, _rate(signal))], axis=1)
    return np.concatenate([columns, order * columns], axis=1)


def _of_signal(signal: FloatArray, w: Whitening, lags: FloatArray, order: float) -> FloatArray:
    """Powers at every lag, functions of the rate, and gains that change over the record and from one to the next."""
    number = np.arange(len(signal))
    past: NDArray[np.intp] = np.maximum(number[:, None] - np.round(lags / w.step).astype(np.intp), 0)
    rate = _rate(signal)
    time = _elapsed(w, len(signal))
    columns = [signal[past] ** power for power in _POWERS]
    columns.append(np.stack([rate, np.abs(rate), rate * np.abs(rate), np.sign(rate)], axis=1))
    columns.append(np.stack([signal * time, signal * time**2, signal * order], axis=1))
    return np.concatenate(columns, axis=1)
