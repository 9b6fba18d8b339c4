"""The samplers of the sampling benchmark on a posterior that is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import sampling
from benchmarks.rows import Absent
from mofit.sampling import SampleSettings

COVARIANCE = 1e-4 * np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.5], [0.0, -0.5, 1.5]])
PRECISION = np.linalg.inv(COVARIANCE)


class Gaussian:
    dimension = 3
    covariance = COVARIANCE
    minimum = SimpleNamespace(point=np.array([0.5, 0.3, 0.6]))
    settings = SampleSettings(tau_multiple=20.0, tau_growth=0.1, min_ess=200.0, max_r_hat=1.02)  # what takes seconds
    seed = 1
    limit = 60.0

    def __init__(self):
        self.problem = self
        self.asked = 0

    def evaluate(self, u):
        self.asked += len(u)
        gap = u - self.minimum.point
        return 0.5 * np.einsum("ni,ij,nj->n", gap, PRECISION, gap), gap @ PRECISION, np.tile(PRECISION, (len(u), 1, 1))

    def log_posterior(self, u):
        return -self.evaluate(u)[0]


def quick_nuts(task):
    return sampling.by_nuts(task, warmup=100, draws=300)


@pytest.mark.parametrize(
    "sample", [sampling.by_mofit, sampling.by_emcee, pytest.param(quick_nuts, marks=pytest.mark.slow)]
)
def test_every_sampler_meets_the_stop_rule_on_a_gaussian(sample):
    task = Gaussian()
    try:
        found = sample(task)
    except Absent as reason:
        pytest.skip(str(reason))
    assert found.met
    assert found.ess >= 200
    assert found.r_hat <= 1.02
    assert 0.95 * task.asked <= found.evaluations <= 1.05 * task.asked
    assert found.gradients == (found.evaluations if sample is quick_nuts else 0)
