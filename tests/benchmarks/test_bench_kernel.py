"""The kernel benchmark: every competitor computes the same thing."""

import numpy as np
import pytest

from benchmarks import kernel_peers, kernel_solvers
from benchmarks.kernel import peak_rate, run
from benchmarks.kernel_peers import FREE, Task
from benchmarks.rows import Absent
from mofit.simulation import Simulator
from mofit.simulation.compiler.emit import Emitter
from mofit.simulation.compiler.machine import host

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


def test_a_peak_rate_is_that_of_the_fastest_run():
    # three runs of 4, 1 and 2 seconds: 200 000 rounds of 16 chains of full registers in one second
    ticks = iter([0.0, 4.0, 10.0, 11.0, 20.0, 22.0])
    rate = peak_rate(Emitter.multiply_add, repeats=3, clock=lambda: next(ticks))
    assert rate == 200_000 * 16 * host().width
    assert not list(ticks)
