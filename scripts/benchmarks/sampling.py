"""Sampling the posterior of the bundled campaign: mofit beside plain emcee and NUTS on the same likelihood."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import emcee
import numpy as np

from benchmarks.nuts import CHAINS, load_jax, logit_factor, make_nuts
from benchmarks.pipelines.job import MODEL, Recorded, pose
from benchmarks.rows import row
from mofit.optimize import RefineSettings, merge, refine
from mofit.problem import adjusted_posterior
from mofit.sampling import SampleSettings, autocorrelation_time, effective_size, laplace_covariance, r_hat, sample_mode
from studies.report_page import versions


@dataclass(frozen=True)
class Result:
    """What a sampler reached.

    Parameters
    ----------
    ess
        Least effective number of draws of a parameter.
    r_hat
        Largest split R-hat.
    evaluations
        Log posteriors computed; with gradient, where the sampler takes one.
    gradients
        How many of them were with gradient.
    met
        Whether the stop rule was met, as far as it applies.
    note
        How it was run.
    """

    ess: float
    r_hat: float
    evaluations: int
    gradients: int
    met: bool
    note: str


class Task:
    """The best mode of the bundled campaign, all parameters free, as `mofit identify` samples it."""

    def __init__(self, seed: int, jobs: int, limit: float) -> None:
        counted, minimum = pose(seed, jobs)
        near = counted.near(minimum.point[None], np.sqrt(np.diag(laplace_covariance(minimum.hessian))))
        wide = adjusted_posterior(near, minimum.point)
        self.minimum = merge(refine(wide.evaluate, minimum.point[None], RefineSettings(merge=None)))[0]
        self.covariance = laplace_covariance(self.minimum.hessian)
        self.problem = wide.local(self.minimum.point, np.sqrt(np.diag(self.covariance)))
        self.tests, self.free = near.tests, near.space.names
        self.settings, self.seed, self.limit = SampleSettings(), seed, limit

    @property
    def dimension(self) -> int:
        """Number of parameters."""
        return len(self.minimum.point)


def run(seed: int = 0, jobs: int = 2, limit: float = 120.0) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Sample one mode with every sampler to the stop rule, plain emcee at most until the limit, in seconds.

    Effective draws are counted alike for ensembles, N times the walkers by tau; for NUTS it is the bulk ESS.

    Returns
    -------
    rows
        One per sampler: ``name``, ``ess`` (least of the parameters), ``seconds``, ``ess_per_second``, ``evaluations``,
        ``gradients`` (how many of these with gradient), ``r_hat``, ``stop_rule`` (met or not), ``note``; or ``skipped``
        with the reason.
    settings
        The task and the machine.
    """
    task = Task(seed, jobs, limit)
    task.problem.log_posterior(task.minimum.point[None])  # compiled before the clock runs, values and gradients
    task.problem.evaluate(task.minimum.point[None])
    samplers = {"mofit": by_mofit, "emcee, default moves": by_emcee, "numpyro NUTS": by_nuts}
    rows = [row({"name": name}, partial(_timed, sample, task)) for name, sample in samplers.items()]
    settings = {
        "model": MODEL,
        "tests": list(task.tests),
        "free": list(task.free),
        "seed": seed,
        "jobs": jobs,
        "limit": limit,
        "cpu": platform.processor() or platform.machine(),
        **versions("numpy", "scipy", "emcee", "jax", "numpyro"),
    }
    return rows, settings


def _timed(sample: Callable[[Task], Result], task: Task) -> dict[str, Any]:
    begin = time.perf_counter()
    found = sample(task)
    seconds = time.perf_counter() - begin
    return {
        "ess": found.ess,
        "seconds": seconds,
        "ess_per_second": found.ess / seconds,
        "evaluations": found.evaluations,
        "gradients": found.gradients,
        "r_hat": found.r_hat,
        "stop_rule": found.met,
        "note": found.note,
    }


def by_mofit(task: Task) -> Result:
    """As `mofit identify` samples a mode."""
    chains = sample_mode(task.problem.log_posterior, task.minimum.point, task.covariance, (task.seed, 1), task.settings)
    note = f"{chains.chain.shape[0]} ensembles of {chains.chain.shape[2]} walkers, {chains.steps} steps"
    return Result(chains.effective_draws, float(chains.r_hat.max()), chains.evaluations, 0, chains.converged, note)


def by_emcee(task: Task) -> Result:
    """Four ensembles, one after the other in each round, as emcee's tutorial runs one."""
    point, settings = task.minimum.point, task.settings
    walkers, spread = 32, np.linalg.cholesky(task.covariance)
    rng = np.random.default_rng(task.seed)
    samplers = []
    states: list[Any] = []
    for _ in range(settings.ensembles):
        sampler = emcee.EnsembleSampler(walkers, task.dimension, task.problem.log_posterior, vectorize=True)
        sampler.random_state = np.random.RandomState(rng.integers(2**31)).get_state()
        samplers.append(sampler)
        inside = point + rng.standard_normal((walkers, task.dimension)) @ spread.T
        states.append(np.clip(inside, 1e-9, 1 - 1e-9))
    former, steps = np.zeros(task.dimension), 0
    end = time.perf_counter() + task.limit
    while True:
        states = [sampler.run_mcmc(state, 200) for sampler, state in zip(samplers, states, strict=True)]
        steps += 200
        chain = np.stack([sampler.get_chain() for sampler in samplers])
        tau = autocorrelation_time(chain.transpose(1, 0, 2, 3).reshape(steps, -1, task.dimension))
        discard, every = int(min(2 * tau.max(), steps // 2)), int(np.ceil(2 * tau.max()))
        thinned = chain[:, discard::every].reshape(len(chain), -1, task.dimension)
        mixing, effective = float(r_hat(thinned).max()), chain[:, discard:, :, 0].size / tau.max()
        met = (
            steps - discard > settings.tau_multiple * tau.max()
            and bool(np.all(tau - former <= settings.tau_growth * tau))
            and effective >= settings.min_ess
            and mixing <= settings.max_r_hat
        )
        if met or time.perf_counter() > end:
            break
        former = tau
    note = f"{len(chain)} ensembles of {walkers} walkers, {steps} steps"
    return Result(float(effective), mixing, chain[..., 0].size, 0, bool(met), note)


def by_nuts(task: Task, warmup: int = 300, draws: int = 500) -> Result:
    """Four chains at once over the logits of the unit cube, exact gradients of the kernel, dense mass matrix.

    Like the others it starts from the Laplace approximation: the logits are whitened by it.
    """
    evaluate = Recorded(lambda u: task.problem.evaluate(u)[:2])
    factor = np.linalg.cholesky(np.asarray(task.covariance, dtype=float))
    middle, factor = logit_factor(task.minimum.point, factor)
    sampler = make_nuts(evaluate, middle, factor, warmup, draws)
    start = np.random.default_rng(task.seed).standard_normal((CHAINS, task.dimension))
    sampler.run(load_jax().random.PRNGKey(task.seed), init_params=start)
    found = middle + np.asarray(sampler.get_samples(group_by_chain=True)) @ factor.T
    ess, mixing = float(effective_size(found).min()), float(r_hat(found).max())
    met = ess >= task.settings.min_ess and mixing <= task.settings.max_r_hat
    note = f"{CHAINS} chains, {warmup} steps of warm-up, {draws} draws each; compilation included"
    return Result(ess, mixing, evaluate.points, evaluate.points, met, note)
