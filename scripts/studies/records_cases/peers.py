"""Other programs on the same records: least squares in the unit cube, responses by scipy's solve_ivp."""

from __future__ import annotations

import importlib
import json
import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.parameters import ParameterSpace
from records_cases.battery import CASES as BATTERY
from records_cases.battery import LOWEST
from records_cases.case import Case
from records_cases.tanks import CASES as TANKS
from records_cases.tanks import SHALLOW

Residuals = Callable[[FloatArray], FloatArray]
#: tolerance of the integrator, and step of the differences in the unit cube
TOLERANCE, DIFFERENCE = 1e-6, 1e-5
#: seconds of the processor after which a search that has no end of its own is stopped
LIMIT = 120.0


def integrated(rate: Callable[..., list[float]], start: Sequence[float], test: Measurement, channel: str) -> FloatArray:
    """States (n, time) of a test, its input running between samples as the test says."""
    time_, values, step = test.time - test.time[0], test.channel(channel), test.experiment.step

    def driven(t: float) -> float:
        if test.experiment.interpolation == "hold":
            return float(values[min(int(t / step + 1e-9), len(values) - 1)])
        return float(np.interp(t, time_, values))

    found = solve_ivp(
        lambda t, x: rate(x, driven(t)), (0.0, time_[-1]), start,
        method="LSODA", t_eval=time_, rtol=TOLERANCE, atol=TOLERANCE, max_step=step,
    )  # fmt: skip
    return found.y


def flow(level: float) -> float:
    """Torricelli's law."""
    return level / math.sqrt(math.hypot(level, SHALLOW))


def tank_level(p: dict[str, float], test: Measurement) -> FloatArray:
    """`EqualTanks` by hand."""

    def rate(x: FloatArray, pump: float) -> list[float]:
        out = p["k_1"] * flow(x[0])
        return [p["k_4"] * pump - out, out - p["k_3"] * flow(x[1])]

    return integrated(rate, (p["x_1"], p["x_2"]), test, "pump")[1]


def cell_voltage(p: dict[str, float], test: Measurement) -> FloatArray:
    """`ChargedCell` by hand."""
    low = math.exp((LOWEST - test.experiment.conditions["state_of_charge"]) / p["w"])
    series, branch = p["R_0"] * (1 + p["r_0"] * low), p["R_1"] * (1 + p["r_1"] * low)
    tau = p["tau"] * (1 + p["r_t"] * low)
    (voltage,) = integrated(lambda x, i: [(branch * i - x[0]) / tau], (0.0,), test, "current")
    return p["U_0 " + test.name] + series * test.channel("current") + voltage


@dataclass(frozen=True)
class PeerProblem:
    """A case, and its response written by hand."""

    case: Case
    response: Callable[[dict[str, float], Measurement], FloatArray]

    def unknowns(self, tests: Sequence[Measurement]) -> tuple[list[str], ParameterSpace]:
        """Names and ranges of all values: those of the campaign, then one per test."""
        parameters = self.case.model.parameters
        names = [p.name for p in parameters if p.per == "campaign"]
        own = [p.name for p in parameters if p.per == "test"]
        ranges = ParameterSpace(parameters)
        return [*names, *(f"{name} {test.name}" for name in own for test in tests)], ranges

    def values(self, names: Sequence[str], ranges: ParameterSpace, unit: FloatArray) -> dict[str, float]:
        """From the unit cube."""
        found = {}
        for name, u in zip(names, unit, strict=True):
            one = ranges.subset([name.partition(" ")[0]])
            found[name] = float(one.from_unit(np.array([[u]]))[0, 0])
        return found


PROBLEMS = (PeerProblem(TANKS[1], tank_level), PeerProblem(BATTERY[0], cell_voltage))


def by_scipy(residuals: Residuals, start: FloatArray, seed: int) -> FloatArray:
    """Trust region reflective."""
    return least_squares(residuals, start, bounds=(0, 1), diff_step=DIFFERENCE).x


