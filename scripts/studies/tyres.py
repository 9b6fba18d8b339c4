"""Longitudinal, combined, aligning and turning tyres from noisy data, default settings. Writes reports/tyres/README.md.

    python scripts/studies/tyres.py [--models NAME ...] [--work FOLDER] [--seed 0] [--redo]

Simulated: a tyre at 60 km/h by SciPy's LSODA (rtol 1e-8), equations written out anew (tests/support/tyre_reference.py),
with 10 N of white noise on the forces and 0.5 N m on the torque. Combined: three records of 5 s in which slip ratio and
slip angle are sines of two frequencies that have no common period; turning: the same with turn slip and slip angle. The
others: four sines of 2 s. `mofit identify` with default settings: search, refinement, sampling. Counted are the 90 %
intervals that hold the true value. Runs that the work folder holds already are kept; --redo starts anew.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mofit.data import Campaign, Measurement
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.results import summary
from report_page import ROOT, header, made_with, table, write_page

sys.path.insert(0, str(ROOT / "tests" / "support"))
import tyre_reference as reference  # type: ignore[import-not-found]

NOISE, TORQUE_NOISE = 10.0, 0.5
SINES = ((0.15, 1.0), (0.04, 2.0), (0.02, 5.0), (0.05, 8.0))
TRAIL = {"n_0": 0.035, "s_0": 0.18}
TURN = {"l_phi": 0.03, "m_phi": 170.0}


def longitudinal(rng: np.random.Generator) -> Campaign:
    """Four sines of the slip ratio."""
    time_axis, tests = np.arange(200) * 0.01, []
    for amplitude, frequency in SINES:
        ratio = reference.ratio_of(amplitude, frequency)
        forces = reference.forces({}, time_axis, ratio, None)
        tests.append(reference.measurement(f"{frequency} Hz", time_axis, {"slip_ratio": ratio}, forces, NOISE, rng))
    return reference.campaign(*tests)


def combined(rng: np.random.Generator) -> Campaign:
    """Both slips at frequencies that have no common period in the record."""
    time_axis, tests = np.arange(250) * 0.02, list[Measurement]()
    for ratio, angle, first, second in ((0.04, 0.03, 0.3, 0.5), (0.03, 0.05, 1.7, 1.1), (0.12, 0.12, 2.9, 4.3)):
        signals = {"slip_ratio": reference.ratio_of(ratio, first), "slip_angle": reference.ratio_of(angle, second)}
        forces = reference.forces({}, time_axis, *signals.values())
        tests.append(reference.measurement(str(len(tests) + 1), time_axis, signals, forces, NOISE, rng))
    return reference.campaign(*tests)


def aligning(rng: np.random.Generator) -> Campaign:
    """Four sines of the slip angle, with the torque of TMeasy's trail at the slip of the contact patch."""
    time_axis, tests = np.arange(200) * 0.01, []
    for amplitude, frequency in SINES:
        angle = reference.ratio_of(amplitude, frequency)
        forces = reference.forces({}, time_axis, None, angle)
        test = reference.measurement(f"{frequency} Hz", time_axis, {"slip_angle": angle}, forces, NOISE, rng)
        torque = reference.aligning_torque(forces[1], angle(time_axis), **TRAIL)
        tests.append(with_torque(test, torque + TORQUE_NOISE * rng.normal(size=len(time_axis))))
    return reference.campaign(*tests)


