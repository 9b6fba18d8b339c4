"""Evaluate a program at many points at once: every lane is a point."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from mofit._typing import FloatArray
from mofit.simulation.compiler.emit import Emitter
from mofit.simulation.compiler.instructions import I64, PTR, Value
from mofit.simulation.compiler.machine import Code, compile_entry, host
from mofit.simulation.compiler.program import Program

_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)


def evaluate(program: Program, points: Sequence[FloatArray], lanes: int = 8) -> FloatArray:
    """All outputs of a program under one another, shape (elements, n), at n points: per input an array (elements, n).

    So many ``lanes`` are worked on together.
    """
    stacked = np.concatenate([np.asarray(block, dtype=float) for block in points])
    count = stacked.shape[1]
    sizes = tuple(len(block) for block in points)
    blocks = -(-count // lanes)
    # the lanes beyond the last point repeat it: no new values, no stray exceptions
    padded = np.empty((len(stacked), blocks * lanes))
    padded[:, :count] = stacked
    padded[:, count:] = stacked[:, -1:]
    result = np.empty((sum(map(len, program.outputs)), blocks * lanes))
    code = _compile(program, sizes, lanes)
    code.entry(padded.ctypes.data, result.ctypes.data, blocks, blocks * lanes)
    return result[:, :count]


@lru_cache(maxsize=256)
def _compile(program: Program, sizes: tuple[int, ...], lanes: int) -> Code:
    what = ("evaluate", program.digest, sizes, lanes)
    return compile_entry(what, lambda: _text(program, sizes, lanes), _SIGNATURE)


def _text(program: Program, sizes: tuple[int, ...], lanes: int) -> str:
    offsets = np.cumsum([0, *sizes])
    emit = Emitter([PTR, PTR, I64, I64], lanes, host())
    source, target, blocks, stride = emit.arguments
    roots = [index for group in program.outputs for index in group]

    def body(block: Value, _: list[Value]) -> list[Value]:
        column, values = emit.times(block, lanes), dict[int, Value]()

        def place(row: int) -> Value:
            return emit.builder.add(emit.times(stride, row), column)

        for index in program.needed(roots):
            element = program.nodes[index].value
            if isinstance(element, tuple):
                values[index] = emit.load(source, place(int(offsets[element[0]]) + element[1]))
        emit.program(program, roots, values)
        for row, index in enumerate(roots):
            emit.store(values[index], target, place(row))
        return []

    emit.loop(blocks, [], body)
    return emit.text()
