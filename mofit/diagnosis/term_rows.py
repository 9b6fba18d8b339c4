"""What terms would add to the outputs of a fitted model, to first order, without a simulation of each of them.

A term is a signal along the fitted motion, and the linearised model passes it on. So hundreds of terms cost little
more than one, and nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.inner_signals import InnerSignals, Target, stacked
from mofit.diagnosis.linear_response import at_samples, phi_functions
from mofit.diagnosis.terms import Term, block


@dataclass(frozen=True)
class Columns:
    """Terms on a quantity, and their whitened rows (m, K)."""

    target: Target
    terms: tuple[Term, ...]
    rows: FloatArray


def term_columns(signals: InnerSignals, targets: Sequence[Target], terms: Sequence[Term]) -> Iterator[Columns]:
    """The rows that terms per unit of their coefficients add to the fitted model, on each of some quantities."""
    observed = signals.fitted.hypothesis.observed
    with np.errstate(all="ignore"):  # what diverges is no term
        added = term_signals(signals, terms)
        responses = signals.responses([target.name for target in targets])
        for k, target in enumerate(targets):
            own = [i for i, term in enumerate(terms) if term.acts_on(target)]
            outputs = [
                response.of(k, each[:, own])[experiment.lead :]
                for response, each, experiment in zip(responses, added, signals.experiments, strict=True)
            ]
            yield Columns(target, tuple(terms[i] for i in own), observed.whitened(outputs))


def term_signals(signals: InnerSignals, terms: Sequence[Term]) -> list[FloatArray]:
    """Terms per unit of their coefficients along the fitted motion: (samples, K) per test."""
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
    value = ca.Function("value", [inputs, state], [values])
    found = []
    for own, experiment in zip(signals.signals, signals.experiments, strict=True):
        known = stacked(own, effect.signals, experiment.samples)
        memory = _memories(drive, known, experiment.step) if states else np.empty((len(known), 0))
        found.append(at_samples(value, known, memory)[0][..., 0])
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
