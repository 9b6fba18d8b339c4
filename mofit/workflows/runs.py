"""What a folder of runs holds: identifications and diagnoses, each reduced to what an overview shows of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mofit.errors import InputError
from mofit.results import open_result, summary

RESULT, DIAGNOSIS = "result.nc", "diagnosis.json"
PAGES = ("report.html", "diagnosis.html", "prediction.html", "batch.html", "runs.html")
"""Pages that commands write into a folder; the first that is there is opened."""

_DEEP = 2
"""Levels of folders that are looked through: runs stand in the folder, and one below in that of a batch."""
_GRADES = {"none": "good", "effect": "good", "group": "bad", "several": "good", "partly": "fair", "unknown": "bad"}


@dataclass(frozen=True)
class Estimate:
    """A parameter with its standard deviation (None where it is not known), SI units."""

    value: float
    sd: float | None
    unit: str
    verdict: str


@dataclass(frozen=True)
class RunEntry:
    """One run of a folder.

    `grade` is ``good``, ``fair`` or ``bad``. `gap` is the root mean square beyond the noise of the model without
    effects; NRMSD are those of the best mode or model.
    """

    name: str
    what: str
    """``identify`` or ``diagnose``; ``unreadable`` where the files are damaged."""
    page: str
    """Its page, relative to the folder; empty where there is none."""
    grade: str
    verdict: str
    campaign: str = ""
    model: str = ""
    created: str = ""
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    nrmsd: Mapping[str, float] = field(default_factory=dict)
    noise_floor: Mapping[str, float] = field(default_factory=dict)
    gap: float | None = None
    gap_unit: str = ""
    removed: float | None = None
    """Share of the gap that the effects remove on held-out tests."""
    warnings: tuple[str, ...] = ()


def find_runs(folder: Path) -> list[RunEntry]:
    """The runs of a folder and of the folders in it, by name; one that cannot be read has the reason as its verdict.

    Raises
    ------
    InputError
        If there is no such folder, or no run in it.
    """
    if not folder.is_dir():
        raise InputError.of(f"folder '{folder}'", "there is no such folder", "Name a folder of runs, such as runs")
    depths = ["*/" * depth for depth in range(1, _DEEP + 1)]
    places = {path.parent for depth in depths for name in (RESULT, DIAGNOSIS) for path in folder.glob(depth + name)}
    places = {place for place in places if not any(part.startswith(".") for part in place.relative_to(folder).parts)}
    if not places:
        hint = "Name the folder that holds run folders; mofit identify makes them under runs"
        raise InputError.of(f"folder '{folder}'", "there is no run in it", hint)
    return [_entry(place, folder) for place in sorted(places)]


def _entry(place: Path, folder: Path) -> RunEntry:
    name = place.relative_to(folder).as_posix()
    read = _identified if (place / RESULT).is_file() else _diagnosed
    try:
        return read(place, name)
    except InputError as error:
        return RunEntry(name, "unreadable", "", "bad", str(error))
    except (OSError, ValueError, KeyError, TypeError) as error:
        return RunEntry(name, "unreadable", "", "bad", f"{DIAGNOSIS} is damaged or of another version ({error!r})")


def _page(place: Path, name: str, file: str) -> str:
    return f"{name}/{file}" if (place / file).is_file() else ""


def _known(values: Mapping[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in values.items() if value is not None}


def _identified(place: Path, name: str) -> RunEntry:
    tree = open_result(place)
    found = summary(tree, place)
    best = found["modes"][0]
    entries = best["parameters"]
    identified = sum(entry["verdict"].startswith("identified") for entry in entries.values())
    trust = "trusted" if found["green"] else "with reservations" if found["trusted"] else "not to be trusted"
    return RunEntry(
        name=name,
        what="identify",
        page=_page(place, name, "report.html"),
        grade="good" if found["green"] else "fair" if found["trusted"] else "bad",
        verdict=f"{trust}; {identified} of {len(entries)} parameters identified",
        campaign=str(tree.attrs["campaign_title"]),
        model=str(tree.attrs["model_title"]),
        created=str(tree.attrs["created"]),
        parameters={
            key: Estimate(entry["value"], entry["sd"], entry["unit"], entry["verdict"])
            for key, entry in entries.items()
            if entry["value"] is not None
        },
        nrmsd=_known(best["nrmsd"]),
        noise_floor=_known(found["noise_floor"]),
        warnings=tuple(found["warnings"]),
    )


def _diagnosed(place: Path, name: str) -> RunEntry:
    found: dict[str, Any] = json.loads((place / DIAGNOSIS).read_text(encoding="utf-8"))
    shrinkage = found["shrinkage"]
    own = found["model_parameters"]
    return RunEntry(
        name=name,
        what="diagnose",
        page=_page(place, name, "diagnosis.html"),
        grade=_GRADES[found["verdict"]],
        verdict=found["sentence"],
        campaign=found["campaign"],
        model=found["model_title"],
        parameters={
            key: Estimate(one["after"], one["sd"], one["unit"], "at a bound" if one["at_bound"] else "")
            for key, one in own.items()
        },
        nrmsd=_known(found["nrmsd_after"]),
        noise_floor=_known(found["noise_floor"]),
        gap=found["where"]["gap"],
        gap_unit=found["where"]["unit"],
        removed=shrinkage["kinds"][-1]["share"] if shrinkage else None,
        warnings=tuple(found["warnings"]),
    )


def mean(values: Mapping[str, float]) -> float:
    """Mean over the tests; nan without any."""
    return float(np.mean(list(values.values()))) if values else float("nan")


def page_of(run: Path) -> Path:
    """The page of a run, or of a folder of runs.

    Raises
    ------
    InputError
        If there is none.
    """
    if run.is_file() and run.suffix == ".html":
        return run
    folder = run.parent if run.is_file() else run
    for name in PAGES:
        if (folder / name).is_file():
            return folder / name
    hint = "Name the folder of a run; mofit report RUN makes the page anew, mofit runs FOLDER one for a folder of runs"
    raise InputError.of(f"'{run}'", "there is no page in it" if folder.is_dir() else "there is no such folder", hint)
