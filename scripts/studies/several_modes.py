"""Does identification report all modes where there are several? Writes reports/several_modes/README.md.

    python scripts/studies/several_modes.py [--seeds 100] [--jobs 2] [--work FOLDER] [--search effa]

Three constructed campaigns, simulated in closed form: a damper with two Maxwell branches, which may be exchanged
exactly (each within its own bounds); an inclined spring whose angle enters by its square and a little by its sign, so
that the wrong sign is worse by a fraction of the noise; and two such springs with different laws, which have four
modes. The bundled campaign has one. Noise and search get a new seed in every run, for the bundled campaign the search
alone. A mode counts as reported if a mode of the result lies within five standard deviations of it in every parameter;
of the bundled campaign, which is not sampled, if the best minimum is that of the best run. The last columns say which
stage of the search found the modes. Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement, bundled_campaign, read_campaign
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.search_registry import DEFAULT_SEARCH
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model, find_model
from mofit.optimize import STAGES
from mofit.parameters import Parameter, ParameterSpace
from mofit.runtime.parallel import end_with_parent
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


class TwoInclinedSprings(Model):
    """F = k x + h (phi^2 x^3 + psi^2 x^5) + e (phi x^2 + psi x^4): four combinations of signs are plausible."""

    name = "two_inclined_springs"
    title = "two inclined springs"
    parameters = (*InclinedSpring.parameters, Parameter("psi", "rad", -1.0, 1.0, 0.1))
    inputs = InclinedSpring.inputs
    outputs = InclinedSpring.outputs

    def equations(self, s):
        """No state."""
        return Equations(outputs={"force": quintic(s.k, s.phi, s.psi, s.displacement)})

    truths = tuple((1.0, phi, psi) for phi in (0.5, -0.5) for psi in (0.7, -0.7))
    amplitude = 1.0
    frequencies = (0.5, 1.0, 2.0)

    @classmethod
    def response(cls, x: FloatArray, _: FloatArray, __: float) -> FloatArray:
        """The law of both springs."""
        return quintic(*cls.truths[0], x)


def quintic(k, phi, psi, x):
    """Force of both springs; the even terms are so weak that no combination of signs can be ruled out."""
    return k * x + 2.0 * (phi**2 * x**3 + psi**2 * x**5) + 0.0008 * (phi * x**2 + psi * x**4)


CASES = {"exchange": TwoBranches, "sign": InclinedSpring, "signs": TwoInclinedSprings}
BUNDLED = "bundled"
#: Minima whose negative log posteriors differ by less are the same one, in nats.
SAME_MINIMUM = 0.5


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
    return Campaign(f"several modes: {case}", "simulated", {}, tuple(tests))


def run(case: str, work: Path, search: str, seed: int) -> dict:
    """One identification: which of the modes are among the solutions, and which stage of the search found them."""
    row = work / f"{case}-{search}-{seed}.json"
    if row.exists():
        return json.loads(row.read_text())
    settings = Settings(search=search, seed=seed, jobs=1)
    found = _bundled(settings) if case == BUNDLED else _constructed(case, settings)
    row.write_text(json.dumps(found))
    return found


def _bundled(settings: Settings) -> dict:
    """The bundled campaign, without sampling: value and origin of the best minimum."""
    located = locate_minima(read_campaign(bundled_campaign()), find_model("maxwell_tyre"), settings)
    best = located.minima[0]
    return {"value": best.value, "found_by": [best.found_by], "complete": located.search.complete}


def _constructed(case: str, settings: Settings) -> dict:
    model = CASES[case]()
    space = ParameterSpace(model.parameters)
    located = locate_minima(campaign(case, settings.seed), model, settings)
    modes = sample_modes(adjusted_modes(located.posterior, located.minima, settings), settings)
    solutions = []
    for mode in modes:
        draws = space.from_unit(mode.chains.thinned().points.reshape(-1, len(space)))
        solutions.append((space.from_unit(mode.minimum.point[None])[0], draws.std(axis=0)))
    near = [
        any(np.all(np.abs(value - truth) < STANDARD_DEVIATIONS * sd) for value, sd in solutions)
        for truth in np.array(model.truths)
    ]
    return {
        "modes": near,
        "solutions": len(solutions),
        "found_by": [mode.minimum.found_by for mode in modes],
        "complete": located.search.complete,
        "converged": all(mode.chains.converged for mode in modes),
    }


def page(rows: dict[str, list[dict]], arguments: argparse.Namespace) -> list[str]:
    """The table as Markdown."""
    cells = []
    for case, own in rows.items():
        stages = [stage for row in own for stage in row["found_by"]]
        origin = [stages.count(stage) for stage in STAGES]
        complete = sum(bool(row["complete"]) for row in own)
        if case == BUNDLED:
            least = min(row["value"] for row in own)
            found = sum(row["value"] < least + SAME_MINIMUM for row in own)
            cells.append([case, 1, len(own), found, "", "", *origin, complete])
        else:
            found = sum(all(row["modes"]) for row in own)
            spare = sum(row["solutions"] > len(row["modes"]) for row in own)
            converged = sum(row["converged"] for row in own)
            cells.append([case, len(CASES[case].truths), len(own), found, spare, converged, *origin, complete])
    command = f"several_modes.py --seeds {arguments.seeds} --search {arguments.search}"
    columns = (
        *("campaign", "modes", "runs", "all modes reported", "more reported", "converged"),
        *(f"modes found by the {stage}" for stage in STAGES),
        "search complete",
    )
    return [*header("Several modes", __doc__, command), *table(columns, cells), made_with()]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--search", default=DEFAULT_SEARCH)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "several_modes")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[dict]] = {}
    with ProcessPoolExecutor(arguments.jobs, initializer=end_with_parent) as pool:
        for case in (BUNDLED, *CASES):
            single = partial(run, case, arguments.work, arguments.search)
            rows[case] = list(pool.map(single, range(arguments.seeds)))
            print(case, sum(all(row.get("modes", [True])) for row in rows[case]), flush=True)
    write_page("several_modes", page(rows, arguments))


if __name__ == "__main__":
    main()
