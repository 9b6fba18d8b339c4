"""The command line as a user meets it: help, one message per mistake, exit codes, nothing written."""

import json
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from published_schemas import violations

from mofit.cli import main

COMMANDS = tuple(
    "check identify simulate import export predict report uncertainty runs open compare design diagnose batch "
    "mcp completion".split()
)


def mofit(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "mofit", *map(str, arguments)], capture_output=True, text=True, check=False, cwd=cwd
    )


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty working folder."""
    folder = tmp_path / "cwd"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def rig(tmp_path):
    """A sine test of a gain of 2, as a campaign file."""
    time = np.arange(0, 8, 0.01)
    slip = np.sin(2 * np.pi * time)
    test = xr.Dataset(
        {
            "slip_angle": ("time", slip, {"units": "rad", "role": "input"}),
            "lateral_force": (
                "time",
                2 * slip + 0.01 * np.random.default_rng(0).normal(size=len(time)),
                {"units": "N", "role": "output"},
            ),
        },
        {"time": ("time", time, {"units": "s"})},
        {"procedure": "sine", "frequency": 1.0, "amplitude": 1.0},
    )
    root = xr.Dataset(attrs={"schema": "mofit.campaign/1", "title": "gain rig", "source": "simulated"})
    path = tmp_path / "rig.nc"
    xr.DataTree.from_dict({"/": root, "/sine_1Hz": test}).to_netcdf(path)
    return path


GAIN = """
import casadi as ca
from mofit.models import Channel, Condition, Equations, Model
from mofit.parameters import Parameter


class Gain(Model):
    name = "gain"
    parameters = (Parameter("k", "N/rad", 0.5, 4.0, 1.0),)
    inputs = (Channel("slip_angle", "rad"),)
    outputs = (Channel("lateral_force", "N"),)

    def equations(self, s):
        return Equations(outputs={"lateral_force": s.k * s.slip_angle})
"""


@pytest.fixture
def gain(tmp_path):
    path = tmp_path / "gain.py"
    path.write_text(GAIN)
    return f"{path}:Gain"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command):
    done = mofit(command, "--help")
    assert done.returncode == 0
    text = " ".join(done.stdout.split())
    assert f"Example: mofit {command}" in text
    assert "default: True" not in text
    assert "default: False" not in text


def test_a_good_campaign_passes_the_check(rig, capsys):
    assert main(["check", str(rig), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["schema"] == "mofit.check/1"
    assert not violations(found)
    assert isinstance(found["issues"], list)


def test_commands_that_draw_nothing_import_no_matplotlib(rig):
    script = (
        f"import sys; from mofit.cli import main; main(['check', {str(rig)!r}])\n"
        "import mofit.data.campaign_file, mofit.cli.import_files, mofit.simulation.virtual_rig, mofit.cli.output\n"
        "sys.exit('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_linear_algebra_is_told_of_one_thread_before_numpy_is_there():
    # later the library has made its threads, which take the cores from the kernel's in busy loops
    script = "import sys, mofit.cli; sys.exit('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_identify_prints_one_json_object_and_nothing_else(rig, gain, empty, capsys):
    assert main(["identify", str(rig), "--model", gain, "--json", "--jobs", "1"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["modes"][0]["parameters"]["k"]["value"] == pytest.approx(2.0, rel=1e-3)
    assert (empty / summary["run"] / "report.html").exists()
    assert not violations(summary)


def test_report_is_rebuilt_and_an_existing_run_is_kept(rig, gain, empty, capsys):
    assert main(["identify", str(rig), "--model", gain, "--out", "run", "--jobs", "1"]) == 0
    (empty / "run" / "report.html").unlink()
    assert main(["report", "run"]) == 0
    assert (empty / "run" / "report.html").exists()
    before = (empty / "run" / "result.nc").stat().st_mtime_ns
    assert main(["identify", str(rig), "--model", gain, "--out", "run"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (empty / "run" / "result.nc").stat().st_mtime_ns == before


def refused(arguments, empty, capsys, *words):
    """Exit code 2, one message with these words on standard error, nothing on standard output, nothing written."""
    assert main([str(argument) for argument in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("mofit: ")
    assert "Traceback" not in err
    for word in words:
        assert word in err, err
    assert list(empty.iterdir()) == []


def test_wrong_options_are_refused(rig, gain, empty, capsys):
    base = ["identify", rig, "--model", gain]
    for arguments, *words in (
        (["identfy"], "identify"),
        (["identify", rig, "--modle", "x"], "--modle"),
        (["identify", "absent.nc"], "absent.nc"),
        (["identify", rig, "--model", "maxwel_tyre"], "maxwell_tyre"),
        (["identify", rig, "--model", "absent.py:Gain"], "absent.py"),
        (["identify", rig, "--model", gain.replace(":Gain", ":Gian")], "Gain"),
        ([*base, "--effect", "force_ofset"], "force_offset"),
        ([*base, "--freq", "3"], "--freq 3", "1"),
        ([*base, "--freq", "1", "--all-freqs"], "--all-freqs"),
        ([*base, "--test", "sine_1hz"], "sine_1Hz"),
        ([*base, "--search", "mls"], "mlsl"),
        ([*base, "--weights", "sine_1hz=2"], "sine_1Hz"),
        ([*base, "--weights", "sine_1Hz"], "NAME=NUMBER"),
        ([*base, "--bounds", "k=4:1"], "lower bound"),
        ([*base, "--bounds", "q=1:4"], "'q'"),
        ([*base, "--fix", "k=2"], "free"),
        ([*base, "--seed", "one"], "--seed"),
        (["report", "absent"], "absent"),
        (["simulate", "absent.toml"], "absent.toml"),
        (["import", "--map", "absent.toml"], "absent.toml"),
        (["import", rig], "--map", "--guess"),
        (["import", rig, "--guess"], "no file of a known format"),
        (["export", "absent", "--to", "c"], "absent"),
        (["export", "absent", "--to", "matlab"], "matlab"),
    ):
        refused(arguments, empty, capsys, *words)


@pytest.mark.parametrize("content", [b"", b"not a netCDF file at all" * 20])
def test_garbage_files_are_refused(content, empty, tmp_path, capsys):
    path = tmp_path / "garbage.nc"
    path.write_bytes(content)
    refused(["identify", path], empty, capsys, "garbage.nc")


def test_a_truncated_file_is_refused(rig, empty, tmp_path, capsys):
    path = tmp_path / "cut.nc"
    path.write_bytes(rig.read_bytes()[: rig.stat().st_size // 2])
    refused(["identify", path], empty, capsys, "cut.nc")


def changed(rig, change):
    """The rig's file with one thing changed."""
    with xr.open_datatree(rig) as tree:
        tree = tree.load()
    groups = tree.to_dict()
    change(groups)
    path = rig.with_name("changed.nc")
    path.unlink(missing_ok=True)
    xr.DataTree.from_dict(groups).to_netcdf(path)
    return path


