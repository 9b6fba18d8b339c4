"""Does identification report both modes of a two-mode problem? Writes reports/two_modes/README.md.

    python scripts/studies/two_modes.py [--seeds 100] [--jobs 2] [--work FOLDER] [--search mlsl]

Two constructed campaigns, simulated in closed form: a damper with two Maxwell branches, which may be exchanged exactly
(each within its own bounds), and an inclined spring whose angle enters by its square and a little by its sign, so that
the wrong sign is worse by a fraction of the noise. Noise and search get a new seed in every run. A mode counts as
reported if a mode of the result lies within five standard deviations of it in every parameter. Rows that the work
folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter, ParameterSpace
from report_page import ROOT, header, made_with, table, write_page

STANDARD_DEVIATIONS = 5.0


class TwoBranches(Model):
    """Damper with two Maxwell branches: F = d v + sum c_i (x - x_i), d_i x_i' = c_i (x - x_i)."""

    name = "two_branches"
    title = "two Maxwell branches"
    parameters = (
        Parameter("d", "N s/m", 10.0, 1e3, 200.0, "log"),
        Parameter("c_1", "N/m", 1e3, 1e5, 2e4, "log"),
        Parameter("d_1", "N s/m", 20.0, 2e4, 500.0, "log"),
        Parameter("c_2", "N/m", 2e3, 3e5, 2e4, "log"),
        Parameter("d_2", "N s/m", 50.0, 1e4, 500.0, "log"),
    )
    states = (Channel("x_1", "m"), Channel("x_2", "m"))
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        """Two states, one per branch."""
        first, second = s.c_1 * (s.displacement - s.x_1), s.c_2 * (s.displacement - s.x_2)
        return Equations(
            outputs={"force": s.d * s.velocity + first + second},
            derivatives={"x_1": first / s.d_1, "x_2": second / s.d_2},
            initial={"x_1": s.displacement, "x_2": s.displacement},
        )

    truths = ((150.0, 2e4, 3e3, 5e4, 5e2), (150.0, 5e4, 5e2, 2e4, 3e3))
    amplitude = 0.02
    frequencies = (0.5, 1.5, 4.0, 10.0)

    @classmethod
    def response(cls, x: FloatArray, v: FloatArray, frequency: float) -> FloatArray:
        """Steady force: branch i gives c_i z / (1 + z) with z = j w d_i / c_i."""
        d, c_1, d_1, c_2, d_2 = cls.truths[0]
        omega = 2 * np.pi * frequency
        stiffness = sum(c * (1j * omega * m / c) / (1 + 1j * omega * m / c) for c, m in ((c_1, d_1), (c_2, d_2)))
        return d * v + stiffness.real * x + stiffness.imag * v / omega


class InclinedSpring(Model):
    """F = k x + h phi^2 x^3 + e phi x^2: the angle phi enters by its square and, weakly, by its sign."""

    name = "inclined_spring"
    title = "inclined spring"
    parameters = (
        Parameter("k", "N/m", 0.2, 5.0, 1.0),
        Parameter("phi", "rad", -1.0, 1.0, 0.1),
    )
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"force": cubic(s.k, s.phi, s.displacement)})

    truths = ((1.0, 0.5), (1.0, -0.5))
    amplitude = 1.0
    frequencies = (0.5, 1.0, 2.0)

    @classmethod
    def response(cls, x: FloatArray, _: FloatArray, __: float) -> FloatArray:
        """The spring's law."""
        return cubic(*cls.truths[0], x)


def cubic(k, phi, x):
    """Force of the inclined spring; the last term is 0.05 standard deviations of the noise."""
    return k * x + 2.0 * phi**2 * x**3 + 0.0016 * phi * x**2


CASES = {"exchange": TwoBranches, "sign": InclinedSpring}


def campaign(case: str, seed: int) -> Campaign:
    """Sine tests with 1 % noise."""
    model = CASES[case]
    rng = np.random.default_rng([seed, len(case)])
    tests = []
    for frequency in model.frequencies:
        time = np.arange(0, 8 / frequency, 0.01 / max(1.0, frequency / 2))
        phase = 2 * np.pi * frequency * time
        x = model.amplitude * np.sin(phase)
        force = model.response(x, model.amplitude * 2 * np.pi * frequency * np.cos(phase), frequency)
        noisy = force + 0.01 * np.ptp(force) * rng.normal(size=len(force))
        experiment = Experiment(
            f"sine_{frequency:g}Hz", "sine", time, {"displacement": x}, {}, frequency, model.amplitude
        )
        tests.append(Measurement(experiment, {"force": noisy}, {"displacement": "m", "force": "N"}))
    return Campaign(f"two modes: {case}", "simulated", {}, tuple(tests))


def run(case: str, work: Path, search: str, seed: int) -> dict:
    """One identification: which of the modes are among the solutions."""
    row = work / f"{case}-{search}-{seed}.json"
    if row.exists():
        return json.loads(row.read_text())
    model = CASES[case]()
    space = ParameterSpace(model.parameters)
    modes = find_modes(campaign(case, seed), model, Settings(search=search, seed=seed, jobs=1))
    solutions = []
    for mode in modes:
        draws = space.from_unit(mode.chains.thinned().points.reshape(-1, len(space)))
        solutions.append((space.from_unit(mode.minimum.point[None])[0], draws.std(axis=0)))
    near = [
        any(np.all(np.abs(value - truth) < STANDARD_DEVIATIONS * sd) for value, sd in solutions)
        for truth in np.array(model.truths)
    ]
    found = {
        "case": case,
        "seed": seed,
        "modes": near,
        "solutions": len(solutions),
        "weights": [mode.probability for mode in modes],
        "converged": all(mode.chains.converged for mode in modes),
    }
    row.write_text(json.dumps(found))
    return found


def page(rows: list[dict], arguments: argparse.Namespace) -> list[str]:
    """The table as Markdown."""
    cells = []
    for case in CASES:
        own = [row for row in rows if row["case"] == case]
        counts = [sum(sum(row["modes"]) == k for row in own) for k in (2, 1, 0)]
        spare = sum(row["solutions"] > 2 for row in own)
        sure = sum(row["converged"] for row in own)
        cells.append([case, len(own), *counts, spare, sure])
    command = f"two_modes.py --seeds {arguments.seeds} --search {arguments.search}"
    columns = ("campaign", "runs", "both modes reported", "one", "none", "more than two modes", "converged")
    return [*header("Two modes", __doc__, command), *table(columns, cells), made_with()]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--search", default="mlsl")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "two_modes")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    rows = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for case in CASES:
            single = partial(run, case, arguments.work, arguments.search)
            for row in pool.map(single, range(arguments.seeds)):
                rows.append(row)
                if not all(row["modes"]):
                    print(row, flush=True)
    write_page("two_modes", page(rows, arguments))


if __name__ == "__main__":
    main()
