"""Evaluate an SX function at many points at once: every lane is a point."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from mofit.kernel.emit import I64, LIBM_NAMES, PTR, Emitter
from mofit.kernel.machine import Code, compile_entry, host
from mofit.kernel.program import Program, trace

Array = NDArray[np.float64]
_SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64)
_ATTRIBUTES = '{ nounwind "prefer-vector-width"="512" "min-legal-vector-width"="512" }'


def new_function(name: str, arguments: Sequence[ir.Type]) -> tuple[ir.Module, ir.Function, ir.IRBuilder]:
    """A module with one function without a result, and a builder at its entry."""
    module = ir.Module(name=name)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), arguments), name)
    return module, function, ir.IRBuilder(function.append_basic_block("entry"))


def module_text(module: ir.Module) -> str:
    """The module as text; every function in it may use 512-bit registers."""
    lines = [f"{line} #0" if line.startswith("define") else line for line in str(module).splitlines()]
    return "\n".join([*lines, f"attributes #0 = {_ATTRIBUTES}", ""])


def evaluate(program: Program, points: Sequence[Array], lanes: int = 8) -> Array:
    """Outputs of a program at n points.

    Parameters
    ----------
    program
        Any number of inputs and outputs.
    points
        Per input an array (elements, n).
    lanes
        Points worked on together.

    Returns
    -------
    Array
        All outputs under one another, shape (elements, n).
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


def evaluate_function(function: ca.Function, *points: Array, lanes: int = 8) -> Array:
    """`evaluate` for a CasADi SX function with dense outputs."""
    return evaluate(trace(function), points, lanes)


@lru_cache(maxsize=256)
def _compile(program: Program, sizes: tuple[int, ...], lanes: int) -> Code:
    what = ("evaluate", ca.CasadiMeta.version(), program, sizes, lanes)
    return compile_entry(what, lambda: _text(program, sizes, lanes), LIBM_NAMES, _SIGNATURE)


def _text(program: Program, sizes: tuple[int, ...], lanes: int) -> str:
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    module, function, build = new_function("run", [PTR, PTR, I64, I64])
    source, target, blocks, stride = function.args
    emitter = Emitter(module, build, lanes, host().fma)
    entry, loop, done = build.block, function.append_basic_block("loop"), function.append_basic_block("done")
    build.cbranch(build.icmp_signed(">", blocks, ir.Constant(I64, 0)), loop, done)
    build.position_at_end(loop)
    block = build.phi(I64)
    column = build.mul(block, ir.Constant(I64, lanes))
    values: dict[int, ir.Value] = {}

    def place(row: int) -> ir.Value:
        return build.add(build.mul(stride, ir.Constant(I64, row)), column)

    roots = [index for group in program.outputs for index in group]
    for index in program.needed(roots):
        node = program.nodes[index]
        if isinstance(node.value, tuple):
            values[index] = emitter.load(source, place(int(offsets[node.value[0]]) + node.value[1]))
    emitter.program(program, roots, values)
    for row, index in enumerate(roots):
        emitter.store(values[index], target, place(row))
    following = build.add(block, ir.Constant(I64, 1))
    block.add_incoming(ir.Constant(I64, 0), entry)
    block.add_incoming(following, build.block)
    build.cbranch(build.icmp_signed("<", following, blocks), loop, done)
    build.position_at_end(done)
    build.ret_void()
    return module_text(module)
