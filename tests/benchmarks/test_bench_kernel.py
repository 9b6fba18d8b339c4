"""The kernel benchmark: every competitor computes the same thing."""

import numpy as np
import pytest

from benchmarks import kernel_peers, kernel_solvers
from benchmarks.kernel import peak_rate, run
from benchmarks.kernel_peers import FREE, Task
from benchmarks.rows import Absent
from mofit.simulation import Simulator
from mofit.simulation.compiler.emit import Emitter

TASK = Task(samples=60)


@pytest.mark.parametrize(
    ("make", "tolerance"),
    [
        (kernel_peers.scipy_cost, 1e-4),
        (kernel_peers.casadi_machine, 1e-5),
        (kernel_peers.casadi_compiled, 1e-5),
        pytest.param(kernel_peers.jax_batched, 1e-5, marks=pytest.mark.slow),
        pytest.param(kernel_solvers.numba_lanes, 1e-5, marks=pytest.mark.slow),
        (kernel_solvers.diffsol_sensitivities, 1e-4),
        (kernel_solvers.heyoka_cost, 1e-3),
    ],
)
def test_competitor_agrees_with_the_kernel(make, tolerance):
    p = TASK.parameters(2)
    try:
        cost = make(TASK)(p)
    except Absent as reason:
        pytest.skip(str(reason))
    ours = Simulator(TASK.system, TASK.experiments, FREE, steps=1).cost(p).sum(axis=1)
    np.testing.assert_allclose(cost, ours, rtol=tolerance)


def test_absent_competitor_is_skipped_with_the_reason():
    def absent(task):
        raise Absent("not here")

    rows, settings = run(sets=8, seconds=0.0, peers=(("other", "cost", absent, 1),))
    assert rows[-1] == {"name": "other", "result": "cost", "skipped": "not here"}
    assert settings["steps"] == 5670
    assert all(row["fraction_of_peak"] > 0 for row in rows[:-1])


def test_peak_rates_are_those_of_a_computer():
    multiply_adds = peak_rate(Emitter.multiply_add, repeats=1)
    assert 1e8 < multiply_adds < 1e12
    assert 1e7 < peak_rate(lambda emit, value, one, _: emit.builder.fdiv(one, value), repeats=1) < multiply_adds
