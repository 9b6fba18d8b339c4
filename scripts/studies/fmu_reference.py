"""The reference FMUs of the FMI project, as far as a folder has them, identified from records that scipy simulates.

They have no inputs: their states run freely from where they start. Get them from
https://github.com/modelica/Reference-FMUs, or build them there with CMake (``-D FMI_VERSION=2`` or ``3``).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from fmpy import read_model_description
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from kept import kept
from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import find_model
from mofit.simulation.evaluation.evaluations import evaluations_of
from mofit.simulation.evaluation.executors import evaluated_in
from report_page import table

#: Simulations that an identification may take, and the noise as a share of the range of each output.
LIMIT, NOISE = 300, 0.01
#: A co-simulation of FMI 2 steps by Euler's method from one communication point to the next: many of them per sample.
STEPS = 200
INTERFACES = ("model exchange", "co-simulation")
#: What a work folder of the study calls its folder of maps.
MAPS = "reference"


@dataclass(frozen=True)
class Free:
    """A reference FMU that runs freely: its outputs, its parameter with the truth, where it starts, its equations."""

    outputs: tuple[str, ...]
    parameter: str
    truth: float
    start: tuple[float, ...]
    rate: Callable[[FloatArray, float], Sequence[float]]
    times: FloatArray

    def exact(self) -> FloatArray:
        """All outputs at the truth, (n, ny)."""
        found = solve_ivp(
            lambda t, x: self.rate(x, self.truth), (0.0, float(self.times[-1])), self.start, t_eval=self.times,
            rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        return found.y.T

    def by_euler(self, value: float, steps: int) -> FloatArray:
        """All outputs by Euler's method with so many steps per sample, (n, ny)."""
        state, found = np.array(self.start), np.empty((len(self.times), len(self.start)))
        for k in range(len(self.times)):
            found[k] = state
            for _ in range(steps):
                state = state + self.times[1] / steps * np.array(self.rate(state, value))
        return found

    def best_by_euler(self, steps: int) -> float:
        """Least squares to a record without noise."""
        exact = self.exact()

        def squares(value: float) -> float:
            with np.errstate(all="ignore"):
                return float(np.sum(((self.by_euler(value, steps) - exact) / np.ptp(exact, axis=0)) ** 2))

        return float(minimize_scalar(squares, bounds=(0.7 * self.truth, 1.3 * self.truth), method="bounded").x)

    def campaign(self) -> Campaign:
        """One record of all outputs with white noise."""
        rng, measured = np.random.default_rng(34), {}
        for name, values in zip(self.outputs, self.exact().T, strict=True):
            measured[name] = values + NOISE * np.ptp(values) * rng.normal(size=len(values))
        test = Measurement(Experiment("run", "free", self.times, {}, {}), measured, dict.fromkeys(self.outputs, "1"))
        return Campaign("reference", "simulated", {}, (test,))


CASES = {
    "Dahlquist": Free(("x",), "k", 1.7, (1.0,), lambda x, k: [-k * x[0]], np.linspace(0.0, 5.0, 51)),
    "VanDerPol": Free(
        ("x0", "x1"), "mu", 2.3, (2.0, 0.0), lambda x, mu: [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]],
        np.linspace(0.0, 20.0, 401),
    ),
}  # fmt: skip
COLUMNS = ("FMU", "FMI", "interface", "parameter", "truth", "by its steps", "mean", "sd", "off, sd", "simulations", "s")


def steps_of(file: Path, case: Free) -> tuple[bool, int]:
    """Whether a co-simulation steps by itself, and Euler's steps per sample."""
    own = read_model_description(str(file)).coSimulation.fixedInternalStepSize
    return own is not None, STEPS if own is None else round(case.times[1] / float(own))


def row(file: Path, interface: str, work: Path) -> dict:
    """What mofit makes of one."""
    case, maps = CASES[file.stem], work / MAPS
    maps.mkdir(exist_ok=True)
    own, steps = steps_of(file, case)
    map_file = maps / f"{interface.replace(' ', '-')}{'-own-steps' if own else ''}.toml"
    map_file.write_text(f'interface = "{interface}"\nsteps = {1 if own else STEPS}\n', encoding="utf-8")
    model, began = find_model(f"{file}:{map_file}"), time.perf_counter()
    with evaluated_in(evaluations_of(model), 1):
        best, *_ = find_modes(case.campaign(), model, Settings(seed=0, jobs=1, simulations=LIMIT))
    problem = best.sampled.problem.main
    assert problem.evaluations is not None
    values = problem.space.from_unit(best.chains.thinned().points.reshape(-1, 1))
    return {
        "best": case.truth if interface == INTERFACES[0] else case.best_by_euler(steps),
        "mean": float(values.mean()), "sd": float(values.std()), "simulations": problem.evaluations.count,
        "seconds": time.perf_counter() - began,
    }  # fmt: skip


def section(folder: Path | None, work: Path) -> list[str]:
    """The part of the page on them."""
    files = [] if folder is None else sorted(file for name in CASES for file in folder.resolve().rglob(f"{name}.fmu"))
    title = ["## Reference FMUs of the FMI project", ""]
    if not files:
        where = (
            "https://github.com/modelica/Reference-FMUs (`cmake -S . -B build -D FMI_VERSION=2; cmake --build build`)"
        )
        return [*title, f"Not run for this page: give their folder (`--reference`). They are built from {where}.", ""]
    lines = []
    for file in files:
        version = read_model_description(str(file)).fmiVersion
        for interface in INTERFACES:
            name = f"reference-{file.stem}-{version}-{interface.replace(' ', '-')}"
            found, case = kept(work / f"{name}.json", partial(row, file, interface, work)), CASES[file.stem]
            lines.append((
                file.stem, version, interface, case.parameter, f"{case.truth:g}", f"{found['best']:.5g}",
                f"{found['mean']:.5g}", f"{found['sd']:.2g}", f"{abs(found['mean'] - found['best']) / found['sd']:.1f}",
                f"{found['simulations']} of {LIMIT}", f"{found['seconds']:.0f}",
            ))  # fmt: skip
    text = (
        "They have no inputs: their states run freely from where they start. scipy simulates one record of each, with "
        f"white noise of {100 * NOISE:g} % of the range of every output; the parameter is free from a tenth of its "
        "start value to ten times it. In co-simulation they step by Euler's method: those of FMI 3.0 in steps of their "
        f"own, those of FMI 2.0 from one communication point to the next, {STEPS} of them per sample here. Such steps "
        "err: their least squares to a record without noise lie beside the truth (by its steps), and no program could "
        "find the truth by them. The mean is compared with that."
    )
    return [*title, text, "", *table(COLUMNS, lines)]