def by_pypesto(residuals: Residuals, start: FloatArray, seed: int) -> FloatArray:
    """L-BFGS-B from the one start, gradients by differences."""
    pypesto, optimize = importlib.import_module("pypesto"), importlib.import_module("pypesto.optimize")
    logging.getLogger("pypesto").setLevel(logging.ERROR)

    def cost(u: FloatArray) -> tuple[float, FloatArray]:
        steps = np.diag(np.where(u > 0.5, -DIFFERENCE, DIFFERENCE))
        first, *others = (np.sum(residuals(point) ** 2) for point in (u, *(u + steps)))
        return float(first), (np.array(others) - first) / np.diag(steps)

    objective = pypesto.Objective(fun=cost, grad=True)
    problem = pypesto.Problem(
        objective, lb=np.zeros(len(start)), ub=np.ones(len(start)), x_guesses=start[None]
    )  # fmt: skip
    optimizer = optimize.ScipyOptimizer("L-BFGS-B", options={"maxfun": 300})
    found = optimize.minimize(problem, optimizer, n_starts=1, progress_bar=False)
    return np.array(found.optimize_result.list[0].x)


def by_pints(residuals: Residuals, start: FloatArray, seed: int) -> FloatArray:
    """CMA-ES, asked and told, until it stops or the time is up."""
    pints = importlib.import_module("pints")
    box = pints.RectangularBoundaries(np.zeros(len(start)), np.ones(len(start)))
    np.random.seed(seed)  # noqa: NPY002 - PINTS draws from the global generator
    optimiser, until = pints.CMAES(start, np.full(len(start), 0.2), box), time.process_time() + LIMIT
    while time.process_time() < until and not optimiser.stop():
        points = np.array(optimiser.ask())
        optimiser.tell(np.array([np.sum(residuals(point) ** 2) for point in points]))
    return np.array(optimiser.x_best())


PEERS = {
    "scipy": ("scipy", by_scipy, "trust region reflective, one start"),
    "pyPESTO": ("pypesto", by_pypesto, "L-BFGS-B with differences, one start"),
    "PINTS": ("pints", by_pints, f"CMA-ES, at most {LIMIT:.0f} s"),
}


def peer_row(peer: str, problem: PeerProblem, data: Path, work: Path, seed: int) -> dict[str, Any]:
    """One program on one case: made now, or found in the work folder."""
    module, search, note = PEERS[peer]
    row = work / f"peer-{peer}-{problem.case.name}-{seed}.json"
    about = {"peer": peer, "case": problem.case.name, "title": problem.case.title}
    if row.exists():
        return json.loads(row.read_text(encoding="utf-8"))
    try:
        importlib.import_module(module)
    except ImportError:
        return {**about, "note": "not installed"}
    campaign = problem.case.campaign(data)
    tests = campaign.select(filter(problem.case.fitted, campaign.tests)).measurements
    names, ranges = problem.unknowns(tests)
    channel, scale = problem.case.model.outputs[0].name, problem.case.unit[1]

    def errors(unit: FloatArray, of: Sequence[Measurement] = tests) -> FloatArray:
        values = problem.values(names, ranges, np.clip(unit, 0, 1))
        return scale * np.concatenate([problem.response(values, test) - test.channel(channel) for test in of])

    nominal = ranges.to_unit(ranges.nominal[None])[0]
    start = np.array([nominal[ranges.index(name.partition(" ")[0])] for name in names])
    began = time.process_time()
    best = search(errors, start, seed)
    found = {**about, "seconds": time.process_time() - began, "fit": _rms(errors(best))}
    found["note"] = f"{note} ({version(module)})"
    if problem.case.predicted:
        found["predicted"] = _rms(errors(best, campaign.select(problem.case.predicted).measurements))
    row.write_text(json.dumps(found), encoding="utf-8")
    return found


def _rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors**2)))
