"""A model of a run linearised at rest under a constant input: transfer function and step response, for many draws."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.models import BlackBoxSystem, Model, build_system

#: halvings of the bracket of a rise time: to 1e-12 of the slowest time constant
_HALVINGS = 45
#: time constants of the slowest mode within which a rise time is looked for
_LONGEST = 40.0
#: in place of zero, where forces may have a kink: over combined slip the slope depends on the direction
_BESIDE = 1e-6
#: points at which a step response is looked at within the fastest mode, and again beyond it
_LOOKS = 400


@dataclass(frozen=True)
class LinearResponse:
    r"""Linear systems :math:`\dot x = A x + b u, \; y = c x + d u` of N draws; input and output are deviations.

    Parameters
    ----------
    a, b, c, d
        Shapes (N, n, n), (N, n), (N, n) and (N,).
    """

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray

    def transfer(self, omega: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
        r""":math:`H = c \, (j \omega - A)^{-1} b + d` at angular frequencies (k,) [rad/s], shape (N, k)."""
        eye = np.eye(self.a.shape[1])
        shifted = 1j * omega[None, :, None, None] * eye - self.a[:, None]
        inner = np.linalg.solve(shifted, np.broadcast_to(self.b[:, None, :, None], (*shifted.shape[:3], 1)))[..., 0]
        return np.asarray((self.c[:, None] * inner).sum(axis=-1) + self.d[:, None])

    def gain(self) -> FloatArray:
        r"""Stationary gain :math:`H(0)`, shape (N,)."""
        return self.d - (self.c * self._solved(self.b)).sum(axis=-1)

    def lag(self) -> FloatArray:
        r"""Delay of slow inputs [s], shape (N,): :math:`-\mathrm{d} \arg H / \mathrm{d} \omega` at 0.

        :math:`c A^{-2} b / H(0)`, as :math:`H'(0) = -c A^{-2} b` is real.
        """
        return (self.c * self._solved(self._solved(self.b))).sum(axis=-1) / self.gain()

    def rise_time(self, share: float) -> FloatArray:
        """Time [s] at which a step response first reaches a share of its final value, shape (N,); 0 if it jumps there.

        Infinite where it does not settle.
        """
        poles, vectors = np.linalg.eig(self.a)
        weights = (self.c[:, None] @ vectors)[:, 0] * np.linalg.solve(vectors, self.b[..., None] + 0j)[..., 0] / poles
        final = self.gain()

        def reached(time: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
            there = final[:, None] + (weights[:, None] * np.exp(poles[:, None] * time[..., None])).sum(axis=-1).real
            return np.asarray(there / final[:, None] >= share)

        settles = np.all(poles.real < 0, axis=1)
        slowest = 1 / np.where(settles, np.min(-poles.real, axis=1), 1.0)
        fastest = 1 / np.max(np.abs(poles), axis=1)
        # evenly within the fastest mode, then by powers up to many times the slowest
        even, powers = np.linspace(0, 1, _LOOKS), np.linspace(0, 1, _LOOKS + 1)[1:]
        spread = (_LONGEST * slowest / fastest)[:, None]
        looks = fastest[:, None] * np.concatenate([np.tile(even, (len(fastest), 1)), spread**powers], axis=1)
        seen = reached(looks)
        first = np.argmax(seen, axis=1)
        rows = np.arange(len(first))
        low, high = looks[rows, np.maximum(first - 1, 0)], looks[rows, first]
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            past = reached(middle[:, None])[:, 0]
            low, high = np.where(past, low, middle), np.where(past, middle, high)
        return np.where(settles & seen.any(axis=1), high, np.inf)

    def _solved(self, right: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.solve(self.a, right[..., None])[..., 0])


class Linearisation:
    """A model at its resting states, from one input to one output.

    Raises
    ------
    InputError
        If it has no state, or is a simulator without equations.
    """

    def __init__(self, model: Model, source: str, output: str) -> None:
        system = build_system(model)
        where = f"model '{model.name}'"
        if isinstance(system, BlackBoxSystem):
            raise InputError.of(where, "it is a simulator without equations", "Take a run of a model with equations")
        if not system.states:
            hint = "Take a run of a tyre with a carcass, maxwell_tyre say"
            raise InputError.of(where, "it has no state: its output follows the input at once", hint)
        self.place, self.inputs, self.conditions = system.inputs.index(source), system.inputs, system.conditions
        self.parameters = system.parameters
        x, u, p, c = system.rhs.sx_in()
        rate, y = system.rhs(x, u, p, c), system.out(x, u, p, c)[system.outputs.index(output)]
        own = u[self.place]
        blocks = [ca.jacobian(rate, x), ca.jacobian(rate, own), ca.jacobian(y, x), ca.jacobian(y, own)]
        at_rest = ca.Function("blocks", [x, u, p, c], blocks)
        u_, p_, c_ = (ca.SX.sym(name, part.numel()) for name, part in (("u", u), ("p", p), ("c", c)))
        self._blocks = ca.Function("at_rest", [u_, p_, c_], at_rest.call([system.initial(u_, p_, c_), u_, p_, c_]))

    def at(self, value: float, draws: FloatArray, conditions: dict[str, float]) -> LinearResponse:
        """The linear systems of parameter draws (N, p) around rest at a value of the input; other inputs are 0."""
        count = len(draws)
        u = np.zeros((len(self.inputs), count))
        u[self.place] = value or _BESIDE
        c = np.tile([[conditions[name]] for name in self.conditions], (1, count))
        a, b, c_, d = (block.full() for block in self._blocks.map(count)(u, draws.T, c))
        states = len(b)
        return LinearResponse(a.reshape(states, count, states).swapaxes(0, 1), b.T, c_.reshape(count, states), d[0])
