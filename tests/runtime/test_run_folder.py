"""A run's folder is claimed before the work, appears whole or not at all, and an interrupted one can be taken up."""

import json
import multiprocessing
import os
import subprocess
import sys

import pytest

from mofit.errors import InputError, WriteError
from mofit.runtime.run_directory import CONFIGURATION, run_folder

CONFIG = {"seed": 1, "tests": ["a", "b"], "bounds": {"k": (0.0, 1.0)}}


def work(out, configuration=CONFIG, **options):
    with run_folder(out, "stem", configuration, **options) as folder:
        (folder.partial / "result.nc").write_text("whole")
    return folder


def interrupt(out, configuration=CONFIG, error=KeyboardInterrupt, **options):
    with pytest.raises(error), run_folder(out, "stem", configuration, **options) as folder:
        (folder.partial / "chains.h5").write_text("some")
        raise error
    return folder


def test_appears_under_its_name_when_done(tmp_path):
    folder = work(tmp_path / "run")
    assert [path.name for path in folder.target.iterdir()] == ["result.nc"]
    assert list(tmp_path.iterdir()) == [folder.target]


def test_interrupted_work_stays_and_resumes(tmp_path):
    folder = interrupt(tmp_path / "run")
    assert json.loads((folder.partial / CONFIGURATION).read_text())["seed"] == 1
    with pytest.raises(InputError, match="--resume"):
        work(tmp_path / "run")
    assert work(tmp_path / "run", resume=True) == folder
    assert {path.name for path in folder.target.iterdir()} == {"chains.h5", "result.nc"}


def test_what_cannot_be_resumed_is_not_kept(tmp_path):
    interrupt(tmp_path / "run", resumable=False)
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_before_anything_was_written_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(KeyboardInterrupt), run_folder(None, "stem", CONFIG):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", ["run", None])
def test_resume_without_anything_to_resume_starts(out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (work(out, resume=True).target / "result.nc").exists()


def test_resume_wants_the_same_settings(tmp_path):
    interrupt(tmp_path / "run")
    with pytest.raises(InputError, match="seed"):
        work(tmp_path / "run", {**CONFIG, "seed": 2}, resume=True)


def test_default_names_count_up_and_resume_finds_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    work(None)
    second = interrupt(None)
    assert second.target.name == "stem-2"
    assert work(None).target.name == "stem-3"
    with pytest.raises(InputError, match="no interrupted run"):
        work(None, {**CONFIG, "seed": 2}, resume=True)
    assert work(None, resume=True) == second


def test_a_finished_run_is_not_resumed(tmp_path):
    work(tmp_path / "run")
    with pytest.raises(InputError, match="not interrupted"):
        work(tmp_path / "run", resume=True)


def test_an_existing_folder_is_never_touched(tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(InputError, match="exists already"):
        work(tmp_path / "run")


def test_a_folder_made_meanwhile_is_not_replaced(tmp_path):
    with pytest.raises(WriteError, match="whole in"), run_folder(tmp_path / "run", "stem", CONFIG) as folder:
        (folder.partial / "result.nc").write_text("whole")
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "mine").touch()
    assert (folder.partial / "result.nc").exists()


def test_bad_input_leaves_nothing(tmp_path):
    with pytest.raises(InputError), run_folder(tmp_path / "new" / "run", "stem", CONFIG) as folder:
        (folder.partial / "chains.h5").write_text("some")
        raise InputError.of("here", "bad", "mend it")
    assert list(tmp_path.iterdir()) == []


def test_one_has_the_folder_and_the_other_says_who(tmp_path):
    with run_folder(tmp_path / "run", "stem", CONFIG):
        for resume in (False, True):
            with pytest.raises(InputError, match=f"process {os.getpid()} on .* since"):
                work(tmp_path / "run", resume=resume)
    assert (tmp_path / "run").is_dir()


def test_a_dead_process_has_nothing(tmp_path):
    """It is killed while it works; what it has left is taken up at once."""
    script = (
        "import os, signal; from mofit.runtime.run_directory import run_folder\n"
        f"with run_folder({str(tmp_path / 'run')!r}, 'stem', {CONFIG!r}) as folder:\n"
        "    (folder.partial / 'chains.h5').write_text('some'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", script], check=False)
    assert (tmp_path / "run.partial" / "chains.h5").exists()
    with pytest.raises(InputError, match="an interrupted run is there"):
        work(tmp_path / "run")
    assert work(tmp_path / "run", resume=True).target.is_dir()


def start(ready, names):
    ready.wait()
    names.put(work(None).target.name)


def test_twenty_starts_at_once_end_in_twenty_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    context = multiprocessing.get_context("spawn")
    ready, names = context.Barrier(20), context.Queue()
    processes = [context.Process(target=start, args=(ready, names)) for _ in range(20)]
    for process in processes:
        process.start()
    found = {names.get() for _ in processes}
    for process in processes:
        process.join()
    assert len(found) == 20
    assert {path.name for path in (tmp_path / "runs").iterdir()} == found


@pytest.mark.parametrize("out", ["", ".", "..", "x" * 300, "x" * 250, "file/run", "file"])
def test_an_unusable_name_is_refused_before_the_work(out, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="--out") as caught:
        work(out)
    assert len(str(caught.value)) < 300
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("content", ["{'se", "[1]", "\0"])
def test_a_damaged_record_is_named(content, tmp_path):
    folder = interrupt(tmp_path / "run")
    (folder.partial / CONFIGURATION).write_text(content)
    with pytest.raises(InputError, match="is damaged"):
        work(tmp_path / "run", resume=True)


def test_a_file_in_the_way_is_named(tmp_path):
    (tmp_path / "run.partial").write_text("mine")
    with pytest.raises(InputError, match="in the way"):
        work(tmp_path / "run", resume=True)
    assert (tmp_path / "run.partial").read_text() == "mine"
