"""Descents of a costly simulator find the minima that its search did not archive."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.descents import SHARE, completed
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.identification.stages import locate_minima, search
from mofit.models import Channel, Simulator
from mofit.parameters import Parameter
from mofit.simulation.evaluation.evaluations import with_evaluations

#: Two lags of one sum: which is which no data tell.
TRUTH = (0.03, 0.4)


def lag(x, step, time_constant):
    """T z' = x - z for inputs held from sample to sample."""
    decay = np.exp(-step / time_constant)
    return lfilter([0.0, 1 - decay], [1.0, -decay], x)


def two_lags(record, parameters):
    """F = z_1 + z_2."""
    x, step = record.inputs["displacement"], record.time[1]
    return lag(x, step, parameters["T_1"]) + lag(x, step, parameters["T_2"])


SIMULATOR = Simulator(
    two_lags,
    [Parameter(name, "s", 1e-2, 1.0, 0.1, "log") for name in ("T_1", "T_2")],
    [Channel("displacement", "m")],
    [Channel("force", "N")],
)


def campaign():
    """One test of the two lags, with noise."""
    time = np.arange(400) * 0.01
    x = np.sin(2 * np.pi * time) + 0.5 * np.sin(2 * np.pi * 7 * time)
    force = sum(lag(x, 0.01, one) for one in TRUTH) + 0.02 * np.random.default_rng(3).normal(size=len(time))
    experiment = Experiment("drive", "free", time, {"displacement": x}, {})
    test = Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"})
    return Campaign("lags", "simulated", {}, (test,))


def searched(limit):
    """The problem and its search."""
    settings = Settings(seed=1, jobs=1, simulations=limit, evaluations=50).for_model(SIMULATOR)
    problem = set_up_problem(with_evaluations(SIMULATOR, limit), campaign(), settings, ()).searched
    return problem, search(problem, settings)[0]


def test_a_minimum_that_the_search_did_not_archive_is_found():
    problem, found = searched(1000)
    after, minima = completed(problem, replace(found, archived=found.archived[:1]))
    values = sorted(problem.space.from_unit(minima).tolist())
    assert values == [pytest.approx(TRUTH, rel=0.1), pytest.approx(TRUTH[::-1], rel=0.1)]
    assert after.complete is None  # all starts were taken


def test_descents_end_when_few_minima_are_expected_undiscovered():
    problem, found = searched(1000)
    before, left = problem.evaluations.count, problem.evaluations.left
    after, minima = completed(problem, replace(found, archived=np.arange(len(found.points))))
    assert len(minima) == 2
    assert after.complete
    # two minima from sixteen starts: 2 * 3 / (16 - 2 - 2)
    assert after.expected_undiscovered == pytest.approx(0.5)
    assert problem.evaluations.count - before < SHARE * left


def test_descents_end_with_their_share_of_the_simulations():
    problem, found = searched(150)
    before, left = problem.evaluations.count, problem.evaluations.left
    after, minima = completed(problem, replace(found, archived=np.arange(len(found.points))))
    assert after.complete is False
    assert after.expected_undiscovered > 0.5
    assert len(minima) >= 1
    assert 0 < problem.evaluations.count - before < left
    assert problem.evaluations.refused == 0


def test_simulations_without_a_limit_find_both_minima():
    """Outside of `identify`, which sets a limit."""
    found = locate_minima(campaign(), SIMULATOR, Settings(seed=1, jobs=1, evaluations=50))
    assert found.problem.evaluations.limit == np.inf
    values = sorted(found.problem.space.from_unit(minimum.point).tolist() for minimum in found.minima)
    assert values == [pytest.approx(TRUTH, rel=0.1), pytest.approx(TRUTH[::-1], rel=0.1)]
