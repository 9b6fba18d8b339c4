"""Information of several outputs, each with its own noise, against weighted least squares."""

import numpy as np
import pytest
from two_outputs import NOISE, TRUTH, campaign, weighted_least_squares, write_rig

from mofit.experimental_design.information import estimator_precision
from mofit.experimental_design.noise_model import ChannelNoise
from mofit.experimental_design.sensitivity import sensitivities
from mofit.models import build_system, find_model
from mofit.problem import build_problem


def test_bound_and_expected_precision_are_those_of_weighted_least_squares(tmp_path):
    """The estimator weighs each output by its own noise, so that it reaches the bound; one test lacks an output."""
    tests, model = campaign({"1 Hz": "acceleration"}), find_model(write_rig(tmp_path)[1])
    problem = build_problem(model, tests)
    noises = [[ChannelNoise(sd=NOISE[channel.name]) for channel in model.outputs]] * len(problem.tests)
    values = np.array([[TRUTH["a"], TRUTH["b"]]])
    found = [*sensitivities(build_system(model), problem.experiments, values, noises, ("a", "b"))]
    assert [len(one.outputs) for one in found] == [2, 1, 2, 2]
    used = {e.name: e.weights.any(axis=1) for e in problem.experiments}
    _, covariance = weighted_least_squares(tests, lambda test: used[test.name])
    fisher = sum(one.fisher[0] for one in found)
    assert np.linalg.inv(fisher) == pytest.approx(covariance, rel=1e-6)
    estimator = np.array([sum(one.hessian[0] for one in found), sum(one.score_covariance[0] for one in found)])
    # weights differ between the outputs, not the level that is estimated: the estimate is as precise as the bound
    assert estimator_precision(estimator[None]) == pytest.approx(fisher, rel=0.02)
