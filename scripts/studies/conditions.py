"""Parameters over conditions: laws recovered, a condition left out, and the cost. Writes reports/conditions/README.md.

    python scripts/studies/conditions.py [--seeds 20] [--cells 2 4 8] [--seed 0] [--work FOLDER] [--measured]

Simulated: a Maxwell damper under three loads and two pressures, integrated by a Runge-Kutta method of this script,
which shares no code with mofit. Its parameters follow laws: c is linear in load and pressure, c_M linear in load, d_M
quadratic in load, d and the offset constant. Every combination has one multisine of 8 s (0.5 to 7.5 Hz, sampled at
200 Hz: at 50 Hz the velocity from the samples is off by enough to bias d) with 2 N of white noise. One
combination (the middle load at the higher pressure) is left out. The laws are chosen by evidence, then identified
jointly (Laplace, no sampling). Counted are the laws chosen, the 90 % intervals that hold the true coefficient, the
90 % bands of the laws at the combination left out that hold the true parameter, and the standard deviation of a
parameter at a combination by the laws beside that of the combination alone. The cost is processor time over the number
of loads, laws said.

Measured (--measured): strokes of a magneto-rheological damper at 0 A and 0.5 A (mr_damper_sine) as one campaign over
current, with one stroke left out at both. Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement, import_files, joined
from mofit.identification.conditions import study_conditions
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import find_model, values_under
from mofit.results import summary
from mofit.sampling import laplace_covariance
from report_page import ROOT, header, made_with, table, write_page

LOADS, PRESSURES, LEFT_OUT = (2e3, 3e3, 4e3), (2e5, 3e5), (3e3, 3e5)
NOISE, RATE, SECONDS, STEPS = 2.0, 200.0, 8.0, 5
LINES = (4, 8, 14, 24, 40, 60)
MODEL = "maxwell_damper"
CONDITIONS = ("vertical_force", "inflation_pressure")
LAWS = {
    ("c", "vertical_force"): "linear", ("c", "inflation_pressure"): "linear",
    ("d", "vertical_force"): "constant", ("d", "inflation_pressure"): "constant",
    ("c_M", "vertical_force"): "linear", ("c_M", "inflation_pressure"): "constant",
    ("d_M", "vertical_force"): "quadratic", ("d_M", "inflation_pressure"): "constant",
    ("F_0", "vertical_force"): "constant", ("F_0", "inflation_pressure"): "constant",
}  # fmt: skip
TRUTH = {
    "c": 2e4, "d": 300.0, "c_M": 3e4, "d_M": 1500.0, "F_0": 5.0, "c_vertical_force": 0.25,
    "c_inflation_pressure": 0.10, "c_M_vertical_force": 0.20, "d_M_vertical_force": -0.15, "d_M_vertical_force_2": 0.10,
}  # fmt: skip
#: standard deviations of a 90 % interval
SIGMAS = 1.645
DRAWS = 4000


def true_values(load: float, pressure: float) -> dict[str, float]:
    """Parameters under a load and a pressure."""
    x, y = (load - 3e3) / 1e3, (pressure - 2.5e5) / 0.5e5
    return {
        "c": 2e4 * (1 + 0.25 * x) * (1 + 0.10 * y),
        "d": 300.0,
        "c_M": 3e4 * (1 + 0.20 * x),
        "d_M": 1500.0 * (1 - 0.15 * x + 0.10 * x**2),
        "F_0": 5.0,
    }


def simulated(load: float, pressure: float, rng: np.random.Generator) -> Measurement:
    """One noisy multisine, by four-stage Runge-Kutta steps."""
    values, phases = true_values(load, pressure), rng.uniform(0, 2 * np.pi, len(LINES))
    omega = 2 * np.pi * np.array(LINES) / SECONDS
    size = 0.01 / np.sqrt(np.arange(1, len(LINES) + 1))

    def stroke(t: float | FloatArray) -> FloatArray:
        return np.sin(np.multiply.outer(t, omega) + phases) @ size

    def speed(t: float | FloatArray) -> FloatArray:
        return np.cos(np.multiply.outer(t, omega) + phases) @ (size * omega)

    def rate(t: float, inner: float) -> float:
        return values["c_M"] / values["d_M"] * float(stroke(t) - inner)

    time_axis = np.arange(0, SECONDS, 1 / RATE)
    inner, step, states = float(stroke(0.0)), 1 / RATE / STEPS, []
    for t in time_axis:
        states.append(inner)
        for k in range(STEPS):
            now = t + k * step
            k1 = rate(now, inner)
            k2 = rate(now + step / 2, inner + step / 2 * k1)
            k3 = rate(now + step / 2, inner + step / 2 * k2)
            k4 = rate(now + step, inner + step * k3)
            inner += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    x = stroke(time_axis)
    force = values["c"] * x + values["d"] * speed(time_axis) + values["c_M"] * (x - np.array(states)) + values["F_0"]
    experiment = Experiment(
        f"{load:g} N {pressure:g} Pa", "free", time_axis, {"displacement": x},
        {"vertical_force": load, "inflation_pressure": pressure},
    )  # fmt: skip
    noisy = force + NOISE * rng.normal(size=len(time_axis))
    return Measurement(experiment, {"force": noisy}, {"displacement": "m", "force": "N"})


def settings(seed: int, laws: dict[str, str], over: Sequence[str] = CONDITIONS) -> Settings:
    """No progression; all else as by default."""
    return Settings(fixed={"p": 0.0}, over=tuple(over), laws=laws, sample=False, seed=seed, jobs=1)


def recovered(seed: int) -> dict[str, Any]:
    """One campaign: laws, intervals, the combination left out."""
    began, rng, model = time.process_time(), np.random.default_rng(seed), find_model(MODEL)
    tests = [simulated(load, p, rng) for load in LOADS for p in PRESSURES if (load, p) != LEFT_OUT]
    campaign, chosen = Campaign("damper", "simulated", {}, tuple(tests)), settings(seed, {})
    study = study_conditions(campaign, model, chosen)
    lawful, own = study.model(model), study.settings(chosen)
    located = locate_minima(campaign, lawful, own, start=study.fit.values)
    minimum, _ = adjusted_modes(located.posterior, located.minima, own)[0]
    space, covariance = located.posterior.space, laplace_covariance(minimum.hessian)
    values = space.from_unit(minimum.point)
    sd = np.sqrt(np.diag(covariance)) * space.derivative(values)
    right = {key for key, form in LAWS.items() if study.fit.forms[key] == form}
    drawn = space.from_unit(
        np.clip(np.random.default_rng(seed).multivariate_normal(minimum.point, covariance, DRAWS), 0, 1)
    )
    draws = dict(zip(space.names, drawn.T, strict=True))
    names = [one.name for one in study.cells.parameters if one.name not in study.fit.free]
    known = {one.name: one for one in lawful.parameters}

    def spread(at: Sequence[float], name: str) -> FloatArray:
        return values_under(known[name], study.laws, draws, dict(zip(CONDITIONS, at, strict=True)))

    left = {name: np.quantile(spread(LEFT_OUT, name), [0.05, 0.95]).tolist() for name in names}
    ratios = {
        name: [
            float(np.std(spread(at, name)) / alone)
            for at, alone in zip(study.cells.at, study.cells.sd[:, k], strict=True)
        ]
        for k, name in enumerate(one.name for one in study.cells.parameters)
        if name in names
    }
    return {
        "wrong": [f"{name} over {q}: {study.fit.forms[name, q]}" for name, q in LAWS if (name, q) not in right],
        "z": {n: float((v - TRUTH[n]) / s) for n, v, s in zip(space.names, values, sd, strict=True) if n in TRUTH},
        "left": {name: bool(low <= true_values(*LEFT_OUT)[name] <= high) for name, (low, high) in left.items()},
        "ratio": {name: float(np.median(own)) for name, own in ratios.items()},
        "seconds": time.process_time() - began,
    }


def cost(count: int) -> dict[str, Any]:
    """Processor time over the number of loads, laws said."""
    began, rng, model = time.process_time(), np.random.default_rng(count), find_model(MODEL)
    tests = [simulated(load, 2.5e5, rng) for load in np.linspace(2e3, 4e3, count)]
    laws = dict.fromkeys(("c", "c_M", "d_M"), "linear") | dict.fromkeys(("d", "F_0"), "constant")
    campaign, chosen = Campaign("damper", "simulated", {}, tuple(tests)), settings(0, laws, CONDITIONS[:1])
    study = study_conditions(campaign, model, chosen)
    alone = time.process_time()
    located = locate_minima(campaign, study.model(model), study.settings(chosen), start=study.fit.values)
    adjusted_modes(located.posterior, located.minima, chosen)
    return {"alone": alone - began, "joint": time.process_time() - alone}


def measured(data: Path, work: Path) -> dict[str, Any]:
    """The magneto-rheological damper over current, a stroke left out."""
    maps = [ROOT / "data" / "maps" / f"mr_damper_{key}.toml" for key in ("0A", "0x5A")]
    parts = [import_files([data / "mr_damper_sine"], one) for one in maps]
    campaign = joined(parts, ["0A", "0.5A"])
    left = [name for name in campaign.tests if name.endswith("1Hz") and "0.1Hz" not in name]  # 10 mm
    chosen = Settings(over=("current",), sample=False, jobs=1, seed=0, evaluations=1500)
    folder, tree = identify(campaign, "bouc_wen_damper", chosen, hold_out=left, out=work / "mr_damper")
    found = summary(tree, folder)
    return {
        "laws": {row["parameter"]: row["law"] for row in found["laws"]["laws"]},
        "parameters": {name: [e["value"], e["sd"], e["unit"]] for name, e in found["modes"][0]["parameters"].items()},
        "chi_square": [found["laws"]["chi_square"], found["laws"]["freedom"]],
        "tests": [[one["test"], one["role"], one["nrmsd"], one["coverage"]] for one in found["held_out"]["tests"]],
    }


def kept(file: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """A row from its file, or made and written there."""
    if not file.exists():
        file.write_text(json.dumps(make()), encoding="utf-8")
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def page(rows: Sequence[dict[str, Any]], costs: dict[int, dict[str, Any]], mr: dict[str, Any] | None) -> list[str]:
    """The tables."""
    held = [abs(one) <= SIGMAS for row in rows for one in row["z"].values()]
    left = [one for row in rows for one in row["left"].values()]
    right = len(LAWS) * len(rows) - sum(len(row["wrong"]) for row in rows)
    names = ("c", "d", "c_M", "d_M", "F_0")
    ratio = [np.median([row["ratio"][name] for row in rows if name in row["ratio"]]) for name in names]
    lines = [
        "## Laws recovered",
        "",
        *table(
            ("seeds", "laws as made", "90 % intervals that hold the truth", "bands that hold it, left out"),
            [(len(rows), f"{right} of {len(LAWS) * len(rows)}", share(held), share(left))],
        ),
        "Wrong laws: " + ("; ".join(one for row in rows for one in row["wrong"]) or "none") + ".",
        "",
        "Standard deviation of a parameter at a combination by the laws, relative to that of the combination alone:",
        "",
        *table(names, [[f"{value:.2f}" for value in ratio]]),
        "## Processor time over the number of loads",
        "",
        *table(
            ("loads", "each alone, s", "per load, s", "joint fit, s", "per load, s"),
            [[n, *(f"{c[key] / by:.2f}" for key in ("alone", "joint") for by in (1, n))] for n, c in costs.items()],
        ),
    ]  # fmt: skip
    if mr:
        lines += ["## The magneto-rheological damper over current", ""]
        lines += table(("parameter", "law"), list(mr["laws"].items()))
        lines += table(
            ("parameter", "value", "sd", "unit"),
            [(n, f"{v:.4g}", f"{s:.2g}", u) for n, (v, s, u) in mr["parameters"].items()],
        )
        rows_of_tests = [(n, role, f"{100 * e:.2f} %", f"{100 * c:.0f} %") for n, role, e, c in mr["tests"]]
        lines += table(("test", "role", "NRMSD", "in the 90 % band"), rows_of_tests)
    return lines


def share(flags: Sequence[bool]) -> str:
    """A share with its count."""
    return f"{sum(flags)} of {len(flags)} ({100 * sum(flags) / max(len(flags), 1):.0f} %)"


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--cells", type=int, nargs="*", default=[2, 4, 8])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "conditions")
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--measured", action="store_true")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    rows, costs = [], {}
    mr = kept(options.work / "mr.json", lambda: measured(options.data, options.work)) if options.measured else None
    for count in options.cells:
        costs[count] = kept(options.work / f"cost_{count}.json", lambda count=count: cost(count))  # type: ignore[misc]
    for seed in range(options.seed, options.seed + options.seeds):
        rows.append(kept(options.work / f"seed_{seed}.json", lambda seed=seed: recovered(seed)))  # type: ignore[misc]
        cells = " ".join(map(str, options.cells))
        command = (
            f"conditions.py --seeds {len(rows)} --cells {cells} --seed {options.seed}"
            + " --measured" * options.measured
        )
        write_page(
            "conditions", [*header("Parameters over conditions", __doc__, command, made_with()), *page(rows, costs, mr)]
        )


if __name__ == "__main__":
    main()
