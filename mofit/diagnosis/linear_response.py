r"""What signals that are added to quantities change in a fitted model's outputs: its motion, linearised.

.. math:: \dot{\delta x} = A(t)\, \delta x + b(t)\, w(t), \qquad \delta y = C(t)\, \delta x + d(t)\, w(t)

with the derivatives A, b, C, d along the fitted motion and an added signal w. Between two samples A is its mean and
:math:`b w` a straight line; the step of that is exact, however stiff.

References
----------
Hochbruck, Ostermann: Exponential integrators. Acta Numerica 19 (2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.models import System

#: Terms of the Taylor series at a norm of at most 1/2: their rest is below 1e-12.
_TAYLOR = 10
#: Most doublings from there.
_DOUBLINGS = 60
#: Most numbers in the states that are worked on together: 800 kB, which stay in the processor's cache.
_NUMBERS = 1e5


@dataclass(frozen=True)
class Motion:
    """A simulated test: states (n, x) and inputs (n, u) at every sample, parameters (p,) and conditions (c,)."""

    step: float
    states: FloatArray
    inputs: FloatArray
    parameters: FloatArray
    conditions: FloatArray


@dataclass(frozen=True)
class LinearResponse:
    """The linearised motion of a test.

    Parameters
    ----------
    states
        Names of the states.
    advance
        From sample to sample, (n - 1, x, x).
    here, there
        What of ``b w`` at the sample and at the next one arrives there, (n - 1, x, x) each.
    driven, seen, direct
        Derivatives b (n, x, q), C (n, y, x) and d (n, y, q), for q quantities.
    start
        Derivative of the initial state, (x, q).
    """

    states: tuple[str, ...]
    advance: FloatArray
    here: FloatArray
    there: FloatArray
    driven: FloatArray
    seen: FloatArray
    direct: FloatArray
    start: FloatArray

    def of(self, quantity: int, added: FloatArray) -> FloatArray:
        """Change of the outputs (n, y, K) by signals (n, K) that are added to a quantity, by its index."""
        found = self.direct[:, :, quantity, None] * added[:, None]
        if not self.start.size or not added.size:
            return found
        state = self.start[:, quantity, None] * added[0]
        found[0] += self.seen[0] @ state
        count = max(int(_NUMBERS / (len(state) * added.shape[1])), 1)
        for first in range(0, len(self.advance), count):
            steps = slice(first, min(first + count, len(self.advance)))
            ends = slice(steps.start + 1, steps.stop + 1)
            driven = self.driven[first : ends.stop, :, quantity, None]
            here, there = self.here[steps] @ driven[:-1], self.there[steps] @ driven[1:]
            pushed = here * added[steps, None] + there * added[ends, None]
            states = recursion(self.advance[steps], pushed, state)
            state = states[-1]
            found[ends] += self.seen[ends] @ states
        return found


def recursion(advance: FloatArray, pushed: FloatArray, start: FloatArray) -> FloatArray:
    r"""States :math:`s_k = A_k s_{k-1} + p_k`, (n, x, K), from A (n, x, x), p (n, x, K) and the start (x, K).

    The steps are cut into blocks that go on side by side, each from zero, with the product of its matrices; then each
    is told where it starts. So n steps take about two square roots of n passes.
    """
    count, size = len(advance), len(start)
    blocks = max(int(np.sqrt(count)), 1)
    length = -(-count // blocks)
    padding = ((0, blocks * length - count), (0, 0), (0, 0))
    whole = np.pad(advance, padding).reshape(blocks, length, size, size)
    states = np.pad(pushed, padding).reshape(blocks, length, *start.shape)
    for k in range(1, length):
        states[:, k] += whole[:, k] @ states[:, k - 1]
        whole[:, k] = whole[:, k] @ whole[:, k - 1]
    starts = np.empty((blocks, *start.shape))
    for block in range(blocks):
        starts[block] = start
        start = states[block, -1] + whole[block, -1] @ start
    states += whole @ starts[:, None]
    return states.reshape(-1, *start.shape)[:count]


class Linearised:
    """Derivatives of a system's rates, outputs and initial state by its states and by some of its parameters."""

    def __init__(self, system: System, parameters: Sequence[str]) -> None:
        self.states = tuple(system.states)
        groups = {"x": system.states, "u": system.inputs, "p": system.parameters, "c": system.conditions}
        x, u, p, c = (ca.SX.sym(name, len(group)) for name, group in groups.items())
        by = p[[system.parameters.index(name) for name in parameters]]
        wanted = [ca.jacobian(of(x, u, p, c), one) for of in (system.rhs, system.out) for one in (x, by)]
        self._slopes = ca.Function("slopes", [x, u, p, c], [ca.densify(one) for one in wanted])
        self._start = ca.Function("start", [u, p, c], [ca.densify(ca.jacobian(system.initial(u, p, c), by))])

    def along(self, motion: Motion) -> list[FloatArray]:
        """A (n, x, x), b (n, x, q), C (n, y, x) and d (n, y, q) at every sample."""
        return at_samples(self._slopes, motion.states, motion.inputs, motion.parameters, motion.conditions)

    def response(self, motion: Motion) -> LinearResponse:
        """The linearised motion, each of the parameters being what is added to a quantity."""
        rates, driven, seen, direct = self.along(motion)
        start = np.array(self._start(motion.inputs[0], motion.parameters, motion.conditions))
        step, means = motion.step, 0.5 * (rates[:-1] + rates[1:])
        whole, first, second = phi_functions(step * means)
        return LinearResponse(self.states, whole, step * (first - second), step * second, driven, seen, direct, start)


