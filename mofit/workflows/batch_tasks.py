"""A task per campaign, the work on it in any process, and a row per result."""

from __future__ import annotations

import json
import shutil
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from mofit.data import Campaign, read_campaign
from mofit.diagnosis.page_beside import page_beside
from mofit.errors import InputError, WriteError
from mofit.identification.settings import Settings
from mofit.quantities import CONDITIONS
from mofit.results import open_result, summary
from mofit.runtime.files import write_text
from mofit.workflows.jobs import Job, diagnose_file, identify_file

State = Literal["done", "not converged", "failed"]


@dataclass(frozen=True)
class Task:
    """The work on one campaign."""

    name: str
    """Its name in the table."""
    file: Path
    """The campaign's file. On a cluster, all workers must see it under this path."""
    out: Path
    """Folder of the batch; the run is written to ``out/name``, its row to ``out/rows/name.json``."""
    what: str
    """``"identify"`` or ``"diagnose"``."""
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
    """The result of one campaign."""

    name: str
    file: str
    state: State
    """``"done"``, ``"not converged"`` or ``"failed"``."""
    message: str = ""
    """Why it failed, or is not converged."""
    conditions: Mapping[str, float] = field(default_factory=dict)
    """Conditions that hold for all of its tests, in SI units."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the conditions."""
    summary: Mapping[str, Any] = field(default_factory=dict)
    """What ``--json`` of the command prints; empty where it failed."""
    key: str = ""
    """See `Task.key`."""

    @property
    def best(self) -> dict[str, Any]:
        """The most probable mode; empty where nothing was identified."""
        modes = self.summary.get("modes") or []
        return dict(max(modes, key=lambda mode: mode["probability"] or 0.0)) if modes else {}

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """Parameters of the most probable mode; none where nothing was identified."""
        return dict(self.best.get("parameters", {}))

    def write(self, path: Path) -> None:
        """Write the row, atomically."""
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(asdict(self), indent=1) + "\n")


def read_row(path: Path) -> Row | None:
    """The row in a file; None if there is none that can be read."""
    try:
        return Row(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def decided_by(task: Task) -> dict[str, Any]:
    """All that decides the numbers beside the campaign, as JSON takes it."""
    return {"what": task.what, "model": task.model, "effects": task.effects, **task.settings.deciding()}


# matplotlib's settings are those of the process: a worker with several threads draws one page at a time
_alone = threading.Lock()


def work(task: Task) -> Row:
    """Do a task, or return its finished row; an error ends in the row, not in an exception.

    An interrupted identification is resumed.
    """
    with _alone:
        empty = Row(task.name, str(task.file), "failed")
        try:
            campaign = read_campaign(task.file)
            conditions = common_conditions(campaign)
            units = {name: campaign.units.get(name) or CONDITIONS[name].unit for name in conditions}
            empty = replace(empty, conditions=conditions, units=units, key=task.key(campaign))
            row = _kept(task, empty) or _finished(empty, _RUN[task.what](task))
        except (InputError, WriteError) as error:
            row = replace(empty, message=str(error))
        except Exception:  # noqa: BLE001 - one campaign must not stop the others
            log = task.out / f"{task.name}.log"
            log.write_text(traceback.format_exc(), encoding="utf-8")
            row = replace(empty, message=f"unexpected error, see {log.name}: {traceback.format_exc(limit=0).strip()}")
        row.write(task.row_file)
        return row


def common_conditions(campaign: Campaign) -> dict[str, float]:
    """Conditions that have the same value in all tests."""
    tests = [measurement.experiment.conditions for measurement in campaign.measurements]
    known = [name for name in tests[0] if name in CONDITIONS or name in campaign.units] if tests else []
    return {name: float(tests[0][name]) for name in known if all(own.get(name) == tests[0][name] for own in tests)}


def _kept(task: Task, empty: Row) -> Row | None:
    row = read_row(task.row_file)
    if row is None or row.state == "failed" or not task.folder.exists():
        return None
    if row.key != empty.key:
        hint = f"Remove {task.folder} to run it again"
        raise InputError.of(f"campaign '{task.name}'", "has changed since its run", hint)
    return row


def _finished(row: Row, found: dict[str, Any]) -> Row:
    converged = found.get("converged", True)
    return replace(
        row,
        state="done" if converged else "not converged",
        message="" if converged else "; ".join(found.get("warnings", [])),
        summary=found,
    )


def _identify(task: Task) -> dict[str, Any]:
    if task.folder.exists():  # finished, and ended before its row was written
        return summary(open_result(task.folder), task.folder)
    job = Job(task.file, task.model, task.effects, settings=task.settings, out=task.folder, resume=True)
    return identify_file(job)[1]


def _diagnose(task: Task) -> dict[str, Any]:
    shutil.rmtree(task.folder, ignore_errors=True)  # finished, and ended before its row was written
    job = Job(task.file, task.model, task.effects, settings=task.settings, out=task.folder)
    with page_beside() as drawn:
        return diagnose_file(job, drawn)[1]


#: what is done with a campaign, by the name of the command
_RUN: dict[str, Callable[[Task], dict[str, Any]]] = {"identify": _identify, "diagnose": _diagnose}
WORK = tuple(_RUN)
