"""Steady-state curves of five loads and three pressures at once. Writes reports/tyres/curves.md.

    python scripts/studies/tyre_curves.py [--seeds 5] [--static 20] [--seed 0] [--work FOLDER]

Simulated: the slip angle of a rolling tyre goes from 0 to 10, to -10 and back to 0 degrees at 0.25 degrees per second,
under five loads and three pressures; the force follows through a carcass of spring and damper (four-stage Runge-Kutta
steps of 10 ms, equations written out here). Its TMeasy curve follows Rill's laws over load and a linear one over
pressure. Sampled at 4 Hz with 15 N of white noise. The combination in the middle of loads at the highest pressure is
left out. Two ways of a user, default settings: `mofit identify curves_*.nc --model tmeasy_curve --over
vertical_force,inflation_pressure --hold-out ...`, where the evidence chooses the laws; and `--model
tmeasy_curve_over_load`, which has them. Counted are the laws as made (slopes and forces quadratic and slips linear over
load, linear or constant over pressure), the 90 % intervals that hold the true coefficient, the error of the MAP over
the standard deviation (a 3.29th of the interval), root mean square, and the samples of the combination left out within
the 90 % band with noise. Rows that the work folder holds already are kept if the same code made them.

The carcass makes the force lag by up to 8 N at the nominal load, and a steady-state curve has no lag. Its residual is
thus coloured, which the intervals take for noise of low frequency. But it is the same in all campaigns, and has the
opposite sign on the way back, so that it moves hardly any coefficient: the intervals are wider than the estimates
scatter. Campaigns whose force is the curve itself, without a carcass (--static of them), have the errors that the model
assumes, and show it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from kept import kept
from mofit._typing import FloatArray
from mofit.cli import main as mofit
from mofit.data import Campaign, Experiment, Measurement, write_campaign
from report_page import ROOT, header, made_with, table, write_page

LOADS, PRESSURES = (1500.0, 2500.0, 3500.0, 4500.0, 5500.0), (2e5, 2.5e5, 3e5)
LEFT_OUT = (3500.0, 3e5)
NOMINAL_LOAD, NOMINAL_PRESSURE, SPEED, NOISE = 3500.0, 2.5e5, 20.0, 15.0
#: at the nominal load, at twice that, and per relative change of pressure
CURVE = {"dF0": (65e3, 110e3, 0.25), "s_M": (0.13, 0.145, 0.0), "F_M": (3400.0, 6400.0, 0.10)}
STIFFNESS, DAMPING = 120e3, 280.0
AMPLITUDE, RATE, INTERVAL, STEP = np.radians(10), np.radians(0.25), 0.25, 0.01
LAWS = {
    ("dF0", "vertical_force"): "quadratic", ("dF0", "inflation_pressure"): "linear",
    ("s_M", "vertical_force"): "linear", ("s_M", "inflation_pressure"): "constant",
    ("F_M", "vertical_force"): "quadratic", ("F_M", "inflation_pressure"): "linear",
}  # fmt: skip


def true_values(load: float, pressure: float) -> dict[str, float]:
    """TMeasy's quantities under a load and a pressure."""
    q, found = load / NOMINAL_LOAD, {}
    for name, (once, twice, change) in CURVE.items():
        over = once + (twice - once) * (q - 1) if name == "s_M" else q * (2 * once - twice / 2 - (once - twice / 2) * q)
        found[name] = over * (1 + change * (pressure / NOMINAL_PRESSURE - 1))
    return found


def angle(t: FloatArray | float) -> FloatArray:
    """Triangle of the slip angle, rad."""
    quarter = AMPLITUDE / RATE
    return np.asarray(AMPLITUDE * 2 / np.pi * np.arcsin(np.sin(np.pi / 2 * np.asarray(t) / quarter)))