def _no_group(groups):
    del groups["/sine_1Hz"]


def _wrong_unit(groups):
    groups["/sine_1Hz"]["lateral_force"].attrs["units"] = "kg"


def _nan(groups):
    groups["/sine_1Hz"]["lateral_force"].values[5] = np.nan


def _gap(groups):
    groups["/sine_1Hz"] = groups["/sine_1Hz"].isel(time=np.r_[0:100, 150:800])


def _uneven_time(groups):
    time = groups["/sine_1Hz"]["time"].values + 0.004 * np.sin(np.arange(800))
    groups["/sine_1Hz"] = groups["/sine_1Hz"].assign_coords(time=("time", time, {"units": "s"}))


def _half_a_period(groups):
    groups["/sine_1Hz"] = groups["/sine_1Hz"].isel(time=slice(0, 50))


def _constant_output(groups):
    groups["/sine_1Hz"]["lateral_force"].values[:] = 3.0


def _no_output(groups):
    groups["/sine_1Hz"] = groups["/sine_1Hz"].drop_vars("lateral_force")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_no_group, ["test"]),
        (_wrong_unit, ["sine_1Hz", "lateral_force", "kg", "N"]),
        (_nan, ["sine_1Hz", "lateral_force"]),
        (_gap, ["sine_1Hz", "gap"]),
        (_uneven_time, ["sine_1Hz", "time"]),
        (_half_a_period, ["sine_1Hz", "period"]),
        (_constant_output, ["sine_1Hz", "constant"]),
        (_no_output, ["sine_1Hz", "output"]),
    ],
)
def test_unusable_campaigns_are_refused(change, words, rig, gain, empty, capsys):
    refused(["identify", changed(rig, change), "--model", gain], empty, capsys, *words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('Channel("slip_angle", "rad")', 'Channel("slip_angle", "rad"), Channel("load", "N")', ["load", "sine_1Hz"]),
        ("s.k * s.slip_angle", "s.k * s.steer", ["steer"]),
        ("s.k * s.slip_angle", "1 / 0", ["ZeroDivisionError"]),
        ("s.k * s.slip_angle", "ca.log(-1 - s.k)", ["sine_1Hz", "lateral_force", "NaN at 0 s"]),
        ("s.k * s.slip_angle", "ca.SX.sym('z')", ["symbol"]),
        ('{"lateral_force": ', '{"force": ', ["lateral_force", "force"]),
        ("0.5, 4.0, 1.0", "4.0, 0.5, 1.0", ["lower bound"]),
        ("class Gain(Model):", "class Gain(Model:", ["SyntaxError"]),
        ('outputs = (Channel("lateral_force", "N"),)', "outputs = ()", ["output"]),
    ],
)
def test_broken_user_models_are_refused(old, new, words, rig, gain, empty, tmp_path, capsys):
    assert old in GAIN
    (tmp_path / "broken.py").write_text(GAIN.replace(old, new))
    refused(["identify", rig, "--model", f"{tmp_path / 'broken.py'}:Gain"], empty, capsys, *words)


def test_a_mistake_ends_the_process_with_2_too(empty):
    done = mofit("identify", "absent.nc", cwd=empty)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
