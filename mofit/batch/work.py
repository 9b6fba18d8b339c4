"""The work on one campaign, in whatever process it is done."""

from __future__ import annotations

import shutil
import threading
import traceback
from dataclasses import replace
from pathlib import Path
from typing import Any

from mofit.batch.tasks import Row, Task, read_row
from mofit.campaign import Campaign
from mofit.campaign_file import read_campaign
from mofit.errors import InputError
from mofit.job import Job, diagnose_file, identify_file
from mofit.labels import CONDITIONS
from mofit.result import open_result
from mofit.run import PARTIAL
from mofit.summary import summary

# matplotlib's settings belong to the process: a worker with several threads draws one page at a time
_alone = threading.Lock()


def work(task: Task) -> Row:
    """Do a task, or take what is kept of it; what goes wrong ends in the row, not in an exception.

    An identification that was interrupted is taken up again.
    """
    with _alone:
        empty = Row(task.name, str(task.file), "failed")
        try:
            campaign = read_campaign(task.file)
            conditions = common_conditions(campaign)
            units = {name: campaign.units.get(name) or CONDITIONS[name].unit for name in conditions}
            empty = replace(empty, conditions=conditions, units=units, key=task.key(campaign))
            row = _kept(task, empty) or _told(empty, _identify(task) if task.what == "identify" else _diagnose(task))
        except InputError as error:
            row = replace(empty, message=str(error))
        except Exception:  # noqa: BLE001 - one campaign must not stop the others
            log = task.out / f"{task.name}.log"
            log.write_text(traceback.format_exc(), encoding="utf-8")
            row = replace(empty, message=f"unexpected error, see {log.name}: {traceback.format_exc(limit=0).strip()}")
        row.write(task.row_file)
        return row


def common_conditions(campaign: Campaign) -> dict[str, float]:
    """Conditions that have the same value in all tests."""
    tests = [measurement.procedure.conditions for measurement in campaign.measurements]
    known = [name for name in tests[0] if name in CONDITIONS or name in campaign.units] if tests else []
    return {name: float(tests[0][name]) for name in known if all(own.get(name) == tests[0][name] for own in tests)}


def _kept(task: Task, empty: Row) -> Row | None:
    row = read_row(task.row_file)
    if row is None or row.state == "failed" or not task.folder.exists():
        return None
    if row.key != empty.key:
        raise InputError.of(
            f"campaign '{task.name}'", "has changed since it was worked on", f"Remove {task.folder} to do it anew"
        )
    return row


def _told(row: Row, told: dict[str, Any]) -> Row:
    converged = told.get("converged", True)
    return replace(
        row,
        state="done" if converged else "not converged",
        message="" if converged else "; ".join(told.get("warnings", [])),
        summary=told,
    )


def _identify(task: Task) -> dict[str, Any]:
    if task.folder.exists():  # finished, and ended before its row was written
        return summary(open_result(task.folder), task.folder)
    resume = _partial(task.folder).exists()
    job = Job(task.file, task.model, task.effects, settings=task.settings, out=task.folder, resume=resume)
    return identify_file(job)[1]


def _diagnose(task: Task) -> dict[str, Any]:
    for left in (task.folder, _partial(task.folder)):
        shutil.rmtree(left, ignore_errors=True)
    return diagnose_file(task.file, task.model, task.effects, (), task.settings, task.folder)[1]


def _partial(folder: Path) -> Path:
    return folder.with_name(folder.name + PARTIAL)
