"""Synthetic runs of known rigs that keep every rule of the result layout."""

from __future__ import annotations

import json
from collections.abc import Sequence

import arviz_stats
import numpy as np
import xarray as xr
from synthetic_rigs import Rig

from mofit.results import Signal, quantity, signal_dataset


def make_result(
    rig: Rig, *, clusters: int = 2, converged: bool = True, optional: bool = True, seed: int = 0, steps: int = 120
) -> xr.DataTree:
    """A contract-conform result tree of a rig; `optional` False leaves out every group that a run may lack."""
    rng = np.random.default_rng(seed)
    clean = {trial.name: rig.response(trial, rig.truth) for trial in rig.trials}
    noise = {name: 0.01 * np.ptp(y) / 2 for name, y in clean.items()}
    measured = {name: y + noise[name] * rng.normal(size=y.size) for name, y in clean.items()}
    groups = {
        "/": _root(rig, measured, noise, converged),
        "/parameters": _parameters(rig, with_fixed=optional and rig.title == "Synthetic tyre"),
        "/observed_data": signal_dataset(
            {t.name: Signal(t.name, t.time, measured[t.name], rig.output[1], rig.output[0]) for t in rig.trials}
        ),
        "/constant_data": _constant_data(rig),
    }
    groups |= _clusters(rig, measured, clusters, converged, rng, steps)
    if optional:
        groups |= _search(rig, rng) | _per_frequency(rig, rng)
        if rig.baseline:
            groups |= _baseline(rig, measured)
        if rig.title == "Synthetic tyre":
            groups |= _calibration(rng)
    return xr.DataTree.from_dict(groups)


def _nrmsd(simulated: np.ndarray, measured: np.ndarray) -> float:
    return float(np.sqrt(np.mean((simulated - measured) ** 2)) / np.ptp(measured))


def _all_nrmsd(rig: Rig, measured: dict, values: np.ndarray) -> list[float]:
    return [_nrmsd(rig.response(t, values), measured[t.name]) for t in rig.trials]


def _root(rig: Rig, measured: dict, noise: dict, converged: bool) -> xr.Dataset:
    trials = rig.trials
    period = [1 / t.frequency if t.frequency > 0 else np.nan for t in trials]
    span = np.array([np.ptp(measured[t.name]) for t in trials])
    sd = np.array([noise[t.name] for t in trials])
    frequency = [t.frequency for t in trials]
    variables = {
        "excitation": quantity("test", [t.kind for t in trials], "1", "type of excitation"),
        "frequency": quantity("test", frequency, "Hz", "nominal frequency"),
        "amplitude": quantity("test", [t.amplitude for t in trials], rig.input[1], "amplitude of the input"),
        "period": quantity("test", period, "s", "period found in the data"),
        "periods": quantity("test", [6 if f > 0 else 0 for f in frequency], "1", "whole periods used"),
        "transient": quantity("test", [1 / f if f > 0 else 0.0 for f in frequency], "s", "time dropped at the start"),
        "noise_sd": quantity("test", sd, rig.output[1], "standard deviation of the noise"),
        "noise_floor": quantity("test", sd / span, "1", "NRMSD of the noise alone"),
        "range": quantity("test", span, rig.output[1], "peak to peak of the output"),
        "weight": quantity("test", np.ones(len(trials)), "1", "weight of the test"),
    }
    names = [t.name for t in trials]
    attributes = {
        "schema": "mofit.result/2", "title": f"Identification of {rig.title.lower()}", "mofit_version": "0.1.0",
        "created": "2025-01-31T12:00:00+00:00", "seed": 7, "model": "maxwell", "model_title": "Maxwell element",
        "campaign_title": rig.title, "campaign_source": "simulated",
        "configuration": json.dumps({"search": {"method": "mlsl", "budget": 3000}, "sample": {"ensembles": 4}}),
        "configuration_hash": "c0ffee", "campaign_hash": "beef",
        "library_versions": json.dumps({"numpy": "2.0", "casadi": "3.7"}),
        "converged": int(converged), "seconds": json.dumps({"search": 1.2, "refine": 0.4, "sample": 5.1, "total": 6.9}),
        "evaluations": json.dumps({"search": 3000, "refine": 220, "sample": 64_000}),
        "warnings": json.dumps([] if converged else ["The chains are shorter than 50 autocorrelation times <beware>."]),
    }  # fmt: skip
    return xr.Dataset(variables, {"test": quantity("test", names, "1", "test")}, attributes)


