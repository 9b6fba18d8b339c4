"""A run's folder is claimed before the work, appears whole or not at all, and an interrupted one can be taken up."""

import contextlib
import errno
import json
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from mofit.errors import InputError, WriteError
from mofit.runtime.run_directory import CONFIGURATION, run_folder

CONFIG = {"seed": 1, "tests": ["a", "b"], "bounds": {"k": (0.0, 1.0)}}


def work(out, configuration=CONFIG, then=lambda folder: None, **options):
    with run_folder(out, "stem", configuration, **options) as folder:
        (folder.partial / "result.nc").write_text("whole")
        then(folder)
    return folder


def interrupt(out, error=KeyboardInterrupt, **options):
    seen = []

    def stop(folder):
        seen.append(folder)
        raise error

    with pytest.raises(type(error) if isinstance(error, Exception) else error):
        work(out, then=stop, **options)
    return seen[0]


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
    assert [path.name for path in folder.target.iterdir()] == ["result.nc"]


def test_what_cannot_be_resumed_is_not_kept(tmp_path):
    interrupt(tmp_path / "run", resumable=False)
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_before_anything_was_written_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(KeyboardInterrupt), run_folder(None, "stem", CONFIG):
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("resumable", [True, False])
def test_what_interrupts_the_work_is_told_what_is_left_of_it(resumable, tmp_path):
    stop = KeyboardInterrupt()
    options = {"resumable": resumable}
    with contextlib.suppress(KeyboardInterrupt), run_folder(tmp_path / "run", "stem", CONFIG, **options) as folder:
        (folder.partial / "result.nc").write_text("half")
        raise stop
    assert getattr(stop, "__notes__", []) == [left_in(tmp_path / "run.partial")] * resumable


def left_in(folder):
    return f"What is known so far is in {folder}; the same command with --resume goes on."


def test_an_interruption_is_told_so_too_where_the_cleanup_behind_it_fails(tmp_path):
    def fail(folder):
        try:
            raise KeyboardInterrupt
        finally:
            raise RuntimeError

    with pytest.raises(RuntimeError) as raised:
        work(tmp_path / "run", then=fail)
    assert raised.value.__context__.__notes__ == [left_in(tmp_path / "run.partial")]


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
    def make(folder):
        folder.target.mkdir()
        (folder.target / "mine").touch()

    with pytest.raises(WriteError, match="whole in"):
        work(tmp_path / "run", then=make)
    assert (tmp_path / "run.partial" / "result.nc").exists()


def test_bad_input_leaves_nothing(tmp_path):
    interrupt(tmp_path / "new" / "run", InputError.of("here", "bad", "mend it"))
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


def test_twenty_starts_at_once_end_in_twenty_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ready = threading.Barrier(20)

    def start(_):
        ready.wait()
        return work(None).target.name

    with ThreadPoolExecutor(20) as pool:
        found = set(pool.map(start, range(20)))
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


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "the disk is full"),
        (OSError("Can't write data (errno = 122, error message = 'Disk quota exceeded')"), "the quota"),
        (OSError(errno.EFBIG, "File too large"), "larger than the system allows"),
    ],
)
def test_a_full_disk_is_one_message_and_what_was_written_stays(error, words, tmp_path):
    def full(folder):
        raise error

    with pytest.raises(WriteError, match=f"{words}.*--resume"):
        work(tmp_path / "run", then=full)
    work(tmp_path / "run", resume=True)


def test_another_error_of_the_system_is_not_laid_to_the_disk(tmp_path):
    interrupt(tmp_path / "run", OSError(errno.ENOENT, "No such file"))
    interrupt(tmp_path / "other", RuntimeError("a mistake"))
