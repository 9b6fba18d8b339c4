"""``--time-limit`` and ``--no-sample``: a command ends in time, with what it knows."""

import contextlib
import importlib
import json
import logging
import subprocess
import sys
import time

import pytest
from damper_rig import damper_campaign

from mofit.cli import main
from mofit.cli.app import seconds
from mofit.cli.time_limit import TimeIsUp, time_limit
from mofit.data import write_campaign
from mofit.errors import InputError


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("limit") / "damper.nc"
    write_campaign(damper_campaign(), path)
    return str(path)


@pytest.mark.parametrize(("text", "expected"), [("60s", 60), ("90", 90), ("1.5 min", 90), ("1e3 ms", 1), (None, None)])
def test_a_time_is_read_with_and_without_unit(text, expected):
    assert seconds("--time-limit", text) == (None if expected is None else pytest.approx(expected))


def test_what_is_no_time_is_refused():
    with pytest.raises(InputError, match="--time-limit"):
        seconds("--time-limit", "soon")


def test_the_block_ends_when_the_time_is_up_and_only_then():
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        time.sleep(5)
    with time_limit("20 ms") as limit:
        assert limit == pytest.approx(0.02)
    time.sleep(0.03)  # the alarm is off


def test_an_import_is_not_torn_apart_by_the_end_of_the_time(tmp_path, monkeypatch):
    (tmp_path / "slow_to_import.py").write_text("import time\ntime.sleep(0.1)\nwhole = True\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        _import_and_sleep("slow_to_import")
    assert sys.modules.pop("slow_to_import").whole


def _import_and_sleep(name):
    importlib.import_module(name)
    time.sleep(5)


class _Slow(logging.Handler):
    def emit(self, record):
        time.sleep(0.1)
        self.whole = record.msg


def test_a_log_is_not_left_locked_by_the_end_of_the_time():
    log, slow = logging.getLogger("slow"), _Slow()
    log.addHandler(slow)
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        _log_and_sleep(log)
    log.removeHandler(slow)
    assert slow.whole == "whole"
    assert slow.lock.acquire(timeout=1)
    slow.lock.release()


def _log_and_sleep(log):
    log.warning("whole")
    time.sleep(5)


class _SlowToDestroy:
    def __del__(self):
        time.sleep(0.1)


def test_an_end_that_a_destructor_swallows_is_told_again(capsys):
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        _destroy_and_sleep()
    assert capsys.readouterr().err == ""


def _destroy_and_sleep():
    _SlowToDestroy()
    time.sleep(5)


def test_an_end_that_somebody_catches_is_told_again():
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        _catch_and_sleep()


def _catch_and_sleep():
    with contextlib.suppress(BaseException):
        time.sleep(5)
    time.sleep(5)


def test_what_cleans_up_behind_the_end_is_not_torn_apart():
    cleaned = []
    with pytest.raises(TimeIsUp), time_limit("10 ms"):
        _sleep_and_clean(cleaned)
    assert cleaned == ["whole"]


def _sleep_and_clean(cleaned):
    try:
        time.sleep(5)
    finally:
        with contextlib.suppress(OSError):
            raise OSError
        time.sleep(0.1)
        cleaned.append("whole")


FORKS = """
import multiprocessing, os, time
from mofit.cli.time_limit import TimeIsUp, time_limit

def slow():
    time.sleep(0.1)
    print("whole")

os.register_at_fork(after_in_parent=slow)
try:
    with time_limit("10 ms"):
        multiprocessing.get_context("fork").Process(target=int).start()
        time.sleep(5)
except TimeIsUp:
    print("time is up")
"""


def test_a_fork_is_not_torn_apart_by_the_end_of_the_time():
    done = subprocess.run([sys.executable, "-c", FORKS], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("whole\ntime is up\n", "")


def test_without_sampling_there_are_estimates_marked_as_such(file, tmp_path, capsys):
    options = ["--model", "kelvin_voigt_damper", "--jobs", "1", "--no-sample", "--json"]
    assert main(["identify", file, *options, "--out", str(tmp_path / "run")]) == 3
    told = json.loads(capsys.readouterr().out)
    (mode,) = told["modes"]
    assert mode["parameters"]["d"]["value"] == pytest.approx(1500, rel=0.01)
    assert {entry["spread"] for entry in mode["parameters"].values()} == {"Laplace"}
    assert {entry["verdict"] for entry in mode["parameters"].values()} == {"not sampled"}
    assert not told["green"]
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "Nothing was sampled" in page
    assert main(["uncertainty", str(tmp_path / "run")]) == 3  # as identify


def test_a_command_whose_time_is_up_says_so_and_promises_nothing(file, tmp_path, capsys):
    assert main(["diagnose", file, "--time-limit", "50 ms", "--out", str(tmp_path / "found")]) == 3
    assert capsys.readouterr().err == "mofit: the time limit is reached. Nothing was written.\n"
    assert list(tmp_path.iterdir()) == []
