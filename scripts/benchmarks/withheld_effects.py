"""The blind test of the diagnosis, on campaigns with blinded labels: generate, diagnose, score.

Generator, rig and scorer are programs of their own in ``scripts/withheld``, which share no code with mofit. The
diagnosis sees campaign files only. Three of those programs open the labels: the scorer, the rig that runs a proposed
test on the same specimen, and the one that names the candidate to remove.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import mofit
from mofit.data import read_campaign
from mofit.diagnosis.candidates import choose_effects
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.result import summary
from mofit.identification.problem_setup import choose_tests
from mofit.identification.settings import Settings
from mofit.models import find_model
from studies.report_page import versions

MODEL = "maxwell_tyre"
SCRIPTS = Path(__file__).parents[1] / "withheld"
#: Campaigns without effect, with two effects, and with a variant of an effect, per campaign of one effect.
NONE, PAIRS, VARIANTS = 20, 3, 0.5
#: Most tests that are added to a campaign, one after the other, as the diagnosis advises.
ROUNDS = 3
#: Campaigns that a process diagnoses, about, before another takes its place.
_TASKS = 25
#: Parts of the package that a diagnosis does not depend on.
_ASIDE = {"cli", "design", "report", "workflows"}


def run(
    runs: int = 20, seed: int = 1, jobs: int = 1, folder: Path = Path("runs/bench")
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Generate, diagnose and score; what exists already is kept, so an interrupted run resumes.

    Parameters
    ----------
    runs
        Campaigns of each effect of the library and of each unmodelled cause; 20 times as many without effect, 3 times
        as many of two effects, half as many of each variant.
    seed
        Of the generator.
    jobs
        Processes; results do not depend on it.
    folder
        Where campaigns and results are kept.

    Returns
    -------
    rows
        One per figure: hits, count, share and its 95 % interval, or median and 90 % quantile.
    settings
        What they were made with; ``report`` is the folder of the scorer's page.
    """
    counts = {
        "none": NONE * runs,
        "per-effect": runs,
        "unmodelled": runs,
        "pairs": PAIRS * runs,
        "variants": round(VARIANTS * runs),
    }
    return checked(counts, runs, seed, jobs, folder)


