"""A run's folder appears whole or not at all, and an interrupted one can be taken up."""

import json

import pytest

from mofit.errors import InputError
from mofit.runtime.run_directory import CONFIGURATION, plan_folder

CONFIG = {"seed": 1, "tests": ["a", "b"], "bounds": {"k": (0.0, 1.0)}}


def work(folder, configuration=CONFIG):
    with folder.at_work(configuration) as partial:
        (partial / "result.nc").write_text("whole")


def test_appears_under_its_name_when_done(tmp_path):
    folder = plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)
    assert not folder.partial.exists()
    work(folder)
    assert [path.name for path in folder.target.iterdir()] == ["result.nc"]
    assert not folder.partial.exists()


def test_interrupted_work_stays_and_resumes(tmp_path):
    folder = plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)
    with pytest.raises(KeyboardInterrupt), folder.at_work(CONFIG):
        raise KeyboardInterrupt
    assert json.loads((folder.partial / CONFIGURATION).read_text())["seed"] == 1
    with pytest.raises(InputError, match="--resume"):
        plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)
    work(plan_folder(tmp_path / "run", "stem", CONFIG, resume=True))
    assert (tmp_path / "run" / "result.nc").exists()


def test_resume_wants_the_same_settings(tmp_path):
    folder = plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)
    with pytest.raises(KeyboardInterrupt), folder.at_work(CONFIG):
        raise KeyboardInterrupt
    with pytest.raises(InputError, match="seed"):
        plan_folder(tmp_path / "run", "stem", {**CONFIG, "seed": 2}, resume=True)


def test_default_names_count_up_and_resume_finds_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    work(plan_folder(None, "stem", CONFIG, resume=False))
    second = plan_folder(None, "stem", CONFIG, resume=False)
    assert second.target.name == "stem-2"
    with pytest.raises(KeyboardInterrupt), second.at_work(CONFIG):
        raise KeyboardInterrupt
    assert plan_folder(None, "stem", CONFIG, resume=False).target.name == "stem-3"
    assert plan_folder(None, "stem", CONFIG, resume=True) == second
    with pytest.raises(InputError, match="no interrupted run"):
        plan_folder(None, "stem", {**CONFIG, "seed": 2}, resume=True)


def test_an_existing_folder_is_never_touched(tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(InputError, match="exists already"):
        plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)


def test_bad_input_leaves_nothing(tmp_path):
    folder = plan_folder(tmp_path / "run", "stem", CONFIG, resume=False)
    with pytest.raises(InputError), folder.at_work(CONFIG):
        raise InputError.of("here", "bad", "mend it")
    assert list(tmp_path.iterdir()) == []