def curves(carcass: bool) -> tuple[FloatArray, dict[tuple[float, float], FloatArray]]:
    """Time, and the force of every combination without noise."""
    places = list(product(LOADS, PRESSURES))
    known = {name: np.array([true_values(*at)[name] for at in places]) for name in CURVE}

    def steady(t: float) -> tuple[FloatArray, FloatArray, float]:
        slip, transport = SPEED * np.sin(angle(t)) / (SPEED * np.cos(angle(t)) + 0.01), SPEED * np.cos(angle(t)) + 0.01
        share = max(abs(slip), 1e-12) / known["s_M"]
        rising = known["dF0"] / (1 + share * (share + known["dF0"] * known["s_M"] / known["F_M"] - 2))
        tau = np.clip((share - 1) / 2, 0, 1)
        falling = known["F_M"] * (1 - 0.05 * tau**2 * (3 - 2 * tau)) / (share * known["s_M"])
        secant = np.where(share <= 1, rising, falling)
        return secant, secant * slip, transport

    def rate(t: float, y: FloatArray) -> FloatArray:
        secant, force, transport = steady(t)
        return (force - STIFFNESS * y) * transport / (transport * DAMPING + secant)

    axis, y, forces = np.arange(0, 4 * AMPLITUDE / RATE, INTERVAL), np.zeros(len(places)), []
    if not carcass:
        return axis, dict(zip(places, np.array([steady(t)[1] for t in axis]).T, strict=True))
    for t in axis:
        forces.append(STIFFNESS * y + DAMPING * rate(t, y))
        for now in t + STEP * np.arange(round(INTERVAL / STEP)):
            k1 = rate(now, y)
            k2 = rate(now + STEP / 2, y + STEP / 2 * k1)
            k3 = rate(now + STEP / 2, y + STEP / 2 * k2)
            y = y + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + rate(now + STEP, y + STEP * k3))
    return axis, dict(zip(places, np.array(forces).T, strict=True))


def written(seed: int, carcass: bool, folder: Path) -> list[Path]:
    """One campaign file per pressure."""
    folder.mkdir(parents=True, exist_ok=True)
    rng, (axis, clean), files = np.random.default_rng(seed), curves(carcass), []
    for pressure in PRESSURES:
        tests = []
        for load in LOADS:
            conditions = {"vertical_force": load, "inflation_pressure": pressure, "longitudinal_velocity": SPEED}
            experiment = Experiment(f"{load:g} N", "ramp", axis, {"slip_angle": angle(axis)}, conditions)
            noisy = clean[load, pressure] + NOISE * rng.normal(size=len(axis))
            tests.append(Measurement(experiment, {"lateral_force": noisy}, {"slip_angle": "rad", "lateral_force": "N"}))
        common = {"nominal_vertical_force": NOMINAL_LOAD}
        files.append(folder / f"curves_{pressure / 1e5:g}bar.nc")
        write_campaign(Campaign("tyre", "simulated", common, tuple(tests)), files[-1])
    return files


#: whether the force goes through a carcass
TYRES = {"with carcass": True, "without": False}
#: width of a 90 % interval of a normal distribution, in standard deviations
INTERVAL_WIDTH = 3.29
WAYS: Mapping[str, Sequence[str]] = {
    "laws by evidence": ("--model", "tmeasy_curve", "--over", "vertical_force,inflation_pressure"),
    "laws of the model": ("--model", "tmeasy_curve_over_load"),
}


def identified(way: str, files: Sequence[Path], seed: int, out: Path) -> dict[str, Any]:
    """What a user gets."""
    held_out = "vertical_force={:g},inflation_pressure={:g}".format(*LEFT_OUT)
    given = [*map(str, files), *WAYS[way], "--hold-out", held_out, "--seed", str(seed), "--jobs", "1"]
    began, printed = time.process_time(), StringIO()
    with redirect_stdout(printed):
        code = mofit(["identify", *given, "--json", "--out", str(out)])
    found = json.loads(printed.getvalue())
    chosen = {(one["parameter"], one["condition"]): one["law"] for one in (found["laws"] or {"laws": []})["laws"]}
    (left,) = (one for one in found["held_out"]["tests"] if one["role"] == "held out")
    return {
        "code": code,
        "converged": found["converged"],
        "laws": [sum(chosen[key] == form for key, form in LAWS.items()), len(LAWS)] if chosen else [],
        "parameters": {
            name: [one["value"], one["q05"], one["q95"], one["unit"], one["verdict"]]
            for name, one in found["modes"][0]["parameters"].items()
        },
        "coverage": left["coverage"],
        "seconds": time.process_time() - began,
    }


