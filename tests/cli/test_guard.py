"""No command shows a traceback: what nobody foresaw goes into a log, what can be foreseen is one message."""

import re
from pathlib import Path

import pytest
from damper_rig import damper_campaign

from mofit.cli import main
from mofit.data import write_campaign
from mofit.models import find_model

OWN = """
import casadi as ca
import sys
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Own(Model):
    name = "own"
    parameters = (Parameter("c", "N/m", 0.0, 1e4, 1000.0),)
    inputs = (Channel("displacement", "m"),)
    states = (Channel("x", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        slope = s.displacement - s.x
        return Equations(outputs={"force": s.c * s.x}, derivatives={"x": slope})
"""


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """A campaign file, in a folder that is otherwise empty."""
    monkeypatch.chdir(tmp_path)
    write_campaign(damper_campaign(), tmp_path / "rig.nc")
    return "rig.nc"


def said(arguments, capsys, code=2):
    """What a command says on standard error."""
    assert main(arguments) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert err.count("\n") == 1
    return err


CLEANS_BADLY = """
try:
    raise KeyboardInterrupt
finally:
    raise RuntimeError("cannot join thread before it is started")
"""


def test_an_interruption_behind_which_the_cleanup_fails_is_told_as_one(rig, tmp_path, capsys):
    (tmp_path / "own.py").write_text(CLEANS_BADLY, encoding="utf-8")
    err = said(["identify", rig, "--model", "own.py:Own"], capsys, code=130)
    assert err == "mofit: interrupted. Nothing was written.\n"


def test_an_error_that_nobody_foresaw_goes_into_a_log(rig, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(Path, "is_file", lambda path: 1 / 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    err = said(["check", rig], capsys, code=1)
    assert "ZeroDivisionError" in err
    (log,) = re.findall(r"\S+\.log", err)
    content = Path(log).read_text(encoding="utf-8")
    assert "Traceback" in content
    assert "command: mofit check rig.nc" in content


@pytest.mark.parametrize("command", ["compare", "design"])
def test_the_measured_campaign_is_never_replaced(command, rig, capsys):
    before = Path(rig).read_bytes()
    for force in ([], ["--force"]):
        assert "is an input" in said([command, rig, "--out", rig, *force], capsys)
    assert Path(rig).read_bytes() == before
    assert [path.name for path in Path().iterdir()] == ["rig.nc"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("identify --seed -1", "seed"),
        ("identify --jobs 0", "--jobs 0"),
        ("identify --fix c=nan", "not a finite number"),
        ("identify --fix c=1e99", "far outside"),
        ("identify --evaluations 1", "evaluations"),
        ("identify --out .", "--out"),
        ("diagnose --seed -1", "seed"),
        ("diagnose --out rig.nc/run", "cannot be written"),
        ("batch --jobs -3", "--jobs -3"),
        ("batch --out rig.nc/run", "cannot be written"),
        ("compare --samples 0", "samples"),
        ("compare --samples 1000000000", "samples"),
        ("compare --posterior -1", "--posterior"),
        ("compare --seed -1", "seed"),
        ("design --samples 0", "samples"),
        ("design --budget 1e9", "samples"),
        ("design --plan x --out x", "two outputs"),
    ],
)
def test_a_value_that_cannot_be_used_is_one_message(arguments, words, rig, capsys):
    command, *options = arguments.split()
    assert words in said([command, rig, "--model", "kelvin_voigt_damper", *options], capsys)
    assert [path.name for path in Path().iterdir()] == ["rig.nc"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("import sys\n", "import sys\nsys.exit('bye')\n", "called sys.exit in line 4: bye"),
        ("slope = ", "sys.exit()\n        slope = ", "called sys.exit in line 16"),
        ("slope = ", "slope = {}['a'] + ", "raised KeyError in line 16: 'a'"),
        (
            "- s.x\n",
            "- s.x + ca.sqrt(0.005 - s.displacement)\n",
            "test '0.5Hz': the derivative of state 'x' is NaN at ",
        ),
        ("s.c * s.x", "ca.log(-1 - s.c)", "output 'force' is NaN at 0 s"),
        ("- s.x\n", "- s.c * ca.sqrt(s.x)\n", "output 'force' is finite, but not its derivatives by the parameters"),
    ],
)
def test_a_model_that_fails_says_where(old, new, words, rig, capsys):
    assert old in OWN
    Path("own.py").write_text(OWN.replace(old, new, 1))
    for command in ("identify", "diagnose", "compare"):
        assert words in said([command, rig, "--model", "own.py:Own"], capsys)


@pytest.mark.filterwarnings("default")
def test_a_warning_that_nobody_foresaw_is_a_sentence(rig, capsys):
    numbers = "import numpy as np\nLARGE = np.full(2, 1e308) * 10\n"
    Path("own.py").write_text(numbers + OWN)
    assert main(["compare", rig, "--model", "own.py:Own", "--samples", "1", "--jobs", "1"]) in (0, 4)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mofit: warning: overflow encountered in multiply (own.py, line 2). ")


def test_a_plan_of_a_trillion_samples_is_refused(rig, capsys):
    plan = """
title = "fast"
model = "kelvin_voigt_damper"
seed = 1
[[tests]]
name = "a"
kind = "sine"
sample_rate = 1e12
amplitude = 0.01
frequency = 1
periods = 4
"""
    Path("plan.toml").write_text(plan)
    for arguments in (["simulate", "plan.toml"], ["compare", "plan.toml"]):
        assert "4e+12 samples" in said(arguments, capsys)


@pytest.mark.slow
def test_python_takes_what_the_command_line_takes(rig, capsys):
    import mofit

    folder, tree = mofit.identify(rig, "kelvin_voigt_damper", tests="1Hz", out="run")
    assert str(folder) == "run"
    assert list(tree["test"].values) == ["1Hz"]
    assert mofit.diagnose(rig, "kelvin_voigt_damper", tests=["1Hz", "2Hz"]).campaign == "damper"
    for given, arguments in (
        ({"tests": "1hz"}, ["--test", "1hz"]),
        ({"out": "run"}, ["--out", "run"]),
        ({"out": "."}, ["--out", "."]),
        ({"model": "kelvin_damper"}, ["--model", "kelvin_damper"]),
    ):
        with pytest.raises(mofit.InputError) as caught:
            mofit.identify(rig, **{"model": "kelvin_voigt_damper", **given})
        model = [] if "model" in given else ["--model", "kelvin_voigt_damper"]
        assert said(["identify", rig, *model, *arguments], capsys) == f"mofit: {caught.value}\n"
    with pytest.raises(mofit.InputError, match="model: is a int"):
        mofit.identify(rig, 3)
    assert mofit.identify(rig, type(find_model("kelvin_voigt_damper")), tests="1Hz", out="again")[0].is_dir()
