"""The pipelines beside mofit: their simulators compute the same thing, and what they do is counted right."""

import sys

import numpy as np
import pytest

from benchmarks import pipeline, small_pipeline
from benchmarks.pipelines import by_mofit, by_script, small
from benchmarks.pipelines.job import Recorded, make_job
from benchmarks.pipelines.peer import Peer, distinct_minima, price, seeded
from benchmarks.rows import Absent
from mofit.data import bundled_campaign, read_campaign
from mofit.models import find_model
from mofit.optimize import merge, refine
from mofit.problem import GaussianPrior, build_problem
from mofit.sampling import laplace_covariance

COVARIANCE = 1e-4 * np.array([[1.0, 0.6, 0.0], [0.6, 2.0, -0.5], [0.0, -0.5, 1.5]])
PRECISION = np.linalg.inv(COVARIANCE)
CENTRE = np.array([0.5, 0.3, 0.6])
SCRIPT, PYPESTO, NUTS, PINTS = pipeline.PEERS
PEERS = [
    pytest.param(SCRIPT, id="script"),
    pytest.param(PYPESTO, id="pyPESTO"),
    pytest.param(NUTS, id="JAX", marks=pytest.mark.slow),
    pytest.param(PINTS, id="PINTS"),
]


def cost(u):
    gap = np.asarray(u) - CENTRE
    return 0.5 * np.einsum("ni,ij,nj->n", gap, PRECISION, gap)


def bowl(peer):
    """A Gaussian posterior in the form that the peer evaluates."""

    def log_posterior(u):
        return np.where(np.all((u >= 0) & (u <= 1), axis=1), -cost(u), -np.inf)

    def descent(u):
        return cost(u), (u - CENTRE) @ PRECISION

    return descent if peer.gradients else log_posterior


@pytest.fixture(scope="module")
def job():
    """The model held against the two shortest tests, with a prior on what they hardly tell."""
    names = ["sine_3_50Hz", "sine_4_00Hz"]
    held = ("dF0", "s_M", "F_M", "c_y", "p_y")
    prior = GaussianPrior(held, np.array([0.536, 0.418, 0.556, 0.543, 0.376]), 1e5 * np.eye(5))
    problem = build_problem(find_model("maxwell_tyre"), read_campaign(bundled_campaign()).select(names), prior=prior)
    start = np.array([0.536, 0.418, 0.556, 0.543, 0.376, 0.57, 0.78, 0.56])
    counted = problem.with_noise_at(merge(refine(problem.evaluate, start[None]))[0].point)
    return make_job(counted, merge(refine(counted.evaluate, start[None]))[0])


@pytest.fixture(scope="module")
def posterior(job):
    """Points as a sample of the posterior would hold them, the minimum first."""
    best = merge(refine(job.whole.evaluate, job.task.mean[None]))[0]
    spread = np.linalg.cholesky(laplace_covariance(best.hessian))
    return best.point + np.vstack([np.zeros(8), np.random.default_rng(1).standard_normal((4, 8))]) @ spread.T


def own_of(peer, task):
    try:
        return peer.own(task)
    except Absent as reason:
        pytest.skip(str(reason))


def test_plain_python_simulator_agrees_with_the_kernel(job, posterior):
    own = own_of(SCRIPT, job.task)
    np.testing.assert_allclose(own(posterior), job.whole.log_posterior(posterior), atol=0.05)
    anywhere = np.random.default_rng(2).random((3, 8))
    np.testing.assert_allclose(own(anywhere), job.whole.log_posterior(anywhere), rtol=1e-4)
    assert own(np.full((1, 8), 1.1)) == [-np.inf]


@pytest.mark.slow
def test_diffrax_simulator_agrees_with_the_kernel(job, posterior):
    value, gradient = own_of(NUTS, job.task)(posterior)
    ours, slope = job.whole.descent(posterior)
    # its steps run over the kinks where the slip changes sign
    np.testing.assert_allclose(value - value[0], ours - ours[0], atol=0.1)
    spread = np.linalg.cholesky(laplace_covariance(job.whole.evaluate(posterior[:1])[2][0]))
    # whitened: how many standard deviations the minimum moves
    np.testing.assert_allclose(gradient @ spread, slope @ spread, atol=0.1)


def test_quick_posterior_agrees_with_the_whole_one(job, posterior):
    np.testing.assert_allclose(job.near.log_posterior(posterior), job.whole.log_posterior(posterior), atol=0.3)


@pytest.mark.parametrize("peer", PEERS)
def test_every_pipeline_finds_and_samples_a_gaussian(peer):
    asked, function = [], bowl(peer)

    def counted(u):
        asked.append(len(u))
        return function(u)

    try:
        searched = Recorded(counted)
        ends = peer.search(searched, 3, 1)
        assert searched.points == sum(asked)
        sampled = Recorded(counted)
        effective = peer.sample(sampled, ends[0], 1, 200.0)
    except Absent as reason:
        pytest.skip(str(reason))
    assert searched.points + sampled.points == sum(asked)
    assert cost(ends[:1])[0] < 0.01
    assert effective >= 200.0
    again = Recorded(function)
    np.testing.assert_array_equal(peer.search(again, 3, 1), ends)  # seeded
    assert again.points == searched.points


