"""Text files as data loggers write them: remarks, units, clocks, decimal commas, blocks, and channels without names."""

import json
import tomllib

import numpy as np
import pytest
from PIL import Image
from published_schemas import violations

from mofit.cli import main
from mofit.data import import_files, propose_map, read_campaign
from mofit.data.importers.clock import clock_seconds
from mofit.data.importers.table import read_table
from mofit.errors import InputError

TIME = np.arange(600) / 100
STROKE, SPEED = 10 * np.sin(6 * TIME), 60 * np.cos(6 * TIME)
FORCE = 8 * STROKE + 90 * np.tanh(SPEED / 5)


def lines(*columns, delimiter=";", decimal="."):
    return [delimiter.join(f"{value:.6f}".replace(".", decimal) for value in row) for row in zip(*columns, strict=True)]


def table_of(folder, text, name="log.csv"):
    (folder / name).write_text("\n".join(text), encoding="utf-8")
    return read_table(folder / name)


def imported(folder):
    """What the proposed map makes of the only file of a folder, and the map."""
    text = propose_map([folder / "log.csv"])
    (folder / "map.toml").write_text(text)
    return import_files([folder / "log.csv"], folder / "map.toml").measurements, text


def test_remarks_names_units_and_decimal_commas(tmp_path):
    head = ["Rig 7;;", "Operator;N. N.;", "Rate;100;Hz", "", "Zeit;Weg;Kraft", "s;mm;N"]
    table = table_of(tmp_path, [*head, *lines(TIME, STROKE, FORCE, decimal=",")])
    assert list(table.columns) == ["Zeit", "Weg", "Kraft"]
    assert table.units == {"Zeit": "s", "Weg": "mm", "Kraft": "N"}
    np.testing.assert_allclose(table.column("Kraft"), FORCE, atol=1e-6)
    ((test,), _) = imported(tmp_path)
    np.testing.assert_allclose(test.channel("displacement"), STROKE / 1000, atol=1e-8)


def test_units_in_brackets_of_a_table_of_blanks(tmp_path):
    table = table_of(tmp_path, ["time [s]  stroke (mm)  load [kN]", *lines(TIME, STROKE, FORCE, delimiter="  ")])
    assert list(table.columns) == ["time[s]", "stroke(mm)", "load[kN]"]
    ((test,), _) = imported(tmp_path)
    np.testing.assert_allclose(test.channel("force"), 1000 * FORCE, atol=1e-2)


def test_a_column_of_text_and_an_unreadable_cell(tmp_path):
    rows = [f"{row};OK" for row in lines(TIME, STROKE, FORCE)]
    rows[5] = rows[5].replace(rows[5].split(";")[2], "OVL")
    rows[7] = "OVL;OVL;OVL;OVL"
    table = table_of(tmp_path, ["t;x;F;state", *rows])
    assert len(table.column("F")) == len(TIME)
    assert np.flatnonzero(np.isnan(table.column("F"))).tolist() == [5, 7]
    assert np.isnan(table.column("state")).all()


@pytest.mark.parametrize("between", [["t [s];x [mm];F [N]"], ["", "Block 2;;", "t [s];x [mm];F [N]"], ["Block 2"]])
def test_blocks_become_records(tmp_path, between):
    rows = lines(TIME, STROKE, FORCE)
    table = table_of(tmp_path, ["t [s];x [mm];F [N]", *rows, *between, *rows[:300]])
    assert table.records() == ["block", "block.1", "block.2"]
    tests, text = imported(tmp_path)
    assert "# 2 records" in text
    assert [test.name for test in tests] == ["log_1", "log_2"]
    np.testing.assert_allclose(tests[1].channel("force"), FORCE[:300], atol=1e-6)


def test_blocks_of_other_columns_have_their_own_names(tmp_path):
    slow = lines(TIME[:50], 20 + TIME[:50])
    table = table_of(tmp_path, ["t;x;F", *lines(TIME, STROKE, FORCE), "time;temp", *slow])
    assert list(table.columns) == ["block.1.t", "block.1.x", "block.1.F", "block.2.time", "block.2.temp"]
    assert len(table.column("block.2.temp")) == 50


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["04.03.2021 23:59:59,5", "05.03.2021 00:00:00,5"], [0, 1]),
        (["3/4/2021 11:59:59 AM", "3/4/2021 12:00:01 PM"], [0, 2]),
        (["3/31/2021 23:00:00", "4/1/2021 01:00:00"], [0, 7200]),
        (["31/3/2021 23:00", "1/4/2021 01:00"], [0, 7200]),
        (["23:59:59.25", "00:00:00.25", "x"], [0, 1, np.nan]),
        (["2021/03/04 10:00:00", "2021/03/04 10:00:00.001"], [0, 0.001]),
        (["31.02.2021 10:00:00", "01.03.2021 10:00:00", "01.03.2021 10:00:01"], [np.nan, 0, 1]),
    ],
)
def test_clocks_of_loggers(cells, seconds):
    np.testing.assert_allclose(clock_seconds(cells), seconds, atol=1e-9)