def _names(dim: str, names: Sequence[str]) -> dict[str, xr.Variable]:
    return {dim: quantity(dim, list(names), "1", dim)}


def _parameters(rig: Rig, with_fixed: bool) -> xr.Dataset:
    names, units, scales = list(rig.names), list(rig.units), list(rig.scales)
    lower, upper, nominal, role = list(rig.lower), list(rig.upper), list(rig.truth * 1.1), ["dynamic"] * len(rig.names)
    if with_fixed:
        names, units, scales = ["c_y", "p_y", *names], ["N/m", "1/m", *units], ["linear", "linear", *scales]
        lower, upper, nominal = [1e4, -50.0, *lower], [1e6, 50.0, *upper], [1.2e5, -7.5, *nominal]
        role = ["calibration", "calibration", *role]
    d = "parameter"
    return xr.Dataset(
        {
            "lower": quantity(d, lower, "1", "lower bound, in the parameter's unit"),
            "upper": quantity(d, upper, "1", "upper bound, in the parameter's unit"),
            "nominal": quantity(d, nominal, "1", "typical value, in the parameter's unit"),
            "unit": quantity(d, units, "1", "SI unit"),
            "scale": quantity(d, scales, "1", "linear or log"),
            "role": quantity(d, role, "1", "how the parameter is found"),
            "description": quantity(d, [f"what {n} means" for n in names], "1", "description"),
        },
        _names(d, names),
    )


def _constant_data(rig: Rig) -> xr.Dataset:
    signals = {}
    for t in rig.trials:
        weight = (t.time >= (1 / t.frequency if t.frequency > 0 else 0)).astype(float)
        signals[f"{t.name}_{rig.input[0]}"] = Signal(t.name, t.time, t.input, rig.input[1], rig.input[0])
        signals[f"{t.name}_weight"] = Signal(t.name, t.time, weight, "1", "weight of the samples")
    return signal_dataset(signals)


def _scaled(rig: Rig, values: np.ndarray, back: bool = False) -> np.ndarray:
    log = np.array([s == "log" for s in rig.scales])
    out = np.array(values, float)
    out[..., log] = np.exp(out[..., log]) if back else np.log(out[..., log])
    return out


def _draws(rig: Rig, rng: np.random.Generator, centre: np.ndarray, converged: bool, steps: int) -> np.ndarray:
    """Chains of ensembles, shape (4, steps * 16, d): one strong correlation, an unlearned last parameter."""
    d = len(rig.names)
    origin, width = _scaled(rig, np.maximum(rig.lower, 1e-9)), None
    width = _scaled(rig, rig.upper) - origin
    sd = 0.003 * np.geomspace(1, 4, d)
    if d > 3:
        sd[-1] = 0.25
    correlation = np.eye(d)
    if d > 2:
        correlation[1, 2] = correlation[2, 1] = -0.92
    root = np.linalg.cholesky(correlation)
    rho = 0.5 if converged else 0.995
    walk = np.empty((4, steps, 16, d))
    state = rng.normal(size=(4, 16, d))
    for k in range(steps):
        state = rho * state + np.sqrt(1 - rho**2) * rng.normal(size=state.shape)
        walk[:, k] = state + (0 if converged else 2 * np.arange(4)[:, None, None])
    unit = (_scaled(rig, centre) - origin) / width + (walk.reshape(4, -1, d) @ root.T) * sd
    unit = np.where(unit < 0, -unit, unit)
    unit = np.where(unit > 1, 2 - unit, unit)
    return _scaled(rig, origin + unit * width, back=True)


