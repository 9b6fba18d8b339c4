"""The kernel benchmark: every competitor computes the same thing."""

import numpy as np
import pytest

from mofit.bench import competitors
from mofit.bench.kernel import run
from mofit.bench.peak import peak_fma_rate
from mofit.bench.task import FREE, Task
from mofit.kernel import Simulator

TASK = Task(samples=60)


@pytest.mark.parametrize(
    ("make", "tolerance"),
    [
        (competitors.scipy_cost, 1e-4),
        (competitors.casadi_machine, 1e-5),
        (competitors.casadi_compiled, 1e-5),
        pytest.param(competitors.jax_batched, 1e-5, marks=pytest.mark.slow),
    ],
)
def test_competitor_agrees_with_the_kernel(make, tolerance):
    p = TASK.parameters(2)
    try:
        cost = make(TASK)(p)
    except competitors.Absent as reason:
        pytest.skip(str(reason))
    ours = Simulator(TASK.system, TASK.drives, FREE, steps=1).cost(p).sum(axis=1)
    np.testing.assert_allclose(cost, ours, rtol=tolerance)


def test_absent_competitor_is_skipped_with_the_reason(monkeypatch):
    def absent(task):
        raise competitors.Absent("not here")

    monkeypatch.setattr("mofit.bench.kernel._OTHERS", (("other", "cost", absent, 1),))
    rows, settings = run(sets=8, seconds=0.0)
    assert rows[-1] == {"name": "other", "result": "cost", "skipped": "not here"}
    assert settings["steps"] == 5670
    assert all(0 < row["fraction_of_peak"] < 1 for row in rows[:-1])


def test_peak_rate_is_that_of_a_computer():
    assert 1e8 < peak_fma_rate(repeats=1) < 1e12
