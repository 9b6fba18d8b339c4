"""What the short commands print with --json: a rig simulated, identified in a batch, reported, exported."""

import json

import pytest
from published_schemas import violations

from mofit.cli import main
from mofit.report import REPORT_FILE

MODEL = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Gain(Model):
    name = "gain"
    parameters = (Parameter("k", "N/rad", 0.5, 4.0, 2.0),)
    inputs = (Channel("slip_angle", "rad"),)
    outputs = (Channel("lateral_force", "N"),)

    def equations(self, s):
        return Equations(outputs={"lateral_force": s.k * s.slip_angle})
"""
PLAN = """
title = "gain"
model = "gain.py:Gain"
seed = 1
parameters = { k = 2.0 }
noise.lateral_force.sd = "0.01 N"

[[tests]]
name = "sine"
kind = "sine"
sample_rate = "50 Hz"
amplitude = "1 rad"
frequency = "1 Hz"
periods = 6
"""


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """Run a command with --json: its exit code and the object, which fits its schema."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gain.py").write_text(MODEL)
    (tmp_path / "plan.toml").write_text(PLAN)

    def run(*words):
        code = main([*words, "--json"])
        found = json.loads(capsys.readouterr().out)
        assert violations(found) == []
        assert found["schema"] == f"mofit.{words[0]}/1"
        return code, found

    return run


@pytest.mark.slow
def test_every_object_fits_its_published_schema(printed, tmp_path):
    (tmp_path / "rigs").mkdir()
    code, found = printed("simulate", "plan.toml", "--out", "rigs/a.nc")
    assert (code, found["file"], found["source"]) == (0, "rigs/a.nc", "simulated")
    assert found["tests"][0]["channels"]["slip_angle"]["range"] == pytest.approx([-1, 1], abs=1e-2)

    (tmp_path / "rigs" / "b.nc").write_text("no netCDF")
    code, found = printed("batch", "rigs", "--model", "gain.py:Gain", "--out", "all", "--jobs", "1")
    good, bad = found["campaigns"]
    assert (code, good["state"], bad["state"]) == (2, "done", "failed")
    assert good["modes"][0]["parameters"]["k"]["value"] == pytest.approx(2.0, abs=0.01)
    assert "b.nc" in bad["message"]

    folder = tmp_path / "all" / good["name"]
    (folder / REPORT_FILE).unlink()
    code, found = printed("report", str(folder))
    assert (code, found["report"]) == (0, str(folder / REPORT_FILE))
    assert (folder / REPORT_FILE).is_file()

    code, found = printed("uncertainty", str(folder), "--parameter", "k")
    assert (code, found["not_identifiable"]) == (0, [])

    code, found = printed("export", str(folder), "--to", "c", "--model", "gain.py:Gain", "--out", "gain.c")
    assert (code, found["mode"]) == (0, "m1")
    code, found = printed("export", "rigs/a.nc", "--to", "tydex", "--out", "sine.tdx")
    assert (code, found["test"]) == (0, "sine")
