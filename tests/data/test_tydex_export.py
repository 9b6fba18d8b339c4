"""TYDEX out: read back by the importer to full precision."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, import_files, write_campaign
from mofit.data.importers.table import read_table
from mofit.data.tydex_file import tydex_text
from mofit.errors import InputError

CONDITIONS = {
    "vertical_force": 3600.123456789,
    "longitudinal_velocity": 60 / 3.6,
    "inflation_pressure": 2.75e5,
    "camber_angle": -0.017,
    "rim_width": 0.1905,
}


def measurement(name="sine 1 Hz"):
    rng = np.random.default_rng(3)
    time = np.arange(80) / 100
    experiment = Experiment(name, "free", time, {"slip_angle": 0.05 * rng.normal(size=80)}, CONDITIONS)
    outputs = {"lateral_force": 1e3 * rng.normal(size=80), "self_aligning_torque": 30 * rng.normal(size=80)}
    units = {"slip_angle": "rad", "lateral_force": "N", "self_aligning_torque": "N m"}
    return Measurement(experiment, outputs, units)


def campaign(*tests):
    return Campaign("rig é", "simulated", {}, tests, units={"rim_width": "m"})


MAP = """
title = "read back"
source = "simulated"
[[tests]]
name = "back"
file = "test.tdx"
procedure = "free"
time = { column = "RUNTIME", unit = "s" }
[tests.channels]
slip_angle = { column = "SLIPANGL", unit = "rad" }
lateral_force = { column = "FYW", unit = "N" }
self_aligning_torque = { column = "MZW", unit = "N m" }
"""


def test_the_importer_reads_it_back_to_the_last_digit(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    own = measurement()
    write_campaign(campaign(own), tmp_path / "campaign.nc")
    assert main(["export", "campaign.nc", "--to", "tydex", "--out", "test.tdx"]) == 0
    assert capsys.readouterr().out.strip() == "test.tdx"
    (tmp_path / "map.toml").write_text(MAP)
    (back,) = import_files([], tmp_path / "map.toml").measurements
    np.testing.assert_array_equal(back.time, own.time)
    np.testing.assert_array_equal(back.channel("slip_angle"), own.channel("slip_angle"))
    for name, values in own.outputs.items():
        np.testing.assert_array_equal(back.channel(name), values)
    table = read_table(tmp_path / "test.tdx")
    short = ("FZW", "TRAJVELW", "INFLPRES", "INCLANGL", "RIM_WIDTH")
    for column, (name, value) in zip(short, CONDITIONS.items(), strict=True):
        assert table.column(column).tolist() == [value], name
    assert table.units["TRAJVELW"] == "m/s"


def test_columns_are_those_of_the_manual():
    lines = tydex_text(measurement(), "rig é").splitlines()
    assert lines[0] == "**HEADER"
    assert lines[1] == f"{'RELEASE':10}{'Release of TYDEX-Format':30}{'':10}1.3"
    slip = next(line for line in lines if line.startswith("SLIPANGL"))
    assert (slip[10:40].strip(), slip[40:50].strip(), slip[50:].split()) == ("slip angle", "rad", ["1.0", "0.0", "0.0"])
    data = lines.index("**MEASURDATA 80")
    assert len(lines[data + 1].split()) == 4
    assert lines[-1] == "**END"
    assert all(line.isascii() for line in lines)


def test_one_file_holds_one_test(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_campaign(campaign(measurement("one"), measurement("two")), tmp_path / "campaign.nc")
    assert main(["export", "campaign.nc", "--to", "tydex"]) == 2
    assert "2 tests, and a TYDEX file holds one measurement" in capsys.readouterr().err
    assert main(["export", "campaign.nc", "--to", "tydex", "--test", "two"]) == 0
    assert (tmp_path / "two.tdx").is_file()
    (tmp_path / "run").mkdir()
    assert main(["export", "run", "--to", "tydex"]) == 2
    assert "Name the campaign file" in capsys.readouterr().err


def test_names_and_units_that_do_not_fit_are_refused():
    own = measurement()
    conditions = {"temperature_inside": 300.0, "temperature_outside": 290.0}
    alike = replace(own, experiment=replace(own.experiment, conditions=conditions))
    with pytest.raises(InputError, match="'temperature_inside' are both 'TEMPERATU'"):
        tydex_text(alike, "rig")
    with pytest.raises(InputError, match="unit has more than 9 letters"):
        tydex_text(own, "rig", {"rim_width": "kg m^2/s^2/K"})
