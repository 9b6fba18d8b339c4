"""The check of the diagnosis on campaigns whose effect is withheld: generate, diagnose blindly, score.

Generator, rig and scorer are programs of their own in ``scripts/withheld`` of the repository, which share no code with
mofit; the diagnosis sees campaign files only. The sealed labels are opened by those programs: by the scorer, by the rig
that runs an advised test on the same specimen, and to say which candidate to remove where its removal is the question.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from mofit.bench.blindly import diagnose_blindly
from mofit.bench.versions import versions
from mofit.errors import InputError

SCRIPTS = Path(__file__).parents[2] / "scripts" / "withheld"
#: Campaigns without effect, with two, and with another law, per campaign of one effect.
NONE, PAIRS, KIN = 20, 3, 0.5
#: Most tests that are added to a campaign, one after the other, as the diagnosis advises.
ROUNDS = 3
#: Campaigns that a process diagnoses, about, before another takes its place.
_TASKS = 25
#: Parts of the package that a diagnosis does not depend on.
_ASIDE = {"bench", "cli", "identifiability", "report", "sample", "search"}


def run(
    runs: int = 20, seed: int = 1, jobs: int = 1, folder: Path = Path("runs/bench")
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Generate, diagnose and score; what exists already is kept, so an interrupted run goes on where it stopped.

    Parameters
    ----------
    runs
        Campaigns of each effect and each stranger; 20 times as many without effect, 3 times as many of two effects,
        half as many of each effect with another law.
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

    Raises
    ------
    InputError
        If the programs are not there: they belong to the repository, not to the installed package.
    """
    counts = {"none": NONE * runs, "per-effect": runs, "unknown": runs, "pairs": PAIRS * runs, "kin": round(KIN * runs)}
    return checked(counts, runs, seed, jobs, folder)


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
    name = "withheld-effects-paper" if paper else "withheld-effects"
    if not (SCRIPTS / "generate.py").exists():
        raise InputError.of(f"bench {name}", "scripts/withheld is not there", "Run it in the repository")
    place = folder / f"{name}-{seed}"
    options = [part for kind, count in counts.items() for part in (f"--{kind}", str(count))]
    options += ["--paper"] if paper else []
    _program("generate.py", "--out", place, *options, "--seed", str(seed), "--jobs", str(jobs))
    results = place / f"results-{_code()}"
    first, without = results / "first", results / "without"
    _diagnosed(place / "campaigns", first, jobs, None)
    campaigns, diagnosed = [place / "campaigns"], [first]
    for number in range(1, ROUNDS + 1):
        following = results / f"next_{number}"
        _program("append.py", place, diagnosed[-1], "--campaigns", campaigns[-1], "--out", following / "campaigns")
        _diagnosed(following / "campaigns", following, jobs, None)
        campaigns.append(following / "campaigns")
        diagnosed.append(following)
    removal: tuple[str | Path, ...] = ()
    if not paper:
        _program("leave_out.py", place, "--out", results / "removed.json")
        removed = json.loads((results / "removed.json").read_text(encoding="utf-8"))
        _diagnosed(place / "campaigns", without, jobs, removed)
        removal = ("--without", without)
    _program(
        "score.py", place / "labels.sealed", first, "--next", *diagnosed[1:], *removal,
        "--out", results / "report", "--made-by", f"`mofit bench {name}`: {made_by}",
    )  # fmt: skip
    return results / "report"


def _program(name: str, *arguments: str | Path) -> None:
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
    package = Path(__file__).parents[1]
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
