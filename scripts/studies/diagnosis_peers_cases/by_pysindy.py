"""SINDy: few terms of a library by sparse regression; as an addition to the output, or to the force."""

from __future__ import annotations

import warnings

import numpy as np
from pysindy import FROLS, STLSQ, BaseOptimizer
from sklearn.base import clone

from diagnosis_peers_cases.answer import Answer, Choice, chosen
from diagnosis_peers_cases.records import Library, Records, distinct, rms
from diagnosis_peers_cases.terms import families
from mofit._typing import FloatArray

#: least contribution of a term, relative to the residual, of thresholded least squares; most terms of a forward search
THRESHOLDS, COUNTS = (0.05, 0.1, 0.2, 0.3, 0.5), (1, 2, 3, 4, 6)
RIDGE = 1e-4


def sindy(records: Records, held: Records) -> Answer:
    """Form, optimiser and threshold by tests left out; the terms of the fit to all."""
    forms = (Records.static, Records.driven) if records.forced.size else (Records.static,)
    fits = [
        fit
        for library in forms
        for optimiser in _optimisers(records.residual.size)
        if (fit := _Fit(library, distinct(library(records)), optimiser)).terms(records)
    ]
    number, told = chosen(records, [Choice(len(fit.terms(records)), fit.predict) for fit in fits])
    if number is None:
        return Answer(False, told=told)
    fit = fits[number]
    parts = fit.terms(records)
    terms = sorted(parts, key=lambda name: -parts[name])
    form = "force" if fit.library is Records.driven else "output"
    where = f"in the {form}: {', '.join(terms)}"
    return Answer(True, tuple(terms), tuple(families(parts)), where, told, fit.predict(records, held))


def _optimisers(rows: int) -> list[BaseOptimizer]:
    thresholded = [STLSQ(threshold=threshold, alpha=RIDGE * rows) for threshold in THRESHOLDS]
    return [*thresholded, *(FROLS(max_iter=count, alpha=RIDGE) for count in COUNTS)]


class _Fit:
    """A library, its columns that differ, and an optimiser."""

    def __init__(self, library: Library, names: list[str], optimiser: BaseOptimizer) -> None:
        self.library, self.names, self.optimiser = library, names, optimiser

    def terms(self, records: Records) -> dict[str, float]:
        """Selected terms with their contributions beside what the parameters absorb."""
        columns, residual = self._beside(records)
        scale = np.array([rms(column) for column in columns.T])
        found = clone(self.optimiser)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that no term is left
            found.fit(columns / scale, residual[:, None] / rms(residual))
        forward = isinstance(found, FROLS)  # the k-th of its steps has k terms
        sizes = found.history_[min(found.max_iter, len(found.history_) - 1)][0] if forward else found.coef_[0]
        pairs = zip(self.names, np.abs(sizes), strict=True)
        return {name: float(size) for name, size in pairs if size}

    def predict(self, records: Records, others: Records) -> FloatArray:
        """Residual of other tests: the terms, with the parameters' change to first order."""
        terms = list(self.terms(records))
        if not terms:
            return np.zeros_like(others.output)
        known, new = (np.hstack([_parameters(one), self._columns(one, terms)]) for one in (records, others))
        scale = np.array([rms(column) for column in known.T])
        sizes = np.linalg.lstsq(known / scale, records.residual.ravel(), rcond=1e-6)[0]
        return np.asarray((new / scale @ sizes).reshape(others.output.shape))

    def _beside(self, records: Records) -> tuple[FloatArray, FloatArray]:
        """Columns and residual less what the fitted parameters explain of them (Frisch and Waugh)."""
        basis = np.linalg.qr(_parameters(records))[0]
        columns, residual = self._columns(records, self.names), records.residual.ravel()
        return columns - basis @ (basis.T @ columns), residual - basis @ (basis.T @ residual)

    def _columns(self, records: Records, names: list[str]) -> FloatArray:
        library = self.library(records)
        return np.stack([library[name].ravel() for name in names], axis=1)


def _parameters(records: Records) -> FloatArray:
    return records.parameters.reshape(len(records.parameters), -1).T
