"""What does mofit make of FMUs that it is given? Writes reports/fmu_in/README.md.

    python scripts/studies/fmu_in.py [--campaigns 100] [--exported N] [--beside 10] [--reference FOLDER]
                                     [--work FOLDER] [--former FOLDER]

A spring and a damper in parallel, as an FMU that PythonFMU made (FMI 2.0) and as one that mofit exported (FMI 3.0),
both for co-simulation with one communication step per sample. Stiffness and damping are drawn from the prior, uniform
on log scales; two sines of four periods are simulated in closed form, with white noise of 2 % of the range. mofit
identifies them by the FMU with at most 600 simulations, one record each (Talts et al. 2018): counted is how often a
90 % interval contains the truth. On the first campaigns the same is done by the equations in CasADi, with the same
seed, and the posterior means are compared, in standard deviations. There, too, other programs minimise the squares of
the residuals that FMPy's simulate_fmu gives from the middle of the ranges: least_squares of scipy and pyPESTO with
scipy's L-BFGS-B, both with differences. What simulate_fmu records behind a step follows the inputs that it set before
it: PythonFMU's FMU has them a sample ahead there. mofit's own carries them on by their derivatives, and is given those
of a cubic spline; without them it holds the velocity, which is a sample late then. The first period of a test does not
count, for any of them: mofit takes it for the transient. One simulation is one record, everywhere. Rows that the work
folder holds already are kept if the same code made them. Rows of former code are counted too, and compared: campaigns
that both have must have the same posterior.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

import fmu_reference
from fmu_in_page import FMUS, beside_line, calibration, former_rows
from kept import kept, made_by
from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model, Symbols, find_model
from mofit.parameters import Parameter, ParameterSpace
from mofit.simulation.evaluation.evaluations import evaluations_of, with_evaluations
from mofit.simulation.evaluation.executors import evaluated_in
from records_cases.peers import by_pypesto, by_scipy
from report_page import ROOT, header, table, write_page

sys.path.insert(0, str(ROOT / "tests" / "support"))

#: Simulations that an identification may take.
LIMIT = 600
#: Shift of a mean that is asked for, in standard deviations.
ASKED = 0.02
#: Frequencies of the tests, Hz, and their amplitude, m.
FREQUENCIES, AMPLITUDE = (1.0, 3.0), 0.01
#: Samples per period, periods per test, and noise as a share of the range of the force.
SAMPLES, PERIODS, NOISE = 40, 4, 0.02
#: Both FMUs have these names; what else they offer is left alone.
MAP = """
interface = "co-simulation"
steps = 1
[inputs]
displacement = "displacement"
velocity = { variable = "velocity", unit = "m/s", derivative_of = "displacement" }
[outputs]
force = { variable = "force", unit = "N" }
[parameters]
k = { variable = "k", unit = "N/m", lower = 100, upper = 10000, scale = "log" }
d = { variable = "d", unit = "N s/m", lower = 5, upper = 500, scale = "log" }
"""
#: Inputs of both FMUs as simulate_fmu gets them: the displacement and its derivatives, as far as they are offered.
DRIVEN = {
    "pythonfmu": ("displacement", "velocity"),
    "exported": ("displacement", "velocity", "der(displacement,2)", "der(displacement,3)", "der(displacement,4)"),
}
#: Share of a sampling interval by which they are looked up behind a sample.
AFTER = 1e-9
PEERS: dict[str, Callable[..., FloatArray]] = {"scipy + fmpy": by_scipy, "pyPESTO + fmpy": by_pypesto}


class SpringDamper(Model):
    """F = k x + d v."""

    name = "spring_damper"
    parameters = (
        Parameter("k", "N/m", 1e2, 1e4, 1e3, "log", "stiffness"),
        Parameter("d", "N s/m", 5.0, 500.0, 50.0, "log", "damping"),
    )
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)

    def equations(self, s: Symbols) -> Equations:
        """No state."""
        return Equations(outputs={"force": s.k * s.displacement + s.d * s.velocity})


def built(kind: str, work: Path) -> Path:
    """The FMU of a kind, beside the map; made where there is none."""
    folder = work / kind
    path = folder / "SpringDamper.fmu"
    if not path.exists():
        folder.mkdir(exist_ok=True)
        (folder / "map.toml").write_text(MAP, encoding="utf-8")
        if kind == "pythonfmu":
            shutil.copy(ROOT / "tests" / "support" / "spring_damper_slave.py", folder)
            command = [sys.executable, "-m", "pythonfmu", "build", "-f", "spring_damper_slave.py", "-d", "."]
            subprocess.run(command, cwd=folder, check=True, capture_output=True)
        else:
            from fmu_runs import record, run_of, stroke

            from mofit.results.fmu.archive import write_fmu

            model = SpringDamper()
            write_fmu(run_of(model, tests={"drive": record(model, stroke(), 0.002)}), model, path)
    return path


def draw(number: int) -> tuple[FloatArray, Campaign]:
    """Truth in the unit cube, drawn from the prior, and its campaign."""
    rng, space = np.random.default_rng([number, 34]), ParameterSpace(SpringDamper.parameters)
    unit = rng.random(len(space))
    k, d = space.from_unit(unit[None])[0]
    tests = []
    for frequency in FREQUENCIES:
        phase = 2 * np.pi * np.arange(SAMPLES * PERIODS) / SAMPLES
        times, x = phase / (2 * np.pi * frequency), AMPLITUDE * np.sin(phase)
        force = k * x + d * AMPLITUDE * 2 * np.pi * frequency * np.cos(phase)
        measured = force + NOISE * np.ptp(force) * rng.normal(size=len(x))
        experiment = Experiment(f"{frequency:g} Hz", "sine", times, {"displacement": x}, {}, frequency, AMPLITUDE)
        tests.append(Measurement(experiment, {"force": measured}, {"displacement": "m", "force": "N"}))
    return unit, Campaign("spring and damper", "simulated", {}, tuple(tests))


def identified(model: Model, number: int) -> tuple[FloatArray, dict[str, Any]]:
    """Draws (n, 2) of stiffness and damping in the unit cube, and what they took."""
    settings = Settings(seed=number, jobs=1, simulations=LIMIT).for_model(model)
    model, began = with_evaluations(model, settings.simulations), time.perf_counter()
    with evaluated_in(evaluations_of(model), settings.jobs):
        located = locate_minima(draw(number)[1], model, settings)
        best, *_ = sample_modes(adjusted_modes(located.posterior, located.minima, settings), settings)
    problem, about = located.problem, {"seconds": time.perf_counter() - began, "converged": best.chains.converged}
    if problem.evaluations is not None and best.emulator is not None:
        about |= {"simulations": problem.evaluations.count, "error": best.emulator.error}
    points = best.chains.thinned().points.reshape(-1, len(problem.space))
    return points[:, [problem.space.names.index(name) for name in ("k", "d")]], about


def covered(kind: str, number: int, work: Path) -> dict[str, Any]:
    """One campaign by an FMU: where the truth lies among the draws."""
    path = built(kind, work)
    found, about = identified(find_model(f"{path}:{path.with_name('map.toml')}"), number)
    place = np.mean(found < draw(number)[0], axis=0)
    return {**about, "place": place.tolist(), "mean": found.mean(axis=0).tolist(), "sd": found.std(axis=0).tolist()}


def by_equations(number: int) -> dict[str, Any]:
    """The same by the equations."""
    found, about = identified(SpringDamper(), number)
    return {**about, "mean": found.mean(axis=0).tolist(), "sd": found.std(axis=0).tolist()}


def by_peer(peer: str, kind: str, number: int, work: Path) -> dict[str, Any]:
    """Another program on an FMU: its estimate in the unit cube, and what it took."""
    import fmpy

    path, space = built(kind, work), ParameterSpace(SpringDamper.parameters)
    tests, folder = draw(number)[1].measurements, fmpy.extract(str(path))
    description, count = fmpy.read_model_description(folder), 0
    fmu = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    drives = []
    for test in tests:
        curve = CubicSpline(test.time, test.channel("displacement"))
        table_ = np.zeros(len(test.time), dtype=[(name, float) for name in ("time", *DRIVEN[kind])])
        table_["time"] = test.time - (test.experiment.step if kind == "pythonfmu" else 0.0)
        for order, name in enumerate(DRIVEN[kind]):
            # the third derivative jumps at samples: that of the step that follows
            table_[name] = curve(np.minimum(test.time + AFTER * test.experiment.step, test.time[-1]), order)
        drives.append(table_)

    def residuals(unit: FloatArray) -> FloatArray:
        nonlocal count
        values = dict(zip(("k", "d"), space.from_unit(unit[None])[0].tolist(), strict=True))
        parts = []
        for test, drive in zip(tests, drives, strict=True):
            found = fmpy.simulate_fmu(
                folder, model_description=description, fmu_instance=fmu, start_values=values, input=drive,
                output=["force"], output_interval=test.experiment.step, stop_time=test.time[-1],
                fmi_type="CoSimulation",
            )  # fmt: skip
            count += 1
            fmu.reset()
            parts.append((found["force"] - test.channel("force"))[SAMPLES:] / np.ptp(test.channel("force")))
        return np.concatenate(parts)

    began = time.perf_counter()
    estimate = PEERS[peer](residuals, np.full(2, 0.5), number)
    seconds = time.perf_counter() - began
    fmu.freeInstance()
    shutil.rmtree(folder)
    return {"estimate": estimate.tolist(), "simulations": count, "seconds": seconds}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=100)
    parser.add_argument("--exported", type=int, help="campaigns of the exported FMU; as many by default")
    parser.add_argument("--beside", type=int, default=10)
    parser.add_argument("--reference", type=Path, help="folder with reference FMUs of the FMI project")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "fmu_in")
    parser.add_argument("--former", type=Path, help="work folder with rows of former code")
    arguments = parser.parse_args()
    work, beside = arguments.work.resolve(), range(min(arguments.beside, arguments.campaigns))
    work.mkdir(parents=True, exist_ok=True)
    exported = arguments.campaigns if arguments.exported is None else arguments.exported
    counts = {kind: exported if kind == "exported" else arguments.campaigns for kind in FMUS}
    made = {
        kind: [kept(work / f"{kind}-{k}.json", partial(covered, kind, k, work)) for k in range(count)]
        for kind, count in counts.items()
    }
    equations = [kept(work / f"equations-{k}.json", partial(by_equations, k)) for k in beside]
    columns = ("by", "largest shift, sd", "sd ratio", "simulations (median)", "s (median)")
    lines, worst = [], 0.0
    for kind, title in FMUS.items():
        rows = made[kind][: len(beside)]
        lines.append(beside_line(f"mofit, FMU of {title}", [row["mean"] for row in rows], rows, equations))
        worst = max(worst, float(lines[-1][1]))
        for peer in PEERS:
            name = peer.partition(" ")[0]
            rows = [kept(work / f"{kind}-{name}-{k}.json", partial(by_peer, peer, kind, k, work)) for k in beside]
            lines.append(beside_line(f"{peer}, FMU of {title}", [row["estimate"] for row in rows], rows, equations))
    lines.append(beside_line("mofit, equations", [row["mean"] for row in equations], equations, equations))
    more = "" if arguments.exported is None else f" --exported {exported}"
    more += "" if arguments.reference is None else " --reference FOLDER"
    more += "" if arguments.former is None else " --former FOLDER"
    command = f"fmu_in.py --campaigns {arguments.campaigns} --beside {len(beside)}{more}"
    write_page("fmu_in", [
        *header("FMUs in", __doc__, command, made_by("fmpy", "pythonfmu", "pypesto")),
        *calibration(made, {kind: former_rows(kind, arguments.former) for kind in made}),
        "## Beside equations and other programs", "",
        f"The first {len(beside)} campaigns. Estimates of the other programs are points, without an interval: their "
        "shift from the posterior mean is that of a minimum of plain squares.", "", *table(columns, lines),
        f"Asked for of mofit is a shift of at most {ASKED}: {'reached' if worst <= ASKED else 'not reached'}.", "",
        *fmu_reference.section(arguments.reference, work),
    ])  # fmt: skip


if __name__ == "__main__":
    main()
