"""FROLS: the terms of a polynomial NARX or NFIR model of the residual, by orthogonal least squares."""

from __future__ import annotations

import warnings

import numpy as np
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

from diagnosis_peers_cases.answer import Answer, Choice, chosen
from diagnosis_peers_cases.records import Records, distinct
from diagnosis_peers_cases.terms import DAMPING, FAMILIES, LAG, MOTION, RELAXATION, STIFFNESS
from mofit._typing import FloatArray

#: lags of inputs in samples, and of the residual itself
LAGS, FEW_LAGS, OWN_LAGS, MOST_TERMS = (1, 2, 5, 10, 20), (1, 5), (1, 2), (3, 10)
#: signals that enter with all lags, as far as they differ
LINEAR = ("x", "v", "s")
#: further inputs of a model that is linear in them
SHAPES = ("|x|", "|x|x", "x³", "|v|v", "v³", "sign(v)")
#: residuals that grow beyond this, in units of their root mean square, run away
RUNAWAY = 1e3


def frols(records: Records, held: Records) -> Answer:
    """Own lags, degree and most terms by tests left out; the terms by the Bayes criterion."""
    fits = [_Fit(degree, own, most) for most in MOST_TERMS for own in (False, True) for degree in (1, 3)]
    number, told = chosen(records, [Choice(k + 1, fit.predict) for k, fit in enumerate(fits)])
    if number is None:
        return Answer(False, told=told)
    fit = fits[number]
    parts = fit.terms(records)
    sizes: dict[str, float] = {}
    for factors, size in parts.items():
        if family := meaning(factors):
            sizes[family] = sizes.get(family, 0.0) + size
    own = (RELAXATION,) * any(name == "e" for factors in parts for name, _ in factors)
    found = tuple(sorted(sizes, key=lambda family: -sizes[family])) or own
    terms = tuple(" ".join(f"{name}[{lag}]" for name, lag in factors) or "1" for factors in parts)
    return Answer(True, terms, found, ", ".join(terms), told, fit.predict(records, held))


Factors = tuple[tuple[str, int], ...]


def meaning(factors: Factors) -> str:
    """Family of a product of signals, each with its lag in samples."""
    names = [name for name, _ in factors]
    if names in (["x"], ["v"], ["s"]):
        return LAG if factors[0][1] else ""
    if len(names) == 1:
        return FAMILIES.get(names[0], "")
    if set(names) == {"x"}:
        return STIFFNESS
    return DAMPING if set(names) <= {"x", "v"} else ""


class _Fit:
    """One structure that FROLS selects from: inputs and their lags, with or without own lags; degree, most terms."""

    def __init__(self, degree: int, own: bool, most: int) -> None:
        self.degree, self.own, self.most = degree, own, most

    def terms(self, records: Records) -> dict[Factors, float]:
        """Selected terms with their error reduction ratios, the largest first."""
        model, names = self._fitted(records)
        pairs = zip(model.final_model, model.err[: len(model.final_model)], strict=True)
        found = {tuple(sorted(_factor(int(code), names) for code in codes if code)): float(err) for codes, err in pairs}
        return dict(sorted(found.items(), key=lambda pair: -pair[1]))

    def predict(self, records: Records, others: Records) -> FloatArray:
        """Residual of other tests, simulated freely from rest."""
        model, names = self._fitted(records)
        rest = np.zeros((others.output.shape[1], 1))
        with np.errstate(all="ignore"):
            rows = [model.predict(X=one, y=rest)[:, 0] for one in self._inputs(others, names)]
        return np.asarray(np.clip(np.nan_to_num(np.stack(rows), nan=RUNAWAY), -RUNAWAY, RUNAWAY))

    def _fitted(self, records: Records) -> tuple[FROLS, list[str]]:
        """The tests follow one another; the few rows across their borders are a part in a hundred."""
        names = self._names(records)
        lags = [list(LAGS if name in LINEAR and self.degree == 1 else FEW_LAGS) for name in names]
        model = FROLS(
            ylag=list(OWN_LAGS) if self.own else 1,
            xlag=lags,
            order_selection=True,
            n_info_values=self.most,
            info_criteria="bic",
            estimator=LeastSquares(),
            basis_function=Polynomial(degree=self.degree),
            model_type="NARMAX" if self.own else "NFIR",
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # fewer terms than asked for may have the least criterion
            model.fit(X=np.concatenate(self._inputs(records, names)), y=records.residual.reshape(-1, 1))
        return model, names

    def _names(self, records: Records) -> list[str]:
        every = {**{name: records.signals[name] for name in LINEAR}}
        if self.degree == 1:
            every |= {name: MOTION[name][0](records.deflection, records.rate) for name in SHAPES}
        return distinct(every)

    def _inputs(self, records: Records, names: list[str]) -> list[FloatArray]:
        """Per test; one sample early, as the least lag of the library is one sample."""
        every = {name: MOTION[name][0](records.deflection, records.rate) for name in SHAPES} | records.signals
        stacked = np.stack([every[name] for name in names], axis=2)
        return list(np.concatenate([stacked[:, 1:], stacked[:, -1:]], axis=1))


def _factor(code: int, names: list[str]) -> tuple[str, int]:
    """Signal and lag in samples of a regressor's code: 1000 times the signal's number plus the lag."""
    signal, lag = divmod(code, 1000)
    return ("e", lag) if signal == 1 else (names[signal - 2], lag - 1)