def run_paper(
    runs: int = 20, seed: int = 1, jobs: int = 1, folder: Path = Path("runs/bench")
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The same on the paper's nine sines alone; ``runs`` campaigns of each effect and no others.

    These tests leave many candidate models indistinguishable. So a next experiment is often proposed. The
    question is whether it discriminates.
    """
    counts = {"none": 0, "per-effect": runs, "unmodelled": 0, "pairs": 0, "variants": 0}
    return checked(counts, runs, seed, jobs, folder, paper=True)


def checked(
    counts: Mapping[str, int], runs: int, seed: int, jobs: int, folder: Path, paper: bool = False
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """`check` with the versions in its report: the rows and settings of a benchmark."""
    settings = {"runs": runs, "seed": seed, **versions("mofit", "numpy", "scipy", "casadi")}
    report = check(counts, seed, jobs, folder, ", ".join(f"{name} {value}" for name, value in settings.items()), paper)
    figures = json.loads((report / "figures.json").read_text(encoding="utf-8"))
    return list(_rows(figures)), {**settings, "report": str(report)}


def check(counts: Mapping[str, int], seed: int, jobs: int, folder: Path, made_by: str, paper: bool = False) -> Path:
    """The folder with the scorer's report on so many campaigns of each kind (the generator's options).

    With ``paper`` the campaigns have the paper's nine sines alone, and no candidate is removed.
    """
    name = "withheld_effects_paper" if paper else "withheld_effects"
    place = folder / f"{name}-{seed}"
    options = [part for kind, count in counts.items() for part in (f"--{kind}", str(count))]
    options += ["--paper"] if paper else []
    program("generate.py", "--out", place, *options, "--seed", str(seed), "--jobs", str(jobs))
    results = place / f"results-{_code()}"
    first, without = results / "first", results / "without"
    _diagnosed(place / "campaigns", first, jobs, None)
    campaigns, diagnosed = [place / "campaigns"], [first]
    for number in range(1, ROUNDS + 1):
        following = results / f"next_{number}"
        program("append.py", place, diagnosed[-1], "--campaigns", campaigns[-1], "--out", following / "campaigns")
        _diagnosed(following / "campaigns", following, jobs, None)
        campaigns.append(following / "campaigns")
        diagnosed.append(following)
    removal: tuple[str | Path, ...] = ()
    if not paper:
        program("leave_out.py", place, "--out", results / "removed.json")
        removed = json.loads((results / "removed.json").read_text(encoding="utf-8"))
        _diagnosed(place / "campaigns", without, jobs, removed)
        removal = ("--without", without)
    program(
        "score.py", place / "labels.blinded", first, "--next", *diagnosed[1:], *removal,
        "--out", results / "report", "--made-by", f"`make bench NAME={name}`: {made_by}",
    )  # fmt: skip
    return results / "report"


def program(name: str, *arguments: str | Path) -> None:
    """Run one of the programs, in a process of its own."""
    subprocess.run([sys.executable, str(SCRIPTS / name), *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def _diagnosed(campaigns: Path, target: Path, jobs: int, removed: Mapping[str, str] | None) -> None:
    """Diagnose what is not done yet: every campaign of a folder, or those of which a candidate is removed."""
    target.mkdir(parents=True, exist_ok=True)
    files = sorted(path for path in campaigns.glob("*.nc") if removed is None or path.stem in removed)
    missing = [path for path in files if not (target / f"{path.stem}.json").exists()]
    less = [None if removed is None else removed[path.stem] for path in missing]
    # a process keeps what it compiled; after some campaigns that fills the memory. A pool that replaces its processes
    # (max_tasks_per_child) can come to rest for good (CPython issue 115634)
    for start in range(0, len(missing), jobs * _TASKS):
        part = slice(start, start + jobs * _TASKS)
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            list(pool.map(partial(diagnose_blindly, target=target), missing[part], less[part]))


def _code() -> str:
    """Digest of the code that a diagnosis depends on: its results are not those of another."""
    package = Path(mofit.__file__).parent
    digest = sha256()
    for file in sorted(package.rglob("*.py")):
        if file.relative_to(package).parts[0] not in _ASIDE:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _rows(found: Any, path: tuple[str, ...] = ()) -> Iterator[dict[str, Any]]:
    """Every share and every spread in the figures, by the keys that lead there."""
    if not isinstance(found, dict):
        return
    if {"hits", "count"} <= found.keys() or {"median", "count"} <= found.keys():
        yield {"figure": " ".join(path).replace("_", " "), **found}
    else:
        for key, value in found.items():
            yield from _rows(value, (*path, key))


def diagnose_blindly(campaign: Path, removed: str | None, target: Path) -> None:
    """Write ``<name>.json``, what ``mofit diagnose --json`` prints, and ``<name>.npz``, the held-out predictions.

    Parameters
    ----------
    campaign
        Campaign file.
    removed
        Effect that is no candidate; None for all that there are.
    target
        Folder to write into.
    """
    model, measured = find_model(MODEL), read_campaign(campaign)
    names: tuple[str, ...] = ()
    if removed is not None:
        admitted, _ = choose_effects(model, measured.select(choose_tests(model, measured)))
        names = tuple(effect.name for effect in admitted if effect.name != removed)
    found = diagnose(measured, model, names, Settings(jobs=1), simulators=_simulators())
    alone = found.shrinkage and found.shrinkage.of("test")
    if alone:
        arrays = {
            f"{one.test}/{key}": np.asarray(getattr(one, key))
            for hold_out in alone.hold_outs
            for one in hold_out.predictions
            for key in ("start", "before", "after")
        }
        np.savez_compressed(target / f"{campaign.stem}.npz", allow_pickle=False, **arrays)
    # the JSON comes last and at once: a result that is there is whole
    torn = target / f"{campaign.stem}.json.partial"
    torn.write_text(json.dumps(summary(found)) + "\n", encoding="utf-8")
    torn.replace(target / f"{campaign.stem}.json")


@cache
def _simulators() -> SimulatorCache:
    """Compiled models, kept within a process."""
    return SimulatorCache()
