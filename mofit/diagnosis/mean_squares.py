"""Mean squares of whitened rows as signals of the tests, relative to the range of the output."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.whitened_data import WhitenedData


def record_signals(
    observed: WhitenedData, rows: FloatArray, kept: NDArray[np.bool_], records: Iterable[int] | None = None
) -> Iterator[FloatArray]:
    """Columns of whitened rows (m, k) as signals (n, k) of all records or some, those rows that are kept.

    Relative to the range of the output and the root of n: sums of squares are relative mean squares.
    """
    for i in range(len(observed.records)) if records is None else records:
        w = observed.records[i][2]
        here = observed.record == i
        columns = np.where(kept[here, None], rows[here], 0.0).T
        yield w.signal(columns).T / (observed.ranges[i] * np.sqrt(w.count))


def mean_squares(observed: WhitenedData, rows: FloatArray, kept: NDArray[np.bool_]) -> FloatArray:
    """Relative mean square of columns of whitened rows (m, k), summed over all records, (k,)."""
    return np.sum([np.sum(signals**2, axis=0) for signals in record_signals(observed, rows, kept)], axis=0)


def noise_squares(observed: WhitenedData, kept: NDArray[np.bool_]) -> FloatArray:
    """Relative mean square of the visible noise of every row that is kept, (m,)."""
    share = kept * observed.noise_share * observed.visible
    return np.asarray(share * observed.variance / observed.ranges[observed.record] ** 2)


def products_of_tests(observed: WhitenedData, columns: FloatArray, tests: Sequence[int]) -> FloatArray:
    """Relative mean products of columns of whitened rows (m, k) in some tests, (tests, k, k)."""
    found = np.zeros((len(tests), columns.shape[1], columns.shape[1]))
    places = {test: place for place, test in enumerate(tests)}
    records = [i for i, (test, _, _) in enumerate(observed.records) if test in places]
    for i, signals in zip(records, record_signals(observed, columns, observed.explainable, records), strict=True):
        found[places[observed.records[i][0]]] += signals.T @ signals
    return found