class TwoWells:
    """Minima of 0 and 1 near 0.25 and 0.75, a hill of 50 between them."""

    def log_posterior(self, u):
        return -self.evaluate(u)[0]

    def evaluate(self, u):
        x = u[:, 0]
        value = 25 * (1 + np.cos(4 * np.pi * x)) + 2 * (x - 0.25)
        slope = -100 * np.pi * np.sin(4 * np.pi * x) + 2
        return value, slope[:, None], np.full((len(u), 1, 1), 400 * np.pi**2)


def test_minima_are_counted_once_and_bad_ends_not_at_all():
    wells = TwoWells()
    ends = np.array([[0.25], [0.2502], [0.30], [0.75], [0.5], [0.01]])
    minima = distinct_minima(ends, wells, 0.0)
    np.testing.assert_allclose(minima[:, 0], [0.25, 0.75], atol=0.001)
    assert len(distinct_minima(np.array([[0.5]]), wells, 0.0)) == 0


def test_price_is_taken_at_points_that_were_visited():
    visited = Recorded(lambda u: u[:, 0])
    visited(np.arange(12.0).reshape(6, 2))
    visited(np.array([[-100.0, 0.0]]))
    seen = []

    def own(u):
        seen.append(u.copy())
        return 1.5 * u[:, 0] + 7

    found = price(own, visited, False, 60.0, 0)
    assert sorted(u[0, 0] for u in seen) == [-100.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    assert found.points == 7
    assert found.deviation == pytest.approx(5.0)  # an offset is no deviation, and -100 no part of a sample
    assert found.seconds > 0
    assert price(own, visited, False, 0.0, 0).points == 1


def test_time_is_evaluations_times_price(job):
    minimum = merge(refine(job.whole.evaluate, job.task.mean[None]))[0]

    def search(evaluate, dimension, seed):
        evaluate(minimum.point[None])
        return minimum.point[None]

    def sample(evaluate, start, seed, target):
        evaluate(np.tile(start, (10, 1)))
        return 1234.0

    ours = pipeline.mofit_row(by_mofit.Run(2.0, 1, 5000.0, 100, 80), by_mofit.Run(0.5, 1, 5000.0, 100, 80))
    assert (ours["seconds"], ours["build_seconds"], ours["time"]) == (0.5, 1.5, "measured")
    quick = Peer("quick", "a note", search, sample, lambda task: job.whole.log_posterior)
    theirs = pipeline.peer_row(quick, job, seed=0, jobs=2, limit=0.0, unit=0.5)
    assert (theirs["minima"], theirs["evaluations"], theirs["in_sampling"], theirs["ess"]) == (1, 11, 10, 1234.0)
    assert theirs["seconds"] == pytest.approx((theirs["ms_search"] + 10 * theirs["ms_sampling"]) / 1000 / 2)
    assert theirs["times_mofit"] == pytest.approx(theirs["seconds"] / 0.5)
    assert theirs["time"] == "computed"


def test_global_random_numbers_are_as_before():
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    with seeded(3):
        first = np.random.random()  # noqa: NPY002
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002
    with seeded(3):
        assert np.random.random() == first  # noqa: NPY002


@pytest.mark.parametrize(
    ("package", "ask"),
    [
        ("pypesto", lambda: PYPESTO.search(bowl(PYPESTO), 3, 0)),
        ("pints", lambda: PINTS.search(bowl(PINTS), 3, 0)),
        ("diffrax", lambda: NUTS.own(None)),
        ("numpyro", lambda: NUTS.sample(bowl(NUTS), CENTRE, 0, 1.0)),
    ],
)
def test_a_package_that_is_not_installed_is_named(package, ask, monkeypatch):
    for name in (package, f"{package}.infer"):
        monkeypatch.setitem(sys.modules, name, None)  # as if it were not there
    with pytest.raises(Absent, match=f"{package} is not installed"):
        ask()


def test_parameter_sets_of_any_simulator_are_counted(job):
    with by_mofit.counted_parameter_sets() as counts:
        job.whole.log_posterior(np.full((5, 8), 0.5))
        job.near.descent(job.task.mean[None])
    assert counts == [5, 1]
    job.whole.log_posterior(np.full((5, 8), 0.5))
    assert counts == [5, 1]


def test_peers_run_a_small_job_on_their_own_simulator():
    job = small.job(0)
    best = merge(refine(job.whole.evaluate, np.full((1, 2), 0.4)))[0].point
    points = np.stack([best, best + 0.01])
    own = by_script.log_posterior(job.task)(points)
    assert np.diff(own) == pytest.approx(np.diff(job.whole.log_posterior(points)), abs=0.05)

    def search(evaluate, dimension, seed):
        evaluate(points[:, :dimension])
        return best[None]

    def sample(evaluate, start, seed, target):
        return target * len(evaluate(start[None]))

    row = small_pipeline.peer_row(Peer("brief", "", search, sample, by_script.log_posterior), job, 0, 1.0, 50.0)
    assert (row["minima"], row["ess"], row["evaluations"], row["in_sampling"]) == (1, 50.0, 3, 1)
    assert row["times_mofit"] == row["seconds"] > row["in_search"] > 0
