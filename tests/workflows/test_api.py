"""The functions of `mofit` that do what the commands do, and what a notebook shows of their results."""

import inspect
import json
from types import SimpleNamespace

import pytest
from lag_rig import campaign, write_model

import mofit
from mofit.cli import main
from mofit.cli.app import app
from mofit.errors import InputError
from mofit.experimental_design.comparison_result import Comparison
from mofit.identification.inputs import as_effect, as_effects
from mofit.models import find_effect, find_model
from mofit.runtime.notebook import NotebookProgress, listener, progress_html
from mofit.runtime.progress import silent
from mofit.sampling.settings import SampleSettings

SPACE = """
[defaults]
sample_rate = "100 Hz"

[[tests]]
kind = "sine"
frequency = ["0.3 Hz", "1 Hz", "3 Hz"]
amplitude = "1 rad"
duration = "20 s"
"""
QUICK = mofit.Settings(seed=4, sampling=SampleSettings(tau_multiple=20.0, min_ess=100.0, max_r_hat=1.1), jobs=1)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A campaign and its model."""
    folder = tmp_path_factory.mktemp("api")
    mofit.write_campaign(campaign(frequencies=(0.5, 2.0), seed=0), folder / "rig.nc")
    return folder / "rig.nc", write_model(folder)


@pytest.fixture(scope="module")
def run(place, tmp_path_factory):
    file, model = place
    said = []
    folder, tree = mofit.identify(
        file, find_model(model), QUICK, frequencies=[2.0], out=tmp_path_factory.mktemp("run") / "run",
        progress=lambda *words: said.append(words[0]),
    )  # fmt: skip
    assert "write" in said
    return folder, tree


@pytest.mark.parametrize("name", "identify uncertainty compare design diagnose predict simulate export batch".split())
def test_every_command_is_a_function_of_its_name(name):
    function = getattr(mofit, name)
    assert name in [command.strip("-") for command in app]
    hints = inspect.signature(function)
    assert hints.return_annotation is not inspect.Signature.empty
    assert all(p.annotation is not inspect.Parameter.empty for p in hints.parameters.values())
    assert function.__doc__


def test_a_run_opens_with_the_same_numbers(place, run):
    again = mofit.open(run[0])
    assert mofit.summary(again).equals(mofit.summary(run[1]))
    with pytest.raises(InputError, match="effect"):
        mofit.identify(*place, effects=[3])


def test_the_summary_is_the_table_of_the_command(run, capsys):
    folder, tree = run
    table = mofit.summary(folder)
    assert table.index.names == ["mode", "parameter"]
    assert list(table.columns) == ["value", "mean", "sd", "q05", "q95", "unit", "verdict"]
    said = mofit.uncertainty(folder)
    assert main(["uncertainty", str(folder), "--json"]) in (0, 3)
    printed = json.loads(capsys.readouterr().out)
    assert {key: printed[key] for key in said} == json.loads(json.dumps(said))
    assert (table.loc["m1"]["sd"] > 0).all()
    assert table.loc[("m1", "k"), "mean"] == pytest.approx(float(tree["modes/m1/posterior/k"].mean()), rel=1e-6)


def test_a_result_shows_table_figures_and_tree(run):
    page = run[1]._repr_html_()
    assert page.count("data:image/png;base64,") == 2
    assert "<table" in page
    assert "<summary>The tree</summary>" in page
    assert all(name in page for name in mofit.summary(run[1]).loc["m1"].index)
    assert "xarray" in run[1]["modes/m1"]._repr_html_()


def test_a_prediction_is_a_table_too(place, run):
    found = mofit.predict(run[1], place[0], model=place[1], tests="sine_0.5Hz")
    table = mofit.summary(found)
    assert len(table) == 1
    assert "nrmsd" in table.columns


def test_export_writes_the_file_of_the_command(run, tmp_path, capsys):
    made = mofit.export(run[0], "csv", out=tmp_path / "a.csv")
    assert main(["export", str(run[0]), "--to", "csv", "--out", str(tmp_path / "b.csv")]) == 0
    assert made.file.read_text() == (tmp_path / "b.csv").read_text()
    with pytest.raises(InputError, match="is for fmu and tydex, not for toml"):
        mofit.export(run[0], "toml", test="x", out=tmp_path / "c.toml")


def test_a_comparison_is_a_table(place, capsys):
    file, model = place
    found = mofit.compare(file, model=model, samples=1)
    table = mofit.summary(found)
    assert main(["compare", str(file), "--model", model, "--samples", "1", "--json"]) in (0, 4)
    printed = json.loads(capsys.readouterr().out)["experiments"]
    assert [row["name"] for row in printed] == list(dict.fromkeys(table.index.get_level_values("experiment")))
    first = printed[0]
    for name, entry in first["parameters"].items():
        assert table.loc[(first["name"], name), "verdict"] == entry["verdict"]
    page = found._repr_html_()
    assert page.count("data:image/png;base64,") == 1
    assert all(f">{row['name']}</th>" in page for row in printed)
    assert isinstance(found, Comparison)
    assert first["name"] in repr(found)
    assert len(repr(found)) < 2000


def test_a_design_shows_its_tests_and_what_they_give(place, tmp_path):
    file, model = place
    (tmp_path / "space.toml").write_text(SPACE)
    found = mofit.design(file, space=tmp_path / "space.toml", model=model, parameters="T", budget="40 s", samples=1)
    page, tests = found._repr_html_(), [candidate.name for candidate, _ in found.design.tests]
    assert tests
    assert all(f">{name}</th>" in page for name in tests)
    assert "Relative standard deviation of T" in page
    assert page.count("<table") == 2
    assert page.count("data:image/png;base64,") == 1


def test_an_effect_may_be_an_object_a_class_or_a_name():
    effect = find_effect("wheel_order")
    assert as_effects("wheel_order") == ("wheel_order",)
    assert as_effects(effect) == (effect,)
    assert [as_effect(one).name for one in ("wheel_order", effect, type(effect))] == ["wheel_order"] * 3
    with pytest.raises(InputError, match="is a int"):
        as_effect(3)


def test_progress_shows_in_a_notebook_and_nowhere_else():
    shown = []

    def display(page):
        shown.append(page)
        return SimpleNamespace(update=shown.append)

    progress = NotebookProgress(display)
    progress("search", 1, 4, "minima <3>")
    progress("search", 2, 4, "too soon")
    progress("search", 4, 4, "done")
    progress("write", 0, 0, "")
    assert shown == [
        progress_html("search", 1, 4, "minima <3>"), progress_html("search", 4, 4, "done"),
        progress_html("write", 0, 0, ""),
    ]  # fmt: skip
    assert "<progress" in shown[0]
    assert "&lt;3&gt;" in shown[0]
    assert "<progress" not in shown[2]
    assert listener(None) is silent
    assert listener(progress) is progress
