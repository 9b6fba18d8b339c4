"""Does Pyomo.DoE compute the same Fisher information? Writes reports/fisher_peer/README.md.

    python scripts/studies/fisher_peer.py        (needs the extra "bench")

A sine displacement drives a Maxwell branch (stiffness c, damping d) for 4 s; its force is sampled at 100 Hz with
white noise of 2 N: c (y - x), d dx/dt = c (y - x). Pyomo.DoE computes the matrix by central differences of the
solution (`compute_FIM(method="sequential")`), discretised by Radau collocation with three points in every sampling
interval. That method fixes the parameters, so that the discretised model is linear and HiGHS (package highspy) solves
it; no executable of a non-linear solver is needed. mofit differentiates its integrator's steps exactly. The reference
integrates the sensitivity equations to 1e-12 (SciPy, DOP853).
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from mofit._typing import FloatArray
from mofit.data import Experiment
from mofit.experimental_design.information import information
from mofit.experimental_design.noise_model import ChannelNoise
from mofit.experimental_design.planned_tests import planned_tests
from mofit.models import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter
from report_page import header, made_with, table, write_page

C, D = 19910.0, 7535.0
AMPLITUDE, FREQUENCY, SECONDS, RATE, SD = 0.005, 0.5, 4.0, 100.0, 2.0
#: Relative step of Pyomo.DoE's differences; its error falls with the square until rounding stops it.
STEPS = (1e-3, 1e-4)
TIMES = np.arange(round(SECONDS * RATE)) / RATE


class Branch(Model):
    """The branch alone."""

    name = "branch"
    parameters = (Parameter("c", "N/m", 1e3, 6e4, C, "log"), Parameter("d", "N s/m", 500.0, 6e4, D, "log"))
    states = (Channel("inner", "m"),)
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s: Symbols) -> Equations:
        """One state."""
        force = s.c * (s.displacement - s.inner)
        return Equations(outputs={"force": force}, derivatives={"inner": force / s.d})


def by_mofit() -> tuple[FloatArray, list[float]]:
    """Matrix, and processor seconds of the first call (compiling) and of another."""
    experiment = Experiment("sine", "free", TIMES, {"displacement": AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * TIMES)})
    taken, found = [], np.empty(0)
    for _ in range(2):
        begun = time.process_time()
        tests = planned_tests(Branch(), [experiment], np.array([C, D]), {"force": ChannelNoise(sd=SD)})
        found = information(Branch(), tests, np.array([[C, D]]), np.ones((1, 2))).fisher
        taken.append(time.process_time() - begun)
    return found[0, 0], taken


def by_pyomo(step: float) -> tuple[FloatArray, float]:
    """Matrix and processor seconds, model building included."""
    import pyomo.environ as pyo
    from pyomo.contrib.doe import DesignOfExperiments
    from pyomo.contrib.parmest.experiment import Experiment
    from pyomo.dae import ContinuousSet, DerivativeVar

    class Test(Experiment):
        def __init__(self) -> None:
            self.model = None

        def get_labeled_model(self) -> Any:
            if self.model is None:
                self.model = self._built()
            return self.model

        def _built(self) -> Any:
            m: Any = pyo.ConcreteModel()
            m.t = ContinuousSet(bounds=(0, float(TIMES[-1])), initialize=TIMES.tolist())
            m.c, m.d, m.a = (pyo.Var(initialize=value) for value in (C, D, AMPLITUDE))
            for variable in (m.c, m.d, m.a):
                variable.fix()
            m.x, m.force = pyo.Var(m.t, initialize=0), pyo.Var(m.t, initialize=0)
            m.dx = DerivativeVar(m.x, wrt=m.t)

            def stretch(t: float) -> Any:
                return m.a * math.sin(2 * math.pi * FREQUENCY * t) - m.x[t]

            m.ode = pyo.Constraint(m.t, rule=lambda _, t: m.d * m.dx[t] == m.c * stretch(t))
            m.out = pyo.Constraint(m.t, rule=lambda _, t: m.force[t] == m.c * stretch(t))
            m.x[0].fix(0)
            pyo.TransformationFactory("dae.collocation").apply_to(m, nfe=len(TIMES) - 1, ncp=3, scheme="LAGRANGE-RADAU")
            m.nothing = pyo.Objective(expr=0.0)  # the solver wants one; the model is square
            forces = [m.force[t] for t in TIMES.tolist()]
            for name, entries in (
                ("experiment_outputs", [(v, None) for v in forces]),
                ("measurement_error", [(v, SD) for v in forces]),
                ("experiment_inputs", [(m.a, None)]),
                ("unknown_parameters", [(v, pyo.value(v)) for v in (m.c, m.d)]),
            ):
                suffix = pyo.Suffix(direction=pyo.Suffix.LOCAL)
                suffix.update(entries)
                setattr(m, name, suffix)
            return m

    begun = time.process_time()
    tool = DesignOfExperiments(Test(), fd_formula="central", step=step, solver=pyo.SolverFactory("appsi_highs"))
    found = np.array(tool.compute_FIM(method="sequential"))
    return found, time.process_time() - begun


def reference() -> FloatArray:
    """From the sensitivity equations."""

    def rates(t: float, z: FloatArray) -> list[float]:
        stretch = AMPLITUDE * math.sin(2 * math.pi * FREQUENCY * t) - z[0]
        return [C / D * stretch, stretch / D - C / D * z[1], -C / D**2 * stretch - C / D * z[2]]

    x, x_c, x_d = solve_ivp(
        rates, (0, TIMES[-1]), [0, 0, 0], t_eval=TIMES, rtol=1e-12, atol=1e-16, method="DOP853"
    ).y  # fmt: skip
    slopes = np.stack([AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * TIMES) - x - C * x_c, -C * x_d], axis=1)
    return np.asarray(slopes.T @ slopes / SD**2)


def off(found: FloatArray, other: FloatArray) -> float:
    """Largest difference, each entry relative to the geometric mean of its diagonal entries."""
    size = np.sqrt(np.outer(np.diag(other), np.diag(other)))
    return float(np.max(np.abs(found - other) / size))


def main() -> None:
    """Compute, compare, write."""
    exact = reference()
    own, (first, again) = by_mofit()
    peers = {step: by_pyomo(step) for step in STEPS}

    def row(name: str, found: FloatArray, seconds: str) -> list[str]:
        entries = (f"{value:.9e}" for value in (found[0, 0], found[0, 1], found[1, 1]))
        return [name, *entries, f"{off(found, exact):.1e}", f"{off(found, own):.1e}", seconds]

    columns = ("", "F_cc (m²/N²)", "F_cd", "F_dd", "off the reference", "off mofit", "time (s)")
    rows = [
        row("reference", exact, "–"),
        row("mofit", own, f"{again:.3f} (first call, compiling: {first:.2f})"),
        *(row(f"Pyomo.DoE, step {s:g}", found, f"{taken:.2f}") for s, (found, taken) in peers.items()),
    ]
    note = (
        "Differences are relative to the geometric mean of the two diagonal entries; times are processor seconds in "
        "one thread."
    )
    head = header("Fisher information against Pyomo.DoE", __doc__, "fisher_peer.py", note)
    write_page("fisher_peer", [*head, *table(columns, rows), made_with("pyomo", "highspy")])


if __name__ == "__main__":
    main()
