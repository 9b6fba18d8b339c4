"""What a proposed term adds, over the signal that it depends on, with a band: what its page draws."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.inner_signals import inner_signals
from mofit.diagnosis.proposal import Proposal
from mofit.models import Symbols

#: Draws of the estimates for the band: 5 % quantiles within 1 % of probability; points of a curve; tests drawn.
_DRAWS, _POINTS, _MOST_TESTS = 400, 121, 6


def term_curves(proposal: Proposal, seed: int = 0) -> dict[str, Any]:
    """Curves of the term over its first signal: one where it depends on nothing else, otherwise one per test.

    ``low`` and ``high`` are the band of 90 % over the estimates of the term; its states are those of the estimates.
    """
    effect, fitted = proposal.effect, proposal.fitted
    main = effect.terms[0].term.x
    states = [state.name for state in effect.states]
    signals = list(dict.fromkeys([*effect.signals, *states]))
    names = [parameter.name for parameter in effect.parameters]
    symbols = {name: ca.SX.sym(name) for name in (*names, *signals)}
    added, _, _ = effect.evaluated(Symbols(symbols))
    term = ca.Function("term", [ca.vertcat(*(symbols[n] for n in names)), *(symbols[n] for n in signals)], [sum(added)])
    draws = _draws(proposal, names, seed)

    def line(test: str, columns: dict[str, FloatArray]) -> dict[str, Any]:
        arguments = [columns[name][None] for name in signals]
        values = np.array([np.array(term(point, *arguments))[0] for point in draws])
        low, high = np.quantile(values[1:], (0.05, 0.95), axis=0)
        return {"test": test, "x": columns[main.name], "y": values[0], "low": low, "high": high}

    if signals == [main.name]:
        grid = main.scale * np.linspace(main.low, main.high, _POINTS)
        lines = [line("", {main.name: grid})]
    else:
        inner, observed = inner_signals(fitted, rates=True), fitted.hypothesis.observed
        lines = []
        whitenings = {test: w for test, _, w in reversed(observed.records)}
        for k, name in enumerate(observed.problem.tests[:_MOST_TESTS]):
            w, used = whitenings[k], inner.used[k]
            length = round(w.period / w.step) + 1 if w.periods else used.stop - used.start
            here = slice(max(used.stop - length, used.start), used.stop, max(length // (4 * _POINTS), 1))
            lines.append(line(name, {signal: inner.signals[k][signal][here] for signal in signals}))
    return {"variable": main.name, "variable_unit": main.unit, "curves": lines}


def _draws(proposal: Proposal, names: list[str], seed: int) -> FloatArray:
    """Values of the effect's parameters: the estimates, then draws around them; (1 + draws, parameters)."""
    fitted, random = proposal.fitted, np.random.default_rng(seed)
    space, free = fitted.hypothesis.space, fitted.free
    points = np.repeat(fitted.minimum.point[None], _DRAWS + 1, axis=0)
    root = fitted.covariance_root
    points[1:, free] += random.standard_normal((_DRAWS, len(root))) @ root.T
    values = space.from_unit(np.clip(points, 0.0, 1.0))
    return np.asarray(values[:, [space.index(name) for name in names]])
