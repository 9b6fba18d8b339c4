"""Comparing and designing tests for a user's simulator: as for the same equations, with bounded simulations."""

import json

import pytest
from straight_line import campaign, sine_test

from mofit.cli import main
from mofit.data import write_campaign

#: Two springs in series, of which tests see the product alone, and an offset.
SPRINGS = """
import numpy as np
from mofit.models import Channel, Equations, Model, Simulator
from mofit.parameters import Parameter

PARAMETERS = (
    Parameter("k", "N/m", 0.1, 10.0, 1.0, "log"),
    Parameter("r", "1", 0.1, 10.0, 2.0, "log"),
    Parameter("b", "N", -10.0, 10.0, 0.5),
)
CHANNELS = (Channel("displacement", "m"),), (Channel("force", "N"),)


class Springs(Model):
    name = "springs"
    parameters = PARAMETERS
    inputs, outputs = CHANNELS

    def equations(self, s):
        return Equations(outputs={"force": s.k * s.r * s.displacement + s.b})


def force(record, parameters):
    k, r, b = (parameters[name][:, None] for name in "krb")
    return k * r * record.inputs["displacement"] + b


function = Simulator(force, PARAMETERS, *CHANNELS, many=True)
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("springs")
    (folder / "springs.py").write_text(SPRINGS, encoding="utf-8")
    write_campaign(campaign(sine_test("short", periods=4), sine_test("long", periods=16, seed=1)), folder / "line.nc")
    return folder


def run(capsys, *arguments):
    code = main([*map(str, arguments), "--jobs", "1", "--json"])
    captured = capsys.readouterr()
    return code, json.loads(captured.out) if captured.out else captured.err


def compared(capsys, files, model, *more):
    return run(
        capsys, "compare", files / "line.nc", "--model", f"{files / 'springs.py'}:{model}", "--samples", "2", *more
    )


def test_a_comparison_is_that_of_the_same_equations(files, capsys):
    (_, there), (code, here) = (compared(capsys, files, model) for model in ("Springs", "function"))
    assert code == 0
    for row, other in zip(here["experiments"], there["experiments"], strict=True):
        for name, found in row["parameters"].items():
            expected = other["parameters"][name]
            assert found["verdict"] == expected["verdict"]
            assert found["relative_sd"] == pytest.approx(expected["relative_sd"], rel=1e-3)
        assert row["parameters"]["b"]["verdict"] == "identifiable"
        assert row["parameters"]["k"]["verdict"] != "identifiable"
    assert not any("too few simulations" in note for note in here["notes"])


def test_without_simulations_for_profiles_the_slopes_decide_and_that_is_said(files, capsys):
    code, found = compared(capsys, files, "function", "--simulations", "120")
    assert code == 0
    (note,) = [note for note in found["notes"] if "too few simulations were left for profiles" in note]
    assert note.startswith("short, long, all: ")
    assert {row["parameters"]["b"]["verdict"] for row in found["experiments"]} == {"identifiable"}


def test_the_augmentation_has_its_simulations(files, capsys):
    code, found = compared(capsys, files, "function", "--simulations", "340", "--parameter", "k")
    assert code == 4
    assert found["augmentations"] == {"k": None}  # no test tells k from r


def test_too_few_simulations_are_refused_with_the_number_it_takes(files, capsys):
    code, error = compared(capsys, files, "function", "--simulations", "20")
    assert code == 2
    # two tests, two samples, central differences by three parameters; the steps of these at two tests
    assert "2 tests at 2 parameter samples may take 54 simulations" in error
    code, error = run(
        capsys, "design", files / "line.nc", "--model", f"{files / 'springs.py'}:function", "--simulations", "100"
    )
    assert code == 2
    assert "may take" in error


def test_a_design_is_that_of_the_same_equations(files, capsys):
    space = files / "space.toml"
    space.write_text(
        'overhead = "5 s"\ntests = [{ kind = "sine", sample_rate = "50 Hz", amplitude = "1 m", frequency = "1 Hz", '
        'duration = ["4 s", "10 s"] }]',
        encoding="utf-8",
    )
    options = ("--space", space, "--parameter", "b", "--budget", "30 s", "--samples", "2")
    there, here = (
        run(capsys, "design", files / "line.nc", "--model", f"{files / 'springs.py'}:{model}", *options)
        for model in ("Springs", "function")
    )
    assert here[0] == there[0] == 0
    for _, found in (here, there):
        ((best, times),) = [(test["duration"], test["times"]) for test in found["design"]]
        assert (best, times) == ("10 s", 2)  # 20 s of data; of the short ones three fit, 12 s
    assert here[1]["parameters"]["b"]["sd"] == pytest.approx(there[1]["parameters"]["b"]["sd"], rel=1e-3)