def test_date_and_time_in_columns_of_their_own(tmp_path):
    clock = [f"10:{int(t) // 60:02d}:{t % 60:06.3f}" for t in TIME]
    rows = [f"04.03.2021;{c};{row}" for c, row in zip(clock, lines(STROKE, FORCE), strict=True)]
    table_of(tmp_path, ["Date;Time;stroke [mm];load [N]", *rows])
    ((test,), text) = imported(tmp_path)
    assert tomllib.loads(text)["tests"][0]["time"]["column"] == "Time"
    np.testing.assert_allclose(test.time, TIME, atol=1e-9)


def test_channels_without_names_are_told_by_their_shapes(tmp_path):
    rng = np.random.default_rng(3)
    load = FORCE + rng.normal(size=600)
    table_of(tmp_path, ["CHANNEL0;CHANNEL1;CHANNEL2;CHANNEL3", *lines(load, TIME, SPEED, STROKE)])
    ((test,), text) = imported(tmp_path)
    found = tomllib.loads(text)["tests"][0]
    assert found["time"]["column"] == "CHANNEL1"
    assert found["channels"] == {
        "displacement": {"column": "CHANNEL3", "unit": "mm"},
        "force": {"column": "CHANNEL0", "unit": "N"},
    }
    assert "# not used: \"CHANNEL2\", the derivative of 'CHANNEL3'" in text
    np.testing.assert_allclose(test.channel("force"), load, atol=1e-5)


def test_channels_without_names_are_told_by_their_units(tmp_path):
    table_of(tmp_path, ["CH0;CH1;CH2", "s;kN;mm", *lines(TIME, FORCE, STROKE)])
    ((test,), _) = imported(tmp_path)
    np.testing.assert_allclose(test.channel("displacement"), STROKE / 1000, atol=1e-8)
    np.testing.assert_allclose(test.channel("force"), 1000 * FORCE, atol=1e-2)


def test_a_table_of_moduli_becomes_sine_tests(tmp_path):
    rows = ["0.1,100,5,20", "1,120,9,20", "1,110,8,40"]
    table_of(tmp_path, ["f,E_stor,E_loss,T", "Hz, MPa, MPa, C", *rows])
    tests, text = imported(tmp_path)
    assert "deviation = 0.01" in text
    assert [test.name for test in tests] == ["log_1", "log_2", "log_3"]
    assert [test.experiment.conditions["temperature"] for test in tests] == pytest.approx([293.15, 293.15, 313.15])
    test = tests[1]
    kept = test.time >= test.experiment.transient
    phase = np.exp(-2j * np.pi * test.time[kept])
    modulus = (test.channel("stress")[kept] @ phase) / (test.channel("strain")[kept] @ phase)
    assert modulus == pytest.approx(120e6 + 9e6j, rel=1e-6)
    (tmp_path / "map.toml").write_text(text.replace('unit = "MPa"', 'unit = "s"'))
    with pytest.raises(InputError, match="frequency, storage and loss in Hz, s, s"):
        import_files([tmp_path / "log.csv"], tmp_path / "map.toml")


def test_a_message_names_few_of_many_columns(tmp_path):
    names = [f"a very long name of a channel number {k}" for k in range(300)]
    (tmp_path / "log.csv").write_text(";".join(names) + "\n" + ";".join(["1"] * 300) + "\n")
    with pytest.raises(InputError, match="and 294 more") as refused:
        propose_map([tmp_path / "log.csv"])
    assert len(str(refused.value)) < 600


def test_the_map_comes_with_a_picture_and_force_replaces_what_mofit_made(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table_of(tmp_path, ["CHANNEL0;CHANNEL1;CHANNEL2;CHANNEL3", *lines(TIME, STROKE, SPEED, FORCE)])
    guess = ["import", "log.csv", "--guess", "--out", "map.toml", "--json"]
    assert main(guess) == 0
    said = json.loads(capsys.readouterr().out)
    assert not violations(said)
    assert said["picture"] == "map.png"
    with Image.open("map.png") as picture:
        assert picture.width > 900
        colours = {colour for _, colour in picture.convert("RGB").getcolors(1 << 20)}
    assert {(0x0B, 0x62, 0xA4), (0xC8, 0x50, 0x0A), (0x8A, 0x8A, 0x8A)} <= colours
    work = ["import", "log.csv", "--map", "map.toml", "--out", "log.nc"]
    assert main(work) == 0
    for again in (guess, work):
        assert main(again) == 2
        assert "replace it with --force" in capsys.readouterr().err
        assert main([*again, "--force"]) == 0
    assert read_campaign("log.nc").tests == ("log",)
    (tmp_path / "log.nc").write_text("my notes")
    assert main([*work, "--force"]) == 2
    assert "mofit has not made it" in capsys.readouterr().err
    assert (tmp_path / "log.nc").read_text() == "my notes"