def turning(rng: np.random.Generator) -> Campaign:
    """Slip angle and turn slip (curves of 12 m and more) at frequencies that have no common period in the record."""
    time_axis, tests = np.arange(250) * 0.02, list[Measurement]()
    for turn, angle, first, second in ((0.04, 0.03, 0.3, 0.5), (0.08, 0.05, 1.7, 1.1), (0.06, 0.12, 2.9, 4.3)):
        curved, steered = reference.ratio_of(turn, first), reference.ratio_of(angle, second)
        forces = reference.forces(TURN, time_axis, None, steered, turn_slip=curved)
        signals = {"slip_angle": steered, "turn_slip": curved}
        test = reference.measurement(str(len(tests) + 1), time_axis, signals, forces, NOISE, rng)
        phi = curved(time_axis)
        torque = reference.aligning_torque(forces[1], steered(time_axis), **TRAIL, turned=TURN["l_phi"] * phi)
        noisy = torque + TURN["m_phi"] * phi + TORQUE_NOISE * rng.normal(size=len(time_axis))
        tests.append(with_torque(test, noisy))
    return reference.campaign(*tests)


def with_torque(test: Measurement, torque: np.ndarray) -> Measurement:
    """The test with a self-aligning torque beside the force."""
    outputs, units = {**test.outputs, "self_aligning_torque": torque}, {**test.units, "self_aligning_torque": "N m"}
    return replace(test, outputs=outputs, units=units)


CASES: Mapping[str, tuple[Callable[[np.random.Generator], Campaign], Mapping[str, float]]] = {
    "maxwell_tyre_longitudinal": (longitudinal, reference.LONGITUDINAL),
    "maxwell_tyre_aligning": (aligning, {**reference.LATERAL, **TRAIL}),
    "maxwell_tyre_turning": (turning, {**reference.LATERAL, **TRAIL, **TURN}),
    "maxwell_tyre_combined": (combined, {**reference.LATERAL, **reference.LONGITUDINAL}),
}


def identified(name: str, seed: int, folder: Path) -> dict[str, Any]:
    """The default identification, beside the truth."""
    make, truth = CASES[name]
    began, clock = time.process_time(), time.perf_counter()
    run, tree = identify(make(np.random.default_rng(seed)), name, Settings(seed=seed, jobs=1), out=folder)
    found = summary(tree, run)
    mode = found["modes"][0]
    return {
        "parameters": {
            key: [truth[key], one["value"], one["q05"], one["q95"], one["unit"], one["verdict"]]
            for key, one in mode["parameters"].items()
        },
        "converged": found["converged"],
        "modes": len(found["modes"]),
        "nrmsd": max(mode["nrmsd"].values()),
        "processor": time.process_time() - began,
        "seconds": time.perf_counter() - clock,
    }


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", nargs="*", default=list(CASES))
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "tyres")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--redo", action="store_true")
    options = parser.parse_args()
    if options.redo:
        shutil.rmtree(options.work, ignore_errors=True)
    options.work.mkdir(parents=True, exist_ok=True)
    rows, details = [], []
    for name in options.models:
        file = options.work / f"{name}.json"
        if not file.exists():
            file.write_text(json.dumps(identified(name, options.seed, options.work / name)), encoding="utf-8")
        found = json.loads(file.read_text(encoding="utf-8"))
        values = found["parameters"]
        held = sum(low <= true <= high for true, _, low, high, _, _ in values.values())
        rows.append(
            (name, len(values), f"{held} of {len(values)}", "yes" if found["converged"] else "no", found["modes"],
             f"{100 * found['nrmsd']:.2f} %", f"{found['processor']:.0f}", f"{found['seconds']:.0f}")
        )  # fmt: skip
        details += [f"## {name}", ""]
        details += table(
            ("parameter", "true", "MAP", "5 %", "95 %", "unit", "classification"),
            [(key, *(f"{v:.4g}" for v in one[:4]), *one[4:]) for key, one in values.items()],
        )
        heads = (
            "model", "parameters", "90 % intervals that hold the truth", "converged", "modes", "largest NRMSD",
            "processor time, s", "elapsed, s",
        )  # fmt: skip
        command = f"tyres.py --seed {options.seed}"
        note = f"{made_with()} Elapsed times are those of a machine that others used, too."
        write_page("tyres", [*header("Tyres", __doc__, command, note), *table(heads, rows), *details])


if __name__ == "__main__":
    main()
