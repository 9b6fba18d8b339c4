"""The rate of fused multiply-adds that one core of the machine at hand reaches."""

from __future__ import annotations

import ctypes
import time

import numpy as np
from llvmlite import ir

from mofit.kernel.emit import I64, PTR, Emitter
from mofit.kernel.evaluate import module_text, new_function
from mofit.kernel.machine import compile_entry, host

_CHAINS = 16
_ROUNDS = 200_000


def peak_fma_rate(repeats: int = 20) -> float:
    """Fused multiply-adds on doubles per second: 16 independent chains of full registers, best of ``repeats``."""
    module, function, build = new_function("run", [PTR])
    emitter = Emitter(module, build, host().width, host().fma)
    start = [emitter.load(function.args[0], chain * host().width) for chain in range(_CHAINS)]
    factor, offset = emitter.constant(0.999999), emitter.constant(1e-6)
    before, loop, done = build.block, function.append_basic_block("loop"), function.append_basic_block("done")
    build.branch(loop)
    build.position_at_end(loop)
    count, chains = build.phi(I64), [build.phi(emitter.type) for _ in start]
    following = [emitter.multiply_add(chain, factor, offset) for chain in chains]
    after = build.add(count, ir.Constant(I64, 1))
    for phi, first, then in zip([count, *chains], [ir.Constant(I64, 0), *start], [after, *following], strict=True):
        phi.add_incoming(first, before)
        phi.add_incoming(then, loop)
    build.cbranch(build.icmp_signed("<", after, ir.Constant(I64, _ROUNDS)), loop, done)
    build.position_at_end(done)
    for chain, value in enumerate(following):
        emitter.store(value, function.args[0], chain * host().width)
    build.ret_void()
    text = module_text(module)
    code = compile_entry(text, lambda: text, (), ctypes.CFUNCTYPE(None, ctypes.c_void_p))
    data = np.ones(_CHAINS * host().width)
    best = np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        code.entry(data.ctypes.data)
        best = min(best, time.perf_counter() - begin)
    return _ROUNDS * len(data) / best