def coefficients(way: str) -> dict[str, float]:
    """True values of what is identified."""
    found = {}
    for name, (once, twice, change) in CURVE.items():
        if way == "laws of the model":
            found |= {f"{name}_N": once, f"{name}_2N": twice, f"{name}_p": change}
            continue
        low, high = (true_values(load, NOMINAL_PRESSURE)[name] / once for load in (LOADS[0], LOADS[-1]))
        found |= {
            name: once,
            f"{name}_vertical_force": (high - low) / 2,
            f"{name}_vertical_force_2": (high + low) / 2 - 1,
            f"{name}_inflation_pressure": change * (PRESSURES[-1] / NOMINAL_PRESSURE - 1),
        }
    return found


def page(rows: Mapping[tuple[str, str], Sequence[dict[str, Any]]]) -> list[str]:
    """The tables."""
    heads = (
        "tyre", "laws", "seeds", "laws as made", "converged", "90 % intervals that hold the truth", "error over sd",
        "samples left out in the 90 % band", "processor time, s",
    )  # fmt: skip
    shown = [summarised(tyre, way, own) for (tyre, way), own in rows.items()]
    details = []
    for way, options in WAYS.items():
        details += [f"## First seed: {way}", "", f"`mofit identify curves_*.nc {' '.join(options)}`", ""]
        details += table(
            ("parameter", "true", "MAP", "5 %", "95 %", "unit", "classification"),
            [(name, *(f"{v:.4g}" for v in (coefficients(way)[name], *one[:3])), *one[3:])
             for name, one in rows[next(iter(TYRES)), way][0]["parameters"].items()],
        )  # fmt: skip
    return [*table(heads, shown), *details]


def summarised(tyre: str, way: str, rows: Sequence[dict[str, Any]]) -> tuple[object, ...]:
    """A row of the first table."""
    truth, laws = coefficients(way), np.sum([row["laws"] for row in rows if row["laws"]] or [[0, 0]], axis=0)
    values = [(truth[name], *one[:3]) for row in rows for name, one in row["parameters"].items()]
    true, found, low, high = np.array(values).T
    held, coverage = (low <= true) & (true <= high), [100 * row["coverage"] for row in rows]
    error = np.sqrt(np.mean(((found - true) / (high - low) * INTERVAL_WIDTH) ** 2))
    return (
        tyre, way, len(rows), "{} of {}".format(*laws) if laws[1] else "given",
        f"{sum(row['converged'] for row in rows)} of {len(rows)}",
        f"{held.sum()} of {len(held)} ({100 * held.mean():.0f} %)", f"{error:.2f}",
        f"{np.mean(coverage):.1f} % ({min(coverage):.1f} to {max(coverage):.1f})",
        f"{np.mean([row['seconds'] for row in rows]):.0f}",
    )  # fmt: skip


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--static", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "tyre_curves")
    options = parser.parse_args()
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    counts = dict(zip(TYRES, (options.seeds, options.static), strict=True))
    for tyre, count in counts.items():
        for seed in range(options.seed, options.seed + count):
            folder = options.work / tyre.replace(" ", "_") / str(seed)
            files = written(seed, TYRES[tyre], folder)
            for way in WAYS:
                out = folder / way.replace(" ", "_")
                row = kept(out.with_suffix(".json"), partial(identified, way, files, seed, out))
                rows.setdefault((tyre, way), []).append(row)
    command = f"tyre_curves.py --seeds {options.seeds} --static {options.static} --seed {options.seed}"
    lines = header("Steady-state curves over load and pressure", __doc__, command, made_with())
    write_page("tyres", [*lines, *page(rows)], "curves.md")


if __name__ == "__main__":
    main()
