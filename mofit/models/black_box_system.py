"""A simulator between filters: what effects make of its inputs, and what they make of its outputs."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from hashlib import sha256

import casadi as ca

from mofit.errors import InputError
from mofit.models.black_box import Simulator
from mofit.models.vector_form import System
from mofit.parameters import ParameterSpace


@dataclass(frozen=True)
class BlackBoxSystem(System):
    """A `System` around a simulator.

    Its functions ``rhs``, ``out`` and ``initial`` take the outputs of the simulator as further inputs, behind those of
    the tests: they are the filter behind it. The filter before it is `before`.
    """

    box: Simulator
    seen: ca.Function
    """``(x, u, p, c)`` to inputs, parameters and conditions of the simulator, with all effects; one column."""
    space: ParameterSpace
    """All parameters, in ranges as the model has them."""

    def check(self) -> None:
        """Refuse effects that act inside the simulator.

        Raises
        ------
        InputError
            If an effect lets a parameter or a condition change within a test, or leads the output back to the input.
        """
        for part in ("constants", "before"):
            getattr(self, part)

    def hash(self) -> str:
        """Hash of simulator and effects."""
        text = super().hash() + self.seen.serialize() + self.box.fingerprint
        return sha256(text.encode()).hexdigest()[:16]

    @cached_property
    def behind(self) -> System:
        """The filter behind the simulator: inputs and simulated outputs in, outputs out."""
        inputs = (*self.inputs, *(f"simulated_{channel.name}" for channel in self.box.outputs))
        own = {field.name: getattr(self, field.name) for field in fields(System)}
        return System(**{**own, "inputs": inputs})

    @cached_property
    def before(self) -> System:
        """The filter before the simulator: inputs in, inputs of the simulator out, with the states that it needs."""
        x, u, p, c = self._symbols
        seen = self.seen(x, u, p, c)[: len(self.box.inputs)]
        slopes, starts = self.rhs(x, u, p, c), self.initial(u, p, c)
        kept = {k for k in range(x.numel()) if ca.depends_on(seen, x[k])}
        while more := {
            j for j in range(x.numel()) for k in kept - {j} if j not in kept and ca.depends_on(slopes[k], x[j])
        }:
            kept |= more
        chosen = sorted(kept)
        own = ca.vertcat(*(x[k] for k in chosen))
        groups, names = [ca.SX(own), u, p, c], ["x", "u", "p", "c"]
        derivatives = ca.SX(ca.vertcat(*(slopes[k] for k in chosen)))
        rest = ca.SX(ca.vertcat(*(starts[k] for k in chosen)))
        self._refuse_feedback(u, ca.vertcat(seen, derivatives))
        return System(
            states=tuple(self.states[k] for k in chosen),
            inputs=self.behind.inputs,
            parameters=self.parameters,
            conditions=self.conditions,
            outputs=tuple(channel.name for channel in self.box.inputs),
            rhs=ca.Function("rhs", groups, [derivatives], names, ["xdot"]),
            out=ca.Function("out", groups, [seen], names, ["y"]),
            initial=ca.Function("initial", groups[1:], [rest], names[1:], ["x0"]),
        )

    @cached_property
    def constants(self) -> ca.Function:
        """``(p, c)`` to parameters and conditions of the simulator, with effects.

        Raises
        ------
        InputError
            If an effect lets one change within a test.
        """
        x, u, p, c = self._symbols
        seen = self.seen(x, u, p, c)[len(self.box.inputs) :]
        names = [*(one.name for one in self.box.parameters), *(one.name for one in self.box.conditions)]
        for name, value in zip(names, ca.vertsplit(seen), strict=True):
            if ca.depends_on(value, ca.vertcat(x, u)):
                message = f"out of reach, inside the simulator: an effect lets '{name}' change within a test"
                raise InputError.of(f"model '{self.box.name}'", message, "Leave the effect out")
        return ca.Function("constants", [p, c], [seen], ["p", "c"], ["constants"])

    @cached_property
    def bare_inputs(self) -> bool:
        """Whether the simulator sees the inputs of the tests as they are."""
        x, u, p, c = self._symbols
        own = ca.vertcat(*(u[self.inputs.index(channel.name)] for channel in self.box.inputs))
        return bool(ca.is_equal(self.seen(x, u, p, c)[: own.numel()], own, 2))

    @cached_property
    def bare_outputs(self) -> bool:
        """Whether the outputs are those of the simulator as they are."""
        x, u, p, c = self._symbols
        return bool(ca.is_equal(self.out(x, u, p, c), u[len(self.inputs) :], 2))

    @cached_property
    def reaching(self) -> frozenset[str]:
        """Parameters that change what the simulator sees."""
        _, u, p, c = self._symbols
        filter_ = self.before
        own = ca.SX.sym("x", len(filter_.states))
        filtered = ca.vertcat(self.constants(p, c), filter_.out(own, u, p, c), filter_.rhs(own, u, p, c))
        whole = ca.vertcat(filtered, filter_.initial(u, p, c))
        return frozenset(name for k, name in enumerate(self.parameters) if ca.depends_on(whole, p[k]))

    @cached_property
    def _symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        x, u, p, c = self.rhs.sx_in()
        return x, u, p, c

    def _refuse_feedback(self, u: ca.SX, filtered: ca.SX) -> None:
        if ca.depends_on(filtered, u[len(self.inputs) :]):
            message = "out of reach, inside the simulator: an effect leads the output back to the input"
            raise InputError.of(f"model '{self.box.name}'", message, "Leave the effect out")
