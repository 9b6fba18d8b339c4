"""LLVM instructions, written as text: of a graph there are thousands, and objects for each would take longer to make.

Methods are named as in LLVM's language reference, or in llvmlite, where there is one.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

F64, I64, PTR = "double", "i64", "ptr"

_COMPARE = {"<": "lt", "<=": "le", "==": "eq", ">": "gt", ">=": "ge", "!=": "ne"}


class Value(NamedTuple):
    """A value as instructions name it, and its type."""

    text: str
    type: str

    @property
    def typed(self) -> str:
        """Type and name."""
        return f"{self.type} {self.text}"


@dataclass(eq=False)
class Block:
    """Instructions that follow one another, under a label; first those that depend on the block before."""

    label: str
    lines: list[str] = field(default_factory=list)
    phis: dict[Value, list[str]] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """Label and instructions."""
        phis = [f"{one.text} = phi {one.type} {', '.join(pairs)}" for one, pairs in self.phis.items()]
        return "\n".join([f"{self.label}:", *phis, *self.lines])


def vector(kind: str, count: int) -> str:
    """Type of so many side by side."""
    return f"<{count} x {kind}>"


def double(value: float) -> Value:
    """A double, bit by bit."""
    return Value(f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}", F64)


def integer(value: int) -> Value:
    """A whole number of 64 bits."""
    return Value(str(value), I64)


def together(values: Sequence[Value]) -> Value:
    """Constants as a vector."""
    return Value(f"<{', '.join(one.typed for one in values)}>", vector(values[0].type, len(values)))


def undefined(kind: str) -> Value:
    """Any value."""
    return Value("undef", kind)


class Builder:
    """Writes a function ``run`` of ``arguments`` (their types), which returns nothing, block by block."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self.arguments = [Value(f"%a{k}", kind) for k, kind in enumerate(arguments)]
        self._declared: dict[str, str] = {}
        self._blocks, self._count = [Block("entry")], 0
        self.block = self._blocks[0]

    def text(self, attributes: str) -> str:
        """The module."""
        given = ", ".join(one.typed for one in self.arguments)
        blocks = "\n".join(block.text for block in self._blocks)
        parts = [f"define void @run({given}) #0 {{", blocks, "}", *self._declared.values()]
        return "\n".join([*parts, f"attributes #0 = {attributes}", ""])

    def append_block(self) -> Block:
        """A new block, the last one so far."""
        self._blocks.append(Block(f"b{len(self._blocks)}"))
        return self._blocks[-1]

    def position_at_end(self, block: Block) -> None:
        """Go on writing there."""
        self.block = block

    def _name(self, kind: str) -> Value:
        self._count += 1
        return Value(f"%v{self._count}", kind)

    def _write(self, kind: str, text: str) -> Value:
        found = self._name(kind)
        self.block.lines.append(f"{found.text} = {text}")
        return found

    def _binary(self, name: str, a: Value, b: Value) -> Value:
        return self._write(a.type, f"{name} {a.type} {a.text}, {b.text}")

    def fadd(self, a: Value, b: Value) -> Value:
        """``a + b``."""
        return self._binary("fadd", a, b)

    def fsub(self, a: Value, b: Value) -> Value:
        """``a - b``."""
        return self._binary("fsub", a, b)

    def fmul(self, a: Value, b: Value) -> Value:
        """``a * b``."""
        return self._binary("fmul", a, b)

    def fdiv(self, a: Value, b: Value) -> Value:
        """``a / b``."""
        return self._binary("fdiv", a, b)

    def fneg(self, a: Value) -> Value:
        """``-a``."""
        return self._write(a.type, f"fneg {a.typed}")

    def add(self, a: Value, b: Value) -> Value:
        """Sum of whole numbers."""
        return self._binary("add", a, b)

    def mul(self, a: Value, b: Value) -> Value:
        """Product of whole numbers."""
        return self._binary("mul", a, b)

    def and_(self, a: Value, b: Value) -> Value:
        """Both bits."""
        return self._binary("and", a, b)

    def or_(self, a: Value, b: Value) -> Value:
        """Any of both bits."""
        return self._binary("or", a, b)

    def fcmp_ordered(self, sign: str, a: Value, b: Value) -> Value:
        """Comparison of doubles; false where one is nan."""
        return self._write(a.type.replace(F64, "i1"), f"fcmp o{_COMPARE[sign]} {a.typed}, {b.text}")

    def fcmp_unordered(self, sign: str, a: Value, b: Value) -> Value:
        """Comparison of doubles; true where one is nan."""
        return self._write(a.type.replace(F64, "i1"), f"fcmp u{_COMPARE[sign]} {a.typed}, {b.text}")

    def less(self, a: Value, b: Value) -> Value:
        """``a < b`` of whole numbers."""
        return self._write("i1", f"icmp slt {a.typed}, {b.text}")

    def select(self, condition: Value, a: Value, b: Value) -> Value:
        """``a`` where true, ``b`` elsewhere."""
        return self._write(a.type, f"select {condition.typed}, {a.typed}, {b.typed}")

    def call(self, name: str, kind: str, arguments: Sequence[Value]) -> Value:
        """Result of a function, of this type."""
        types = ", ".join(one.type for one in arguments)
        self._declared.setdefault(name, f"declare {kind} @{name}({types})")
        return self._write(kind, f"call {kind} @{name}({', '.join(one.typed for one in arguments)})")

    def gep(self, base: Value, place: Value, kind: str) -> Value:
        """Address of the element at a place after another, of this type."""
        return self._write(PTR, f"getelementptr {kind}, {base.typed}, {place.typed}")

    def load(self, place: Value, kind: str) -> Value:
        """What memory holds there."""
        return self._write(kind, f"load {kind}, {place.typed}, align 8")

    def store(self, value: Value, place: Value) -> None:
        """Put into memory there."""
        self.block.lines.append(f"store {value.typed}, {place.typed}, align 8")

    def fetch_and_add(self, place: Value, more: Value) -> Value:
        """The whole number there, to which other threads add, too."""
        return self._write(more.type, f"atomicrmw add {place.typed}, {more.typed} monotonic")

    def insert_element(self, values: Value, one: Value, place: int) -> Value:
        """The vector with another value at a place."""
        return self._write(values.type, f"insertelement {values.typed}, {one.typed}, i64 {place}")

    def extract_element(self, values: Value, place: int) -> Value:
        """The value at a place of a vector of doubles."""
        return self._write(F64, f"extractelement {values.typed}, i64 {place}")

    def shuffle(self, values: Value, places: Sequence[int]) -> Value:
        """A vector of the doubles at some places."""
        mask = together([Value(str(place), "i32") for place in places])
        return self._write(vector(F64, len(places)), f"shufflevector {values.typed}, {values.type} undef, {mask.typed}")

    def phi(self, kind: str) -> Value:
        """A value that depends on the block before this one; see `add_incoming`."""
        found = self._name(kind)
        self.block.phis[found] = []
        return found

    def add_incoming(self, phi: Value, value: Value, before: Block) -> None:
        """The value of a `phi` where a block came before."""
        own = next(block for block in self._blocks if phi in block.phis)
        own.phis[phi].append(f"[{value.text}, %{before.label}]")

    def branch(self, to: Block) -> None:
        """Go on there."""
        self.block.lines.append(f"br label %{to.label}")

    def cbranch(self, condition: Value, to: Block, other: Block) -> None:
        """Go on there if true, else at the other."""
        self.block.lines.append(f"br {condition.typed}, label %{to.label}, label %{other.label}")

    def ret_void(self) -> None:
        """The end."""
        self.block.lines.append("ret void")
