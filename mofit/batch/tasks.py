"""What a batch is made of: a task per campaign, a row per result."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from mofit.campaign import Campaign
from mofit.errors import Fault, InputError, raise_errors
from mofit.result import atomic_path
from mofit.settings import Settings

SUFFIXES = (".nc", ".h5", ".hdf5")
"""Files of a folder that are taken for campaigns."""

State = Literal["done", "not converged", "failed"]


@dataclass(frozen=True)
class Task:
    """The work on one campaign.

    Parameters
    ----------
    name
        Its name in the table.
    file
        The campaign's file. On a cluster, all workers must see it under this path.
    out
        Folder of the batch; the run is written to ``out/name``, its row to ``out/rows/name.json``.
    what
        ``"identify"`` or ``"diagnose"``.
    model, effects, settings
        As for these.
    """

    name: str
    file: Path
    out: Path
    what: str
    model: str | None
    effects: tuple[str, ...]
    settings: Settings

    @property
    def folder(self) -> Path:
        """Folder of the run."""
        return self.out / self.name

    @property
    def row_file(self) -> Path:
        """File of the row."""
        return self.out / "rows" / f"{self.name}.json"

    def key(self, campaign: Campaign) -> str:
        """Hash of all that decides the result."""
        return sha256(json.dumps([campaign.hash(), decided_by(self)]).encode()).hexdigest()


@dataclass(frozen=True)
class Row:
    """The result of one campaign.

    Parameters
    ----------
    name, file
        As in the task.
    state
        ``"done"``, ``"not converged"`` or ``"failed"``.
    message
        Why it failed, or is not converged.
    conditions
        Conditions that hold for all of its tests, in SI units.
    units
        Of the conditions.
    summary
        What ``--json`` of the command prints; empty where it failed.
    key
        See `Task.key`.
    """

    name: str
    file: str
    state: State
    message: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    summary: Mapping[str, Any] = field(default_factory=dict)
    key: str = ""

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Parameters of the most probable mode; none where nothing was identified."""
        modes = self.summary.get("modes") or []
        return dict(max(modes, key=lambda mode: mode["weight"] or 0.0)["parameters"]) if modes else {}

    def write(self, path: Path) -> None:
        """Keep the row, atomically."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")


def read_row(path: Path) -> Row | None:
    """A row that is kept; None if there is none that can be read."""
    try:
        return Row(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def decided_by(task: Task) -> dict[str, Any]:
    """What decides the numbers of every campaign alike."""
    return {
        "what": task.what,
        "model": task.model,
        "effects": list(task.effects),
        **json.loads(json.dumps(task.settings.deciding())),
    }


def find_campaigns(places: Sequence[Path]) -> dict[str, Path]:
    """Files by name: those named, and those with a campaign's suffix directly in the folders named.

    Raises
    ------
    InputError
        If a place does not exist or holds nothing, or two files have one name.
    """
    files: list[Path] = []
    faults = []
    for place in places:
        found = [place] if place.is_file() else []
        if place.is_dir():
            found = sorted(path for path in place.iterdir() if path.suffix.lower() in SUFFIXES)
        if not found:
            what = f"no file that ends in {', '.join(SUFFIXES)}" if place.is_dir() else "no such file or folder"
            faults.append(Fault(str(place), what, "Name folders of campaigns, or campaigns"))
        files += found
    names = [path.stem for path in files]
    faults += [
        Fault(f"campaign '{name}'", "two files have this name", "Rename one of them")
        for name in sorted({name for name in names if names.count(name) > 1})
    ]
    if not places:
        faults.append(Fault("DIR", "none is given", "Name a folder of campaigns"))
    raise_errors(faults)
    return dict(zip(names, files, strict=True))


def require_same(out: Path, record: Path, now: Mapping[str, Any]) -> None:
    """Refuse a folder in which a batch with other settings was made.

    Raises
    ------
    InputError
        With the names of the settings that differ.
    """
    if not record.exists():
        if out.exists() and any(out.iterdir()):
            raise InputError.of(f"--out {out}", "exists already and holds no batch", "Choose another folder")
        return
    earlier = json.loads(record.read_text(encoding="utf-8"))
    differing = sorted(key for key in {*earlier, *now} if earlier.get(key) != now.get(key))
    if differing:
        raise InputError.of(
            f"--out {out}",
            f"a batch with other settings is there ({', '.join(differing)})",
            "Give the same options to go on with it, or another folder",
        )
