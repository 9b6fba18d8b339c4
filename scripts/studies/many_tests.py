"""What do values per test cost with up to 200 tests? Writes reports/records/many_tests.md.

    python scripts/studies/many_tests.py [--tests 10,50,200]

A mass on a spring and a damper is driven by a random force, 4 s at 100 Hz, integrated by scipy. Every test has an
initial position, an initial velocity and an offset of its own: three values per test, 600 in all for 200 tests, beside
the stiffness and the damping that all share. Timed are one log posterior density, which fits the three values of every
test, in batches of 16 near the mode; value, gradient and Gauss-Newton matrix there; and search and refinement as a
whole. The last column is the largest distance of an estimate of the shared two from the truth, in its standard
deviation.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import lsim

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter
from mofit.sampling import laplace_covariance
from report_page import ROOT, header, made_with, table

STIFFNESS, DAMPING, NOISE, SAMPLES, STEP = 200.0, 5.0, 1e-3, 400, 0.01


class Oscillator(Model):
    """Unit mass on spring and damper, with a start and an offset per test."""

    name = "unit_mass"
    parameters = (
        Parameter("k", "N/m", 1.0, 1e4, 100.0, "log"),
        Parameter("d", "N s/m", 0.1, 1e3, 10.0, "log"),
        Parameter("x_start", "m", -1.0, 1.0, 0.0, per="test"),
        Parameter("v_start", "m/s", -10.0, 10.0, 0.0, per="test"),
        Parameter("offset", "m", -1.0, 1.0, 0.0, per="test"),
    )
    states = (Channel("x", "m"), Channel("v", "m/s"))
    inputs = (Channel("force", "N"),)
    outputs = (Channel("displacement", "m"),)

    def equations(self, s):
        """Newton's law."""
        return Equations(
            outputs={"displacement": s.x + s.offset},
            derivatives={"x": s.v, "v": s.force - s.k * s.x - s.d * s.v},
            initial={"x": s.x_start, "v": s.v_start},
        )


def campaign(tests: int) -> Campaign:
    """Tests that differ in everything but stiffness and damping."""
    rng, measurements = np.random.default_rng(0), []
    system = ([[0, 1], [-STIFFNESS, -DAMPING]], [[0], [1]], [[1, 0]], [[0]])
    clock = STEP * np.arange(SAMPLES)
    for k in range(tests):
        force = 10 * np.sin(2 * np.pi * STEP * np.cumsum(rng.uniform(0.2, 3.0, SAMPLES)))
        _, motion, _ = lsim(system, force, clock, X0=rng.normal(size=2) * [0.1, 1.0])
        values = motion + rng.normal(0.0, 0.01) + NOISE * rng.normal(size=SAMPLES)
        experiment = Experiment(f"test {k + 1}", "free", clock, {"force": force}, {}, interpolation="linear")
        measurements.append(Measurement(experiment, {"displacement": values}, {"force": "N", "displacement": "m"}))
    return Campaign("many tests", "simulated", {}, tuple(measurements))


def seconds(call: Callable[[FloatArray], object], points: Callable[[int], FloatArray]) -> float:
    """The least of five calls at new points each, after one that compiles."""
    call(points(0))
    found = []
    for k in range(1, 6):
        u = points(k)
        began = time.perf_counter()
        call(u)
        found.append(time.perf_counter() - began)
    return min(found)


def row(tests: int) -> tuple[str, ...]:
    """Times with so many tests."""
    data, settings = campaign(tests), Settings(evaluations=100, jobs=2)
    began = time.perf_counter()
    located = locate_minima(data, Oscillator(), settings)
    whole = time.perf_counter() - began
    minimum, adjusted = adjusted_modes(located.posterior, located.minima, settings)[0]
    space, covariance = located.posterior.space, laplace_covariance(minimum.hessian)
    sd = np.sqrt(np.diag(covariance))
    off = np.abs(minimum.point - space.to_unit([STIFFNESS, DAMPING])) / sd
    local = adjusted.local(minimum.point, sd)

    def points(seed: int) -> FloatArray:
        return np.asarray(minimum.point + sd * np.random.default_rng(seed).normal(size=(16, 2)))

    density, terms = seconds(local.log_posterior, points), seconds(local.evaluate, points)
    each = (f"{1e6 * value / 16 / tests:.0f}" for value in (density, terms))
    return (str(tests), str(3 * tests), *each, f"{whole:.1f}", f"{1e3 * whole / tests:.0f}", f"{off.max():.1f}")


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tests", default="10,50,200")
    args = parser.parse_args()
    rows = [row(int(number)) for number in args.tests.split(",")]
    heads = (
        "tests", "values per test, in all", "density, µs per set and test", "with derivatives, µs per set and test",
        "search and refinement, s", "ms per test", "off, sd",
    )  # fmt: skip
    lines = header("Values per test in many tests", __doc__, f"many_tests.py --tests {args.tests}", "Seed 0.")
    text = "\n".join([*lines, *table(heads, rows), made_with()]) + "\n"
    (ROOT / "reports" / "records" / "many_tests.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
