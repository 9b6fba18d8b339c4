"""Identify models from the measured data in ../shared/data. Writes reports/measured/README.md.

    python scripts/studies/measured.py [--data FOLDER] [--work FOLDER] [--seed 0] [--redo]

Damper: every shipped damper model on each coil current, six sine tests jointly. Silverbox: the Duffing oscillator on
the ten multisines, tested by pure simulation on the arrow, which it has not seen. Runs that the work folder holds
already are kept; --redo starts anew. The import maps under data/maps/ name source, licence and traps of the data.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np

from mofit.data import Campaign, import_files, write_campaign
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.problem import build_problem
from mofit.results import open_result, summary
from report_page import ROOT, header, made_with, table, write_page

CURRENTS = {"0A": "0 A", "0x5A": "0.5 A"}
DAMPERS = ("kelvin_voigt_damper", "maxwell_damper", "bouc_wen_damper")


def run(campaign: Campaign, model: str, folder: Path, seed: int, tests: tuple[str, ...] = ()) -> dict:
    """The summary of a run, made now or found in the work folder."""
    if not folder.exists():
        resume = folder.with_name(folder.name + ".partial").exists()
        print(f"{folder.name} ...", flush=True)
        identify(campaign, find_model(model), Settings(seed=seed), tests=tests, out=folder, resume=resume)
    return summary(open_result(folder), folder)


def relative_error(folder: Path, tests: list[str]) -> float:
    """sqrt(sum r^2 / sum F^2) over all judged samples of all tests, at the best minimum."""
    tree = open_result(folder)
    squares, total = 0.0, 0.0
    for test in tests:
        measured = tree["observed_data"][test].values
        judged = tree["constant_data"][f"{test}_weight"].values > 0
        simulated = tree["modes/m1/prediction"][test].values
        squares += np.sum((simulated - measured)[judged] ** 2)
        total += np.sum(measured[judged] ** 2)
    return float(np.sqrt(squares / total))


def dampers(data: Path, work: Path, seed: int) -> list[str]:
    """Markdown of the damper study."""
    lines = []
    for key, current in CURRENTS.items():
        campaign = import_files([data / "mr_damper_sine"], ROOT / "data" / "maps" / f"mr_damper_{key}.toml")
        write_campaign(campaign, work / f"mr_damper_{key}.nc")
        tests = [m.name for m in campaign.measurements]
        rows, found = [], {}
        for model in DAMPERS:
            folder = work / f"{key}-{model}"
            found = run(campaign, model, folder, seed)
            nrmsd = [f"{100 * found['modes'][0]['nrmsd'][t]:.2f}" for t in tests]
            rows.append([model, *nrmsd, f"{100 * relative_error(folder, tests):.2f}", yes(found["converged"])])
        rows.append(["noise floor", *(f"{100 * found['noise_floor'][t]:.2f}" for t in tests), "", ""])
        parameters = [
            [name, *(f"{entry[k]:.4g}" for k in ("value", "mean", "sd", "q05", "q95")), entry["unit"], entry["verdict"]]
            for name, entry in found["modes"][0]["parameters"].items()
        ]
        hertz = [test.removeprefix("sine_") for test in tests]
        head = ("Bouc–Wen parameter", "MAP", "mean", "sd", "5 %", "95 %", "unit", "classification")
        lines += [
            f"## Magneto-rheological damper, {current}",
            "",
            "NRMSD in %, steady part of every test (first period and run-out left out); "
            "relative error: sqrt(Σr²/ΣF²) over all six.",
            "",
            *table(("model", *hertz, "relative error %", "converged"), rows),
            *table(head, parameters),
        ]
    return lines


def yes(value: bool) -> str:
    """In words."""
    return "yes" if value else "no"


def silverbox(data: Path, work: Path, seed: int) -> list[str]:
    """Markdown of the Silverbox study: identified on the multisines, simulated on the arrow."""
    campaign = import_files([data / "silverbox"], ROOT / "data" / "maps" / "silverbox.toml")
    multisines = tuple(m.name for m in campaign.measurements if m.name.startswith("multisine"))
    arrow = campaign.select(["arrow"])
    rows = []
    for model in ("oscillator", "duffing_oscillator"):
        folder = work / f"silverbox-{model}"
        found = run(campaign, model, folder, seed, multisines)
        values = {name: entry["value"] for name, entry in found["modes"][0]["parameters"].items()}
        problem = build_problem(find_model(model), arrow)
        point = problem.space.to_unit([values[name] for name in problem.space.names])
        error = 1e3 * (problem.simulate(point[None])[0][0, :, 0] - arrow.measurements[0].channel("displacement"))
        judged = problem.experiments[0].weights[:, 0] > 0
        rms = [np.sqrt(np.mean(part**2)) for part in (error[judged], error)]
        largest = f"{np.abs(error[judged]).max():.2f}"
        rows.append([model, f"{rms[0]:.3f}", f"{rms[1]:.3f}", largest, yes(found["converged"])])
    return [
        "## Silverbox",
        "",
        "Identified on the ten multisines; error on the arrow in mV by pure simulation from rest (1 V stands for 1 m).",
        "",
        *table(("model", "rms, transient dropped", "rms, whole record", "largest", "converged"), rows),
    ]


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "measured")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--redo", action="store_true")
    options = parser.parse_args()
    if options.redo and options.work.exists():
        shutil.rmtree(options.work)
    options.work.mkdir(parents=True, exist_ok=True)
    head = header("Measured data", __doc__, f"measured.py --seed {options.seed}", made_with())
    sections = (study(options.data, options.work, options.seed) for study in (dampers, silverbox))
    write_page("measured", [*head, *(line for section in sections for line in section)])


if __name__ == "__main__":
    main()
