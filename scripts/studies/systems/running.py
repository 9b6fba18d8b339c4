"""One run of `mofit identify` on a system: a process of its own with a limit of time."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from systems.design import Case, make
from systems.files import write_files
from systems.judge import RESULT_CODES, judged

#: Seconds of wall time that a run may take.
LIMIT = 60.0
#: Seconds between two looks at a run.
PAUSE = 0.05
#: Of prctl(2): the signal that a process gets when its parent ends.
PR_SET_PDEATHSIG = 1


def run(case: Case, seed: int, work: Path, options: tuple[str, ...] = (), limit: float = LIMIT) -> dict[str, Any]:
    """A system's row: what was said and what was true.

    Parameters
    ----------
    case
        The system.
    seed
        Decides its numbers.
    work
        Folder that keeps model, campaign, result and what was printed.
    options
        More options of ``mofit identify``.
    limit
        Seconds of wall time.
    """
    system = make(case, seed)
    folder = work / f"seed_{seed}" / case.name
    campaign, model = write_files(system, folder)
    out = folder / "run"
    for left in folder.glob("run*"):
        shutil.rmtree(left)
    command = [sys.executable, "-m", "mofit", "identify", str(campaign), "--model", model, "--out", str(out)]
    code, seconds, cpu = limited([*command, "--seed", str(seed), "--jobs", "1", "--json", *options], folder, limit)
    answer = answer_of(folder / "answer.json")
    found = judged(system, answer, code)
    return {
        "name": case.name,
        "title": case.family.title,
        "kind": case.kind,
        "label": case.label,
        "narrow": case.narrow,
        "code": code,
        "seconds": round(seconds, 1),
        "cpu_seconds": round(cpu, 1),
        "ended": code in RESULT_CODES and answer is not None,
        "left": any(folder.glob("run*/result.nc")),
        "misfit": system.misfit,
        "message": last_line(folder / "errors.txt"),
        **found,
    }


def limited(command: list[str], folder: Path, limit: float) -> tuple[int | None, float, float]:
    """Run a command; what it prints goes to files.

    Returns
    -------
    code
        Exit code; None where its time is up.
    seconds, cpu_seconds
        Wall time, and the time of the processor, which other work on the machine does not lengthen.
    """
    begun = time.perf_counter()
    with (folder / "answer.json").open("w") as answer, (folder / "errors.txt").open("w") as errors:
        process = subprocess.Popen(
            command,
            stdout=answer,
            stderr=errors,
            start_new_session=True,
            env=environment(),
            preexec_fn=_end_with_parent,
        )
    late = False
    while True:
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        seconds = time.perf_counter() - begun
        if ended:
            process.returncode = os.waitstatus_to_exitcode(status)
            return None if late else process.returncode, seconds, usage.ru_utime + usage.ru_stime
        if seconds > limit and not late:
            late = True
            os.killpg(process.pid, signal.SIGKILL)
        time.sleep(PAUSE)


def _end_with_parent() -> None:
    """The command is killed with the study: a session of its own hears nothing of that (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def environment() -> dict[str, str]:
    """One thread for linear algebra, too."""
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}


def answer_of(path: Path) -> dict[str, Any] | None:
    """The JSON object that was printed, if any."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def last_line(path: Path) -> str:
    """The last line of the messages."""
    lines = [line.strip() for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""
