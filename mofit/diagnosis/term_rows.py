"""What terms would add to the outputs of a fitted model, to first order, without a simulation of each of them.

A term is a signal along the fitted motion, and the linearised model passes it on. So hundreds of terms cost little
more than one, and nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.inner_signals import InnerSignals, Target, stacked
from mofit.diagnosis.integration import stable
from mofit.diagnosis.linear_response import LinearResponse, at_samples, phi_functions
from mofit.diagnosis.terms import Term, block


@dataclass(frozen=True)
class Linearisation:
    """What terms stand beside, to first order: whitened rows of the tests (m), then those of prior and box (p).

    Parameters
    ----------
    residual
        What is left without the terms, (m + p,).
    slopes
        Derivatives of the simulated rows by the f parameters that are free, (m + p, f).
    free
        Which of a fit's parameters these are, (d,).
    """

    residual: FloatArray
    slopes: FloatArray
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, fitted: Fitted) -> Linearisation:
        """A fit as it is."""
        return cls(fitted.residual, -fitted.jacobian[:, fitted.free], fitted.free)


@dataclass(frozen=True)
class Reading:
    """Terms on a quantity are read along a motion; every test responds to that quantity, by its index."""

    target: Target
    motion: InnerSignals
    responses: Sequence[LinearResponse]
    quantity: int
    beside: Linearisation


@dataclass(frozen=True)
class Columns:
    """Terms on a quantity, and their whitened rows (m, K)."""

    target: Target
    terms: tuple[Term, ...]
    rows: FloatArray
    beside: Linearisation

    @property
    def usable(self) -> list[int]:
        """Which terms do something, and do not diverge."""
        return [k for k, rows in enumerate(self.rows.T) if stable(rows) and np.any(rows)]


def term_columns(readings: Sequence[Reading], terms: Sequence[Term]) -> Iterator[Columns]:
    """The rows that terms per unit of their coefficients add to the fitted model, on each of some quantities."""
    last, added = None, list[FloatArray]()
    for one in readings:
        if one.motion is not last:
            last, added = one.motion, term_signals(one.motion, terms)
        yield columns_on(one, terms, added)


def columns_on(reading: Reading, terms: Sequence[Term], added: Sequence[FloatArray]) -> Columns:
    """The same on one quantity; ``added`` are the `term_signals` along its motion."""
    own = [i for i, term in enumerate(terms) if term.acts_on(reading.target)]
    with np.errstate(all="ignore"):  # what diverges is no term
        rows = whitened_response(reading, [each[:, own] for each in added])
    return Columns(reading.target, tuple(terms[i] for i in own), rows, reading.beside)


def whitened_response(reading: Reading, added: Sequence[FloatArray]) -> FloatArray:
    """Whitened rows (m, K) of what signals (samples, K) per test do that are added to the quantity."""
    tests = zip(reading.responses, added, reading.motion.experiments, strict=True)
    outputs = [response.of(reading.quantity, each)[experiment.lead :] for response, each, experiment in tests]
    return reading.motion.fitted.hypothesis.observed.whitened(outputs)


@dataclass(frozen=True)
class TermFunctions:
    """What `Term`s compute of ``signals``, by name, with so many ``states`` of their memories."""

    signals: tuple[str, ...]
    states: int
    drive: ca.Function
    value: ca.Function


@lru_cache(maxsize=4)
def term_functions(terms: tuple[Term, ...]) -> TermFunctions:
    """Terms per unit of their coefficients, as functions of signals."""
    effect = block(Target("", "", 1.0), terms)
    given = [ca.SX.sym(name) for name in effect.signals]
    states = [ca.SX.sym(name) for name in (one.state for one in effect.stateful)]
    fixed = {placed.size: 1.0 for placed in effect.terms} | {
        placed.shape: placed.term.point for placed in effect.terms if placed.term.point is not None
    }
    symbols = {one.name(): one for one in (*given, *states)}
    values, drives, starts = (ca.vertcat(*one) for one in effect.evaluated(SimpleNamespace(**fixed, **symbols)))
    inputs, state = ca.vertcat(*given), ca.vertcat(*states)
    # every memory is linear in its own state
    drive = ca.Function("drive", [inputs, state], [drives, starts])
    return TermFunctions(effect.signals, len(states), drive, ca.Function("value", [inputs, state], [values]))


def term_signals(signals: InnerSignals, terms: Sequence[Term]) -> list[FloatArray]:
    """Terms per unit of their coefficients along the fitted motion: (samples, K) per test."""
    functions, found = term_functions(tuple(terms)), []
    with np.errstate(all="ignore"):  # what diverges is no term
        for own, experiment in zip(signals.signals, signals.experiments, strict=True):
            known = stacked(own, functions.signals, experiment.samples)
            memory = np.empty((len(known), 0))
            if functions.states:
                memory = _memories(functions.drive, known, experiment.step)
            found.append(at_samples(functions.value, known, memory)[0][..., 0])
    return found


def _memories(drive: ca.Function, known: FloatArray, step: float) -> FloatArray:
    r"""States z (n, S) of :math:`\dot z = a(t) z + b(t)` along signals (n, k).

    From sample to sample a is its mean, and b a straight line.
    """
    size = drive.size1_out(0)
    offset, starts = (one[..., 0] for one in at_samples(drive, known, np.zeros(size)))
    rate = at_samples(drive, known, np.ones(size))[0][..., 0] - offset
    means = 0.5 * step * (rate[:-1] + rate[1:])
    whole, first, second = (one.reshape(means.shape) for one in phi_functions(means.reshape(-1, 1, 1)))
    pushed = step * ((first - second) * offset[:-1] + second * offset[1:])
    found = np.empty_like(offset)
    found[0] = starts[0]
    for k, (advance, push) in enumerate(zip(whole, pushed, strict=True)):
        found[k + 1] = advance * found[k] + push
    return found
