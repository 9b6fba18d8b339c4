"""Functions of past inputs and of the model's response to them, and of what rotates: what may predict a residual."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.spectral_classes import rotational_orders
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.diagnosis.whitening import Whitening
from mofit.simulation.requirements import exciting_channel, undriven

#: Powers of a signal at every lag, and the number of lags.
_POWERS, _LAGS = (1, 2, 3), 10
#: Longest lag as a share of the shortest record: nine tenths of its samples have their past.
_LONGEST = 0.1
#: Half turns by which the response of a free decay may slip in a record.
_SLIPS = 6


def predictors(
    observed: WhitenedData, own: Sequence[tuple[int, Whitening]], output: int, simulated: Sequence[FloatArray]
) -> list[FloatArray]:
    """All of them, (samples, q) per record."""
    kinds = (_functions(observed, own, output, simulated), _turning(observed, own), _halved(observed, own))
    return [np.concatenate(several, axis=1) for several in zip(*kinds, strict=True)]


def decaying(observed: WhitenedData, own: Sequence[tuple[int, Whitening]]) -> bool:
    """Whether all records are free decays."""
    problem = observed.problem
    return all(undriven(problem.model, problem.measurements[test].experiment) for test, _ in own)


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
    decays = decaying(observed, own)
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