def at_samples(function: ca.Function, *arguments: FloatArray) -> list[FloatArray]:
    """Values (n, rows, columns) of a function of vectors; an argument is (n, size), or (size,) where it is constant."""
    count = len(arguments[0])
    # through buffers: CasADi's own matrices are converted element by element
    buffer, evaluate = _mapped(function, count).buffer()
    given = [np.ascontiguousarray(np.broadcast_to(one, (count, one.shape[-1])), dtype=float) for one in arguments]
    found = [np.zeros((count, *reversed(function.size_out(k)))) for k in range(function.n_out())]
    for k, one in enumerate(given):
        buffer.set_arg(k, one.data)  # type: ignore[call-arg]  # the stub asks for a size
    for k, one in enumerate(found):
        buffer.set_res(k, one.data)  # type: ignore[call-arg]
    evaluate()
    return [one.transpose(0, 2, 1) for one in found]


@lru_cache(maxsize=16)
def _mapped(function: ca.Function, count: int) -> ca.Function:
    """The function of so many samples at once, with dense results: tests are as long as one another."""
    symbols = [ca.SX.sym(f"i{k}", *function.size_in(k)) for k in range(function.n_in())]
    return ca.Function("dense", symbols, [ca.densify(one) for one in function.call(symbols)]).map(count)


def phi_functions(matrices: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Of matrices z (n, x, x): :math:`e^z`, :math:`\varphi_1 = (e^z - 1)/z` and :math:`\varphi_2 = (\varphi_1 - 1)/z`.

    By Taylor's series of the matrices halved often enough, doubled again.
    """
    norm = float(np.abs(matrices).sum(axis=-1).max(initial=0.0))
    halvings = min(max(int(np.ceil(np.log2(2 * norm))), 0), _DOUBLINGS) if 0 < norm < np.inf else 0
    small, unit = matrices / 2.0**halvings, np.eye(matrices.shape[-1])
    times = np.multiply if len(unit) == 1 else np.matmul  # the same, but far faster for numbers
    second = np.broadcast_to(unit / factorial(_TAYLOR + 2), matrices.shape)
    for order in reversed(range(_TAYLOR)):
        second = unit / factorial(order + 2) + times(small, second)
    first = unit + times(small, second)
    for _ in range(halvings):
        whole = unit + times(small, first)
        second = 0.25 * (times(first, first) + 2 * second)
        first = times(0.5 * (whole + unit), first)
        small = 2 * small
    return unit + times(small, first), first, second
