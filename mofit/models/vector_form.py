"""A model in vector form: CasADi functions of vectors, which are compiled."""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256

import casadi as ca


@dataclass(frozen=True)
class System:
    """A model in vector form; the vectors are ordered as the names."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    conditions: tuple[str, ...]
    outputs: tuple[str, ...]
    rhs: ca.Function
    """``(x, u, p, c) -> xdot``"""
    out: ca.Function
    """``(x, u, p, c) -> y``"""
    initial: ca.Function
    """``(u, p, c) -> x0`` with the first sample of the inputs."""

    def hash(self) -> str:
        """Hash of the equations; it changes with anything that can change a number."""
        graphs = "".join(function.serialize() for function in (self.rhs, self.out, self.initial))
        return sha256(graphs.encode()).hexdigest()[:16]
