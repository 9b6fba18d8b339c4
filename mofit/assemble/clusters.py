"""One subtree per sampled mode, laid out so that ArviZ opens it."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.assemble.comparison import laplace_sd
from mofit.assemble.profiles import profile_group
from mofit.assemble.signals import predictions, predictive
from mofit.joint import JointProblem
from mofit.objectives import test_log_likelihood
from mofit.outcome import Mode, Outcome
from mofit.problem import Problem
from mofit.result import OWN_UNIT, axis, parameter_axis, quantity
from mofit.sample import laplace_covariance, r_hat
from mofit.verdict import contraction, verdict

Array = NDArray[np.float64]

#: Posterior draws simulated for the predictive bands, and the most numbers they may take.
PREDICTIVE_DRAWS = 100
PREDICTIVE_NUMBERS = 4_000_000


def cluster_groups(outcome: Outcome) -> dict[str, xr.Dataset]:
    """All groups of all clusters by path."""
    groups = {}
    for mode in outcome.modes:
        path = f"/clusters/{mode.name}"
        draws = mode.chains.thinned()
        groups[path] = _summary(outcome.problem, mode, draws.points)
        groups[f"{path}/prediction"] = predictions(outcome.problem, mode.minimum.point)
        groups[f"{path}/posterior"] = _posterior(outcome.problem, draws.points)
        groups[f"{path}/profile"] = profile_group(outcome.problem.space, mode.profile)
        groups[f"{path}/sample_stats"] = _sample_stats(mode)
        groups[f"{path}/log_likelihood"] = _log_likelihood(outcome.problem, mode, draws.points)
        groups[f"{path}/posterior_predictive"] = predictive(outcome.problem, _few(outcome.problem, draws.points))
    return groups


def _few(problem: Problem, draws: Array) -> Array:
    """Evenly spread draws, (chain, few, d)."""
    samples = sum(len(drive.inputs) for drive in problem.drives)
    wanted = max(1, min(PREDICTIVE_DRAWS, PREDICTIVE_NUMBERS // samples) // len(draws))
    return draws[:, np.linspace(0, draws.shape[1] - 1, min(wanted, draws.shape[1])).astype(int)]


def _summary(problem: Problem, mode: Mode, draws: Array) -> xr.Dataset:
    space, minimum, chains = problem.space, mode.minimum, mode.chains
    samples = draws.reshape(-1, len(space))
    values = space.from_unit(samples)
    covariance = laplace_covariance(minimum.hessian)
    scale = np.sqrt(np.diag(covariance))
    per_parameter = {
        "value": (space.from_unit(minimum.point), OWN_UNIT, "refined minimum"),
        "at_bound": (minimum.at_bound, "1", "-1 at the lower, 1 at the upper bound"),
        "laplace_sd": (laplace_sd(problem, minimum), OWN_UNIT, "standard deviation (Laplace)"),
        "noise_sd": (
            np.sqrt(np.diag(laplace_covariance(mode.noise_hessian))) * space.slope(space.from_unit(minimum.point)),
            OWN_UNIT,
            "standard deviation if the model were right: noise alone, no gap (Laplace)",
        ),
        "mean": (values.mean(axis=0), OWN_UNIT, "posterior mean"),
        "sd": (values.std(axis=0), OWN_UNIT, "posterior standard deviation"),
        "q05": (np.quantile(values, 0.05, axis=0), OWN_UNIT, "5 % quantile"),
        "q50": (np.quantile(values, 0.50, axis=0), OWN_UNIT, "median"),
        "q95": (np.quantile(values, 0.95, axis=0), OWN_UNIT, "95 % quantile"),
        "ess": (chains.ess, "1", "effective sample size"),
        # in the parameters' own units, as ArviZ sees them: folding does not commute with the logarithm
        "r_hat": (r_hat(space.from_unit(draws)), "1", "split R-hat between ensembles"),
        "tau": (chains.tau, "1", "integrated autocorrelation time in steps"),
        "contraction": (contraction(samples), "1", "1 - posterior sd / prior sd"),
        "verdict": (verdict(samples), "1", "what the data say"),
    }
    variables = {name: quantity("parameter", *entry) for name, entry in per_parameter.items()}
    variables["laplace_correlation"] = quantity(
        ("parameter", "parameter_"), covariance / np.outer(scale, scale), "1", "correlation (Laplace)"
    )
    nrmsd, slope = (values[0] for values in problem.gradients(minimum.point[None]))
    variables["nrmsd"] = quantity("test", nrmsd, "1", "NRMSD at the minimum")
    variables["pull"] = quantity(
        ("test", "parameter"),
        slope * scale / np.maximum(nrmsd, np.finfo(float).tiny)[:, None],
        "1",
        "relative change of NRMSD per standard deviation (Laplace) of the parameter",
    )
    return xr.Dataset(
        variables,
        {
            **parameter_axis(space.names, space.units),
            "parameter_": axis("parameter_", list(space.names)),
            "test": axis("test", list(problem.tests)),
        },
        {
            "log_evidence": mode.evidence.log_evidence,
            "log_evidence_error": mode.evidence.error,
            "weight": mode.weight,
            "log_posterior": -minimum.value,
            "gap_fundamental": float(np.sqrt(mode.sampled.gap_squares[0])),
            "gap_harmonics": float(np.sqrt(mode.sampled.gap_squares[1])),
            "converged": int(chains.converged),
            "evaluations": int(chains.evaluations),
        },
    )


def _posterior(problem: Problem, draws: Array) -> xr.Dataset:
    values = problem.space.from_unit(draws)
    return xr.Dataset(
        {
            p.name: quantity(("chain", "draw"), values[..., i], p.unit, p.description or p.name)
            for i, p in enumerate(problem.space.parameters)
        },
        _axes(draws),
    )


def _sample_stats(mode: Mode) -> xr.Dataset:
    draws = mode.chains.thinned()
    return xr.Dataset(
        {
            "lp": quantity(("chain", "draw"), draws.log_prob, "1", "log posterior density"),
            "walker": quantity(("chain", "draw"), draws.walker, "1", "walker in its ensemble"),
            "step": quantity(("chain", "draw"), draws.step, "1", "step of the ensemble"),
        },
        _axes(draws.points),
        {"acceptance": mode.chains.acceptance.tolist()},
    )


def _log_likelihood(problem: Problem, mode: Mode, draws: Array) -> xr.Dataset:
    """Of every test; costs are those that were sampled, which differ from the whole ones by a constant per test."""
    chains, count, dimension = draws.shape
    sampled = mode.sampled.problem
    quick = sampled.main if isinstance(sampled, JointProblem) else sampled
    points = np.concatenate([mode.minimum.point[None], draws.reshape(-1, dimension)])
    best, *costs = quick.objectives(points) ** 2 * quick.noise.count
    exact = problem.objectives(points[:1])[0] ** 2 * problem.noise.count
    values = test_log_likelihood(exact + np.array(costs) - best, exact, problem.noise).reshape(chains, count, -1)
    return xr.Dataset(
        {
            test: quantity(("chain", "draw"), values[..., i], "1", f"log likelihood of {test}, constant left out")
            for i, test in enumerate(problem.tests)
        },
        _axes(draws),
    )


def _axes(draws: Array) -> dict[str, xr.Variable]:
    return {"chain": axis("chain", range(draws.shape[0])), "draw": axis("draw", range(draws.shape[1]))}
