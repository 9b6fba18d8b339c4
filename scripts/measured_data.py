"""Identify models from the measured data sets in ../shared/data and write reports/measured/, a page per data set.

    python scripts/measured_data.py [--data FOLDER] [--work FOLDER] [--seed 0] [--only NAME] [--redo]

Damper: every shipped damper model on each coil current, six sine tests jointly. Silverbox: the Duffing oscillator on
the ten multisines, judged by pure simulation on the arrow, which it has not seen. Runs that are there already in the
work folder are taken as they are, so an interrupted study goes on where it was; --redo starts anew.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np

from mofit.campaign import Campaign
from mofit.campaign_file import write_campaign
from mofit.identify import identify
from mofit.library import find_model
from mofit.problem import build_problem
from mofit.readers import import_files
from mofit.result import open_result
from mofit.settings import Settings
from mofit.summary import summary
from report_header import header, versions

ROOT = Path(__file__).resolve().parents[1]
CURRENTS = {"0A": "0 A", "0x5A": "0.5 A"}
DAMPERS = ("kelvin_voigt_damper", "maxwell_damper", "bouc_wen_damper")


def run(campaign: Campaign, model: str, folder: Path, seed: int, tests: tuple[str, ...] = ()) -> dict:
    """The summary of a run, made now or found in the work folder."""
    if not folder.exists():
        resume = folder.with_name(folder.name + ".partial").exists()
        print(f"{folder.name} ...", flush=True)
        identify(campaign, find_model(model), Settings(seed=seed), tests=tests, out=folder, resume=resume)
    return summary(open_result(folder), folder)


def heading(*columns: str) -> list[str]:
    """First two lines of a Markdown table."""
    return [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]


def relative_error(folder: Path, tests: list[str]) -> float:
    """sqrt(sum r^2 / sum F^2) over all judged samples of all tests, at the best minimum."""
    tree = open_result(folder)
    squares, total = 0.0, 0.0
    for test in tests:
        measured = tree["observed_data"][test].values
        judged = tree["constant_data"][f"{test}_weight"].values > 0
        simulated = tree["clusters/c1/prediction"][test].values
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
        lines += [
            f"## Magneto-rheological damper, {current}",
            "",
            "NRMSD in %, steady part of every test (first period and run-out left out); "
            "relative error: sqrt(Σr²/ΣF²) over all six.",
            "",
            "| model | "
            + " | ".join(f"{t.removeprefix('sine_')}" for t in tests)
            + " | relative error % | converged |",
            "|---|" + "---|" * (len(tests) + 2),
        ]
        parameters = {}
        for model in DAMPERS:
            folder = work / f"{key}-{model}"
            found = run(campaign, model, folder, seed)
            best = found["modes"][0]
            cells = [f"{100 * best['nrmsd'][t]:.2f}" for t in tests]
            lines.append(
                f"| {model} | {' | '.join(cells)} | {100 * relative_error(folder, tests):.2f} | "
                f"{'yes' if found['converged'] else 'no'} |"
            )
            floor = found["noise_floor"]
            parameters[model] = best["parameters"]
        lines += [f"| noise floor | {' | '.join(f'{100 * floor[t]:.2f}' for t in tests)} | | |", ""]
        lines += [
            "| Bouc–Wen parameter | minimum | mean | sd | 5 % | 95 % | unit | verdict |",
            "|---|---|---|---|---|---|---|---|",
        ]
        for name, entry in parameters["bouc_wen_damper"].items():
            numbers = " | ".join(f"{entry[k]:.4g}" for k in ("value", "mean", "sd", "q05", "q95"))
            lines.append(f"| {name} | {numbers} | {entry['unit']} | {entry['verdict']} |")
        lines.append("")
    return lines


def silverbox(data: Path, work: Path, seed: int) -> list[str]:
    """Markdown of the Silverbox study: identified on the multisines, simulated on the arrow."""
    campaign = import_files([data / "silverbox"], ROOT / "data" / "maps" / "silverbox.toml")
    multisines = tuple(m.name for m in campaign.measurements if m.name.startswith("multisine"))
    arrow = campaign.select(["arrow"])
    lines = [
        "## Silverbox",
        "",
        "Identified on the ten multisines; error on the arrow in mV by pure simulation from rest (1 V stands for 1 m).",
        "",
        *heading("model", "rms, transient dropped", "rms, whole record", "largest", "converged"),
    ]
    for model in ("oscillator", "duffing_oscillator"):
        folder = work / f"silverbox-{model}"
        found = run(campaign, model, folder, seed, multisines)
        values = {name: entry["value"] for name, entry in found["modes"][0]["parameters"].items()}
        problem = build_problem(find_model(model), arrow)
        point = problem.space.to_unit([values[name] for name in problem.space.names])
        error = 1e3 * (problem.simulate(point[None])[0][0, :, 0] - arrow.measurements[0].channel("displacement"))
        judged = problem.drives[0].weights[:, 0] > 0
        rms = [np.sqrt(np.mean(part**2)) for part in (error[judged], error)]
        lines.append(
            f"| {model} | {rms[0]:.3f} | {rms[1]:.3f} | {np.abs(error[judged]).max():.2f} | "
            f"{'yes' if found['converged'] else 'no'} |"
        )
    return [*lines, ""]


STUDIES = {"damper": dampers, "silverbox": silverbox}


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / ".." / "shared" / "data")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "measured")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=sorted(STUDIES))
    parser.add_argument("--redo", action="store_true")
    options = parser.parse_args()
    if options.redo and options.work.exists():
        shutil.rmtree(options.work)
    options.work.mkdir(parents=True, exist_ok=True)
    target = ROOT / "reports" / "measured"
    target.mkdir(parents=True, exist_ok=True)
    for name, study in STUDIES.items():
        if options.only not in (None, name):
            continue
        note = f"{versions()}\nSource, licence and traps of the data are told in the import maps under `data/maps/`."
        head = header(f"Measured data: {name}", __doc__, f"measured_data.py --only {name} --seed {options.seed}", note)
        page = target / f"{name}.md"
        page.write_text("\n".join(head + study(options.data, options.work, options.seed)))
        print(page.relative_to(ROOT), flush=True)


if __name__ == "__main__":
    main()
