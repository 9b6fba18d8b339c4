"""One subtree per sampled mode, laid out so that ArviZ opens it, and the mixture of all modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mofit._typing import FloatArray
from mofit.identification.combinations import TOGETHER, combined
from mofit.identification.result import IdentificationResult, PosteriorMode
from mofit.identification.result_tree.outputs import over_tests, simulated_signals, test_axes
from mofit.identification.result_tree.scoped import scoped_group
from mofit.optimize import Profile
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, test_log_likelihood
from mofit.results import axis, draw_axes, draws_dataset, group_dataset, parameter_axis, predictive_places, quantity
from mofit.sampling import contraction, laplace_covariance, mixture, r_hat, verdict

#: Posterior draws simulated for the predictive bands, and the most numbers they may take.
PREDICTIVE_DRAWS = 100
PREDICTIVE_NUMBERS = 4_000_000
#: of the longest records, for which each draw takes as much memory as the data
FEWEST_PREDICTIVE_DRAWS = 8


def mode_groups(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """All groups of all modes by path."""
    space, groups = outcome.problem.space, {}
    for mode in outcome.modes:
        path, problem = f"/modes/{mode.name}", mode.near
        groups[path] = _summary(path, problem, mode)
        groups[f"{path}/prediction"] = simulated_signals(problem, mode.minimum.point)
        groups |= scoped_group(f"{path}/scoped", problem, mode.minimum)
        groups[f"{path}/profile"] = profile_group(f"{path}/profile", space, mode.profile)
        if not mode.is_sampled:
            continue
        draws = mode.chains.thinned()
        groups[f"{path}/posterior"] = draws_dataset(space, space.from_unit(draws.points))
        groups[f"{path}/sample_stats"] = group_dataset(
            f"{path}/sample_stats",
            {"lp": draws.log_prob, "walker": draws.walker, "step": draws.step},
            draw_axes(draws.points.shape),
            {"acceptance": mode.chains.acceptance.tolist()},
        )
        groups[f"{path}/log_likelihood"] = _log_likelihood(problem, mode, draws.points)
        simulated = problem if problem.evaluations is None else mode.sampled.problem.main
        groups[f"{path}/posterior_predictive"] = _predictive(simulated, draws.points)
    return groups


def laplace_sd(space: ParameterSpace, point: FloatArray, hessian: FloatArray) -> FloatArray:
    """Standard deviation per parameter at a minimum; no wider than the box allows (variance 1/12)."""
    sd = np.sqrt(np.diag(laplace_covariance(hessian)))
    return np.asarray(sd * space.derivative(space.from_unit(point)))


def _predictive(problem: Problem, draws: FloatArray) -> xr.Dataset:
    """Simulated outputs of every test at some of the posterior draws (chain, draw, d), evenly spread."""
    samples = sum(experiment.measured.size for experiment in problem.experiments)
    most = min(PREDICTIVE_DRAWS, max(PREDICTIVE_NUMBERS // samples, FEWEST_PREDICTIVE_DRAWS))
    chains = min(len(draws), most)  # long records: not even one draw of every chain
    places = predictive_places(draws.shape[:2], (chains, min(max(1, most // chains), draws.shape[1])))
    return simulated_signals(problem, draws[places], dtype=np.float32)


def _summary(path: str, problem: Problem, mode: PosteriorMode) -> xr.Dataset:
    space, minimum = problem.space, mode.minimum
    covariance = laplace_covariance(minimum.hessian)
    scale = np.sqrt(np.diag(covariance))
    nrmsd, derivative = (found[0] for found in problem.gradients(minimum.point[None]))
    leverage = derivative * scale / np.maximum(nrmsd, np.finfo(float).tiny)[:, None]
    return group_dataset(
        path,
        {
            "value": space.from_unit(minimum.point),
            "at_bound": minimum.at_bound,
            "laplace_sd": laplace_sd(space, minimum.point, minimum.hessian),
            "noise_sd": laplace_sd(space, minimum.point, mode.noise_hessian),
            **(_of_draws(space, mode) if mode.is_sampled else {}),
            "laplace_correlation": covariance / np.outer(scale, scale),
            "nrmsd": over_tests(problem, nrmsd),
            "leverage": np.moveaxis(over_tests(problem, leverage.T), 0, -1),
        },
        {
            **parameter_axis(space.names, space.units),
            "parameter_": axis("parameter_", list(space.names)),
            **test_axes(problem),
        },
        {
            "log_evidence": mode.evidence.log_evidence,
            "log_evidence_error": mode.evidence.error,
            "probability": mode.probability,
            "log_posterior": -minimum.value,
            "gap_fundamental": float(np.sqrt(mode.sampled.score.gap_squares[0])),
            "gap_harmonics": float(np.sqrt(mode.sampled.score.gap_squares[1])),
            "converged": int(mode.chains.converged),
            "evaluations": int(mode.chains.evaluations),
            "found_by": minimum.found_by,
        },
    )


def _of_draws(space: ParameterSpace, mode: PosteriorMode) -> dict[str, ArrayLike]:
    """What the draws tell of every parameter."""
    draws, chains = mode.chains.thinned().points, mode.chains
    samples = draws.reshape(-1, len(space))
    values = space.from_unit(samples)
    q05, q50, q95 = np.quantile(values, [0.05, 0.5, 0.95], axis=0)
    found = combined(space, mode.minimum.point, mode.minimum.hessian, mode.path)
    together = {name for names, _ in found for name in names}
    return {
        "mean": values.mean(axis=0),
        "sd": values.std(axis=0),
        "q05": q05,
        "q50": q50,
        "q95": q95,
        "ess": chains.ess,
        # in the parameters' own units, as ArviZ sees them: folding does not commute with the logarithm
        "r_hat": r_hat(space.from_unit(draws)),
        "tau": chains.tau,
        "contraction": contraction(samples),
        "verdict": [
            TOGETHER if name in together else word
            for name, word in zip(space.names, verdict(samples, space.log_width), strict=True)
        ],
    }


def profile_group(path: str, space: ParameterSpace, found: Profile) -> xr.Dataset:
    """Profile likelihood of every free parameter: values and negative log posterior over (parameter, point)."""
    fixed = [space.from_unit(points)[:, k] for k, points in enumerate(found.points)]
    return group_dataset(
        path,
        {
            "value": np.stack(fixed),
            "neg_log_posterior": found.neg_log_posterior,
            "converged": found.converged.astype(np.int8),
        },
        parameter_axis(space.names, space.units),
    )


def _log_likelihood(problem: Problem, mode: PosteriorMode, draws: FloatArray) -> xr.Dataset:
    """Of every objective; costs are those that were sampled, which differ from the whole ones by a constant of each."""
    chains, count, dimension = draws.shape
    quick = mode.sampled.problem.main
    points = np.concatenate([mode.minimum.point[None], draws.reshape(-1, dimension)])
    best, *costs = quick.objectives(points) ** 2 * quick.noise.count
    once = replace(problem, simulator=problem.simulator.without_tables())
    exact = once.objectives(points[:1])[0] ** 2 * problem.noise.count
    values = test_log_likelihood(exact + np.array(costs) - best, exact, problem.noise).reshape(chains, count, -1)
    last, found = ("output",) * (len(problem.model.outputs) > 1), over_tests(problem, values)
    dims = ("chain", "draw", *last)
    return xr.Dataset(
        {
            test: quantity(dims, found[:, :, i], "1", f"log likelihood of {test}, constant left out")
            for i, test in enumerate(problem.tests)
        },
        draw_axes(draws.shape),
    )


def mixture_groups(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """The posterior of all modes together: summary, draws and the mode of each draw; nothing for a single mode."""
    if len(outcome.modes) < 2 or not all(mode.is_sampled for mode in outcome.modes):
        return {}
    space = outcome.problem.space
    draws = [mode.chains.thinned() for mode in outcome.modes]
    natural = [replace(part, points=space.from_unit(part.points)) for part in draws]
    whole = mixture(natural, [mode.probability for mode in outcome.modes])
    q05, q50, q95 = whole.quantiles([0.05, 0.5, 0.95])
    shape = draws[0].points.shape[:2]
    points, belongs = whole.draw(np.random.default_rng(outcome.configuration["seed"]), shape[0] * shape[1])
    return {
        "/mixture": group_dataset(
            "/mixture",
            {"mean": whole.mean(), "sd": whole.sd(), "q05": q05, "q50": q50, "q95": q95},
            parameter_axis(space.names, space.units),
        ),
        "/mixture/posterior": draws_dataset(space, points.reshape(*shape, -1)),
        "/mixture/sample_stats": group_dataset(
            "/mixture/sample_stats", {"mode": belongs.reshape(shape) + 1}, draw_axes(shape)
        ),
    }