def _clusters(
    rig: Rig, measured: dict, count: int, converged: bool, rng: np.random.Generator, steps: int
) -> dict[str, xr.Dataset]:
    groups = {"/modes": xr.Dataset()}
    weights = np.geomspace(1, 0.05, count) / np.geomspace(1, 0.05, count).sum()
    for k in range(count):
        path = f"/modes/m{k + 1}"
        shift = np.ones(len(rig.names))
        shift[-1] += 0.5 * k
        if k:
            shift[0] *= 1.1
        centre = np.clip(rig.truth * shift, rig.lower, rig.upper)
        draws = _draws(rig, rng, centre, converged, steps)
        posterior = xr.Dataset(
            {
                n: quantity(("chain", "draw"), draws[..., i], rig.units[i], f"parameter {n}")
                for i, n in enumerate(rig.names)
            },
            _index(draws),
        )
        groups[path] = _cluster_summary(rig, measured, centre, posterior, draws, weights[k], converged)
        groups[f"{path}/posterior"] = posterior
        groups[f"{path}/sample_stats"] = _sample_stats(draws, steps, rng)
        some = draws[:, :: draws.shape[1] // 25][:, :25]
        predicted = {t.name: np.array([[rig.response(t, p) for p in chain] for chain in some]) for t in rig.trials}
        groups[f"{path}/posterior_predictive"] = signal_dataset(
            {t.name: Signal(t.name, t.time, predicted[t.name], rig.output[1], rig.output[0]) for t in rig.trials}
        )
        groups[f"{path}/prediction"] = signal_dataset(
            {t.name: Signal(t.name, t.time, rig.response(t, centre), rig.output[1], rig.output[0]) for t in rig.trials}
        )
        groups[f"{path}/log_likelihood"] = xr.Dataset(
            {
                t.name: quantity(("chain", "draw"), rng.normal(size=draws.shape[:2]), "1", "log-likelihood")
                for t in rig.trials
            },
            _index(draws),
        )
    return groups


def _index(draws: np.ndarray) -> dict[str, np.ndarray]:
    return {"chain": np.arange(draws.shape[0]), "draw": np.arange(draws.shape[1])}


def _sample_stats(draws: np.ndarray, steps: int, rng: np.random.Generator) -> xr.Dataset:
    walker = np.tile(np.tile(np.arange(16), steps), (4, 1))
    step = np.tile(np.repeat(np.arange(steps), 16), (4, 1))
    dims = ("chain", "draw")
    return xr.Dataset(
        {
            "lp": quantity(dims, rng.normal(size=draws.shape[:2]), "1", "log posterior"),
            "walker": quantity(dims, walker, "1", "walker of the ensemble"),
            "step": quantity(dims, step, "1", "step of the ensemble"),
        },
        _index(draws),
        {"acceptance": [0.41, 0.43, 0.40, 0.42]},
    )


def _cluster_summary(
    rig: Rig,
    measured: dict,
    centre: np.ndarray,
    posterior: xr.Dataset,
    draws: np.ndarray,
    weight: float,
    converged: bool,
) -> xr.Dataset:
    table = arviz_stats.summary(posterior, round_to="none")
    flat = draws.reshape(-1, draws.shape[-1])
    scaled = _scaled(rig, flat)
    width = _scaled(rig, rig.upper) - _scaled(rig, np.maximum(rig.lower, 1e-9))
    contraction = 1 - scaled.std(0) / (width / np.sqrt(12))
    q05, q50, q95 = np.quantile(flat, [0.05, 0.5, 0.95], axis=0)
    correlation = np.corrcoef(flat.T).reshape(len(centre), -1)
    d = "parameter"

    def own(values: np.ndarray, name: str, units: str = "1") -> xr.Variable:
        return quantity(d, values, units, name)

    return xr.Dataset(
        {
            "value": own(centre, "MAP estimate, in the parameter's unit"),
            "at_bound": own(np.where(centre >= rig.upper, 1, 0) - (centre <= rig.lower), "bound that is hit"),
            "laplace_sd": own(flat.std(0), "standard deviation from the curvature"),
            "laplace_correlation": quantity((d, "parameter_"), correlation, "1", "correlation"),
            "nrmsd": quantity("test", _all_nrmsd(rig, measured, centre), "1", "NRMSD"),
            "mean": own(table["mean"].to_numpy(), "posterior mean"),
            "sd": own(table["sd"].to_numpy(), "posterior standard deviation"),
            "q05": own(q05, "5 % quantile"),
            "q50": own(q50, "median"),
            "q95": own(q95, "95 % quantile"),
            "ess": own(table["ess_bulk"].to_numpy(), "effective sample size"),
            "r_hat": own(table["r_hat"].to_numpy(), "rank-normalised split R-hat"),
            "tau": own(np.full(len(centre), 3.0 if converged else 80.0), "autocorrelation time in steps"),
            "contraction": own(contraction, "1 - posterior sd / prior sd"),
            "verdict": own(np.where(contraction > 0.5, "identified", "not identifiable"), "verdict"),
        },
        {**_names(d, rig.names), "parameter_": list(rig.names)},
        {
            "log_evidence": float(np.log(weight)), "probability": float(weight), "log_posterior": np.log(weight) - 3,
            "converged": int(converged), "evaluations": 12_000,
        },
    )  # fmt: skip


def _search(rig: Rig, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    d, n = len(rig.names), 1500
    origin = _scaled(rig, np.maximum(rig.lower, 1e-9))
    width = _scaled(rig, rig.upper) - origin
    best = (_scaled(rig, rig.truth) - origin) / width
    spread = np.where(rng.uniform(size=(n, 1)) < 0.5, 0.05, 0.5)
    unit = np.clip(best + spread * rng.normal(size=(n, d)), 0, 1)
    objectives = len(rig.trials)
    cost = 0.005 + 0.2 * np.linalg.norm(unit - best, axis=1, keepdims=True) * rng.uniform(
        0.5, 1.5, size=(n, objectives)
    )
    cost[::97] = np.nan
    points = _scaled(rig, origin + unit * width, back=True)
    order = np.argsort(cost.mean(axis=1))
    objective = _names("objective", [t.name for t in rig.trials])
    search = xr.Dataset(
        {
            "points": quantity(("evaluation", "parameter"), points, "1", "points evaluated"),
            "nrmsd": quantity(("evaluation", "objective"), cost, "1", "NRMSD"),
            "archived": quantity(("archive", "parameter"), points[order[:200:8]], "1", "archived minima"),
            "archived_cost": quantity("archive", cost[order[:200:8]].mean(axis=1), "1", "mean NRMSD"),
            "population": quantity(("member", "parameter"), points[order[:250:10]], "1", "population"),
            "minimises": quantity("archive", [objective["objective"].values[0], *[""] * 24], "1", "objective"),
            "generations": quantity(
                ("generation", "member", "parameter"), points[[order[:500:20], order[:250:10]]], "1", "fireflies"
            ),
            "cluster": quantity(("generation", "member"), np.tile(np.arange(25) % 3, (2, 1)), "1", "cluster"),
        },
        _names("parameter", rig.names) | objective,
        {"method": "mlsl", "evaluations": n},
    )
    front = xr.Dataset(
        {
            "nrmsd": quantity(("point", "objective"), cost[order[:60]], "1", "NRMSD"),
            "parameters": quantity(("point", "parameter"), points[order[:60]], "1", "parameters"),
        },
        _names("parameter", rig.names) | objective,
    )
    return {"/search": search, "/front": front, **_fireflies(rig, points[order[:250:50]], cost[order[:250:50]])}


def _fireflies(rig: Rig, points: np.ndarray, cost: np.ndarray) -> dict[str, xr.Dataset]:
    """Some of the last generation, with their signals."""
    fireflies = xr.Dataset(
        {
            "value": quantity(("firefly", "parameter"), points, "1", "place of the firefly"),
            "nrmsd": quantity(("firefly", "objective"), cost, "1", "NRMSD"),
        },
        _names("parameter", rig.names)
        | _names("objective", [t.name for t in rig.trials])
        | _names("firefly", [str(k + 1) for k in range(len(points))]),
    )
    predicted = {
        t.name: Signal(t.name, t.time, np.array([rig.response(t, p) for p in points]), rig.output[1], rig.output[0])
        for t in rig.trials
    }
    return {"/fireflies": fireflies, "/fireflies/prediction": signal_dataset(predicted)}


def _per_frequency(rig: Rig, rng: np.random.Generator) -> dict[str, xr.Dataset]:
    shape = (len(rig.trials), 3, len(rig.names))
    value = np.clip(rig.truth * (1 + 0.15 * rng.normal(size=shape)), rig.lower, rig.upper)
    sine = np.array([t.kind == "sine" for t in rig.trials])
    value[~sine] = np.nan
    value[sine, 2] = np.where(rng.uniform(size=sine.sum())[:, None] < 0.4, np.nan, value[sine, 2])
    nrmsd = np.sort(0.006 + 0.01 * rng.uniform(size=shape[:2]), axis=1)
    nrmsd[np.isnan(value[..., 0])] = np.nan
    return {
        "/per_frequency": xr.Dataset(
            {
                "value": quantity(("test", "minimum", "parameter"), value, "1", "minimum of one test alone"),
                "nrmsd": quantity(("test", "minimum"), nrmsd, "1", "NRMSD"),
                "sd": quantity(("test", "minimum", "parameter"), 0.1 * np.abs(value), "1", "standard deviation"),
            },
            _names("parameter", rig.names) | _names("test", [t.name for t in rig.trials]),
        )
    }


def _baseline(rig: Rig, measured: dict) -> dict[str, xr.Dataset]:
    assert rig.baseline is not None
    names, simulate = rig.baseline
    signals = {t.name: Signal(t.name, t.time, simulate(t), rig.output[1], rig.output[0]) for t in rig.trials}
    nrmsd = [_nrmsd(np.asarray(signals[t.name].values), measured[t.name]) for t in rig.trials]
    own = xr.Dataset(
        {
            "value": quantity("parameter_baseline", np.full(len(names), 332.0), "1", "value"),
            "nrmsd": quantity("test", nrmsd, "1", "NRMSD"),
        },
        _names("parameter_baseline", names),
        {"model": "kelvin_voigt", "model_title": "Kelvin-Voigt element"},
    )
    return {"/baseline": own, "/baseline/prediction": signal_dataset(signals)}


def _calibration(rng: np.random.Generator) -> dict[str, xr.Dataset]:
    slip = np.radians([-4.0, -2, -1, 0, 1, 2, 4])
    curve = 2400 * np.tanh(slip * 25)
    y = np.linspace(-0.02, 0.02, 300)
    spring = 121_819 * y * (1 - 7.547 * np.abs(y))
    angles, steps = ("rad", "slip angle", 40.0), "step_1deg, step_2deg, step_4deg"
    travel = ("m", "lateral displacement", 20.0)
    stages = {
        "steady_state": (("dF_0", "s_M"), slip, curve, *angles, steps),
        "spring": (("c_y", "p_y"), y, spring, *travel, "quasi_static"),
    }
    groups = {"/calibration": xr.Dataset()}
    for stage, (names, x, force, unit, axis, noise, tests) in stages.items():
        d = f"parameter_{stage}"
        groups[f"/calibration/{stage}"] = xr.Dataset(
            {
                "value": quantity(d, [121_819.0, -7.547], "1", "value"),
                "sd": quantity(d, [300.0, 0.1], "1", "standard deviation"),
                "x": quantity("sample", x, unit, axis),
                "measured": quantity("sample", force + noise * rng.normal(size=x.size), "N", "lateral force"),
                "fitted": quantity("sample", force, "N", "lateral force, fitted"),
                "nrmsd": quantity((), 0.004, "1", "NRMSD"),
            },
            _names(d, names),
            {"model": stage, "tests": tests},
        )
    return groups
