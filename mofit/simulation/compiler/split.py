"""A program cut in two: what is equal in all lanes, computed once into a table, and what every lane computes."""

from __future__ import annotations

import marshal
from dataclasses import dataclass
from functools import cached_property

from mofit.simulation.compiler.machine import kept
from mofit.simulation.compiler.program import LANE, MARSHAL_FORMAT, TIME, Program, pruned


@dataclass(frozen=True)
class Split:
    """A program cut into what a table holds for all lanes and what every lane computes.

    ``inputs`` are the levels of the program's inputs, ``outputs`` the numbers of those outputs that are wanted.
    """

    program: Program
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]

    @property
    def digest(self) -> tuple[str, tuple[int, ...], tuple[int, ...]]:
        """All that decides it, in brief."""
        return self.program.digest, self.inputs, self.outputs

    @cached_property
    def levels(self) -> list[int]:
        """Level of every node."""
        return self.program.levels(self.inputs)

    @cached_property
    def roots(self) -> tuple[int, ...]:
        """Nodes of the wanted outputs."""
        return tuple(index for output in self.outputs for index in self.program.outputs[output])

    @cached_property
    def live(self) -> list[int]:
        """Nodes that the wanted outputs depend on."""
        return self.program.needed(self.roots)

    def _frontier(self, level: int) -> tuple[int, ...]:
        nodes, levels = self.program.nodes, self.levels
        read = {arg for index in self.live if levels[index] & LANE for arg in nodes[index].args} | set(self.roots)
        constant = {index for index in read if not nodes[index].args and isinstance(nodes[index].value, float)}
        return tuple(sorted(index for index in read - constant if levels[index] == level))

    @cached_property
    def _cut(self) -> tuple[tuple[int, ...], tuple[int, ...], bytes]:
        """What `constant`, `varying` and `table` are, from the cache where it is kept."""

        def made() -> bytes:
            constant, varying = self._frontier(0), self._frontier(TIME)
            # only what they need: models that differ elsewhere share the code
            table = pruned(Program(self.program.nodes, (constant + varying,)))
            return marshal.dumps((constant, varying, table.serialized), MARSHAL_FORMAT)

        constant, varying, table = marshal.loads(kept(("split", self.digest), made))
        return constant, varying, table

    @property
    def constant(self) -> tuple[int, ...]:
        """Nodes whose values the lanes read once."""
        return self._cut[0]

    @property
    def varying(self) -> tuple[int, ...]:
        """Nodes whose values the lanes read at every step."""
        return self._cut[1]

    @cached_property
    def table(self) -> Program:
        """Computes `constant` and `varying` from the graph's inputs."""
        return Program.deserialized(self._cut[2])
