"""A study that is killed leaves no process behind, neither of its pool nor a command that it runs."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "scripts" / "studies"
#: A pool of a spawned process, which runs a command that would take minutes: their numbers are printed.
STUDY = """
import os, sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from mofit.runtime.parallel import end_with_parent
from systems.running import limited

COMMAND = [sys.executable, "-c", "import os, time; print(os.getpid(), os.getppid(), flush=True); time.sleep(300)"]

if __name__ == "__main__":
    with ProcessPoolExecutor(1, get_context("spawn"), end_with_parent) as pool:
        pool.submit(limited, COMMAND, Path(sys.argv[1]), 300.0).result()
"""


def alive(process):
    status = Path(f"/proc/{process}/stat")
    try:
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="other systems end the command with its time only")
def test_a_killed_study_leaves_nothing_behind(tmp_path):
    script = tmp_path / "study.py"
    script.write_text(STUDY)
    paths = os.pathsep.join([str(STUDIES), *filter(None, sys.path)])
    study = subprocess.Popen([sys.executable, str(script), str(tmp_path)], env={**os.environ, "PYTHONPATH": paths})
    printed = tmp_path / "answer.json"
    while not (printed.exists() and printed.read_text().endswith("\n")):
        assert study.poll() is None
        time.sleep(0.05)
    command, worker = map(int, printed.read_text().split())
    assert alive(command)
    assert alive(worker)
    study.send_signal(signal.SIGKILL)
    study.wait()
    until = time.monotonic() + 20
    while (alive(command) or alive(worker)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not alive(command)
    assert not alive(worker)
