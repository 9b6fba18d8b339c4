import json
import tomllib

import numpy as np
import pytest
import rig_files
from published_schemas import violations

from mofit.cli import main
from mofit.data import import_files, propose_map
from mofit.data.importers.channel_aliases import name_and_unit
from mofit.errors import InputError

TIME = np.arange(400) / 100
ANGLE, FORCE = np.sin(2 * np.pi * TIME), np.sin(2 * np.pi * TIME - 0.2)


def csv(folder, columns, name="run.csv"):
    rows = (";".join(repr(float(v)) for v in row) for row in zip(*columns.values(), strict=True))
    path = folder / name
    path.write_text("\n".join([";".join(columns), *rows]))
    return path


def guessed(folder, columns):
    return tomllib.loads(propose_map([csv(folder, columns)]))["tests"][0]


def test_the_guess_of_every_format_imports_as_it_is(tmp_path, format, reader):
    data = rig_files.record()
    path = rig_files.write(tmp_path, format, data)
    (tmp_path / "map.toml").write_text(propose_map([path], reader))
    (test,) = import_files([path], tmp_path / "map.toml", reader).measurements
    assert (test.kind, test.experiment.frequency) == ("sine", pytest.approx(1.0))
    np.testing.assert_allclose(test.channel("slip_angle"), np.deg2rad(data["slip_angle"]))
    np.testing.assert_allclose(test.channel("lateral_force"), 1000 * data["lateral_force"])
    assert test.experiment.conditions["vertical_force"] == pytest.approx(3000, rel=1e-3)
    assert test.experiment.conditions["longitudinal_velocity"] == pytest.approx(80 / 3.6, rel=1e-3)


@pytest.mark.parametrize(
    ("angle", "force", "unit_of_angle", "unit_of_force"),
    [
        ("alpha [deg]", "Fy [kN]", "deg", "kN"),
        ("SA (rad)", "FY (N)", "rad", "N"),
        ("slip_angle_deg", "lateral_force_N", "deg", "N"),
        ("SlipAngle in °", "LateralForce in KN", "deg", "kN"),
        ("Schräglaufwinkel/Deg", "Seitenkraft/kN", "deg", "kN"),
        ("rig.Alpha [DEG]", "rig.FYW [n]", "deg", "N"),
        ("SLIPANGL", "FYW", "deg", "N"),
    ],
)
def test_spellings_of_a_tyre(tmp_path, angle, force, unit_of_angle, unit_of_force):
    scale = 1000 if unit_of_force == "N" else 1
    size = 0.05 if unit_of_angle == "rad" else 4
    test = guessed(tmp_path, {"t [ms]": 1000 * TIME, angle: size * ANGLE, force: scale * FORCE})
    assert test["channels"] == {
        "slip_angle": {"column": angle, "unit": unit_of_angle},
        "lateral_force": {"column": force, "unit": unit_of_force},
    }
    assert test["time"] == {"column": "t [ms]", "unit": "ms"}


@pytest.mark.parametrize(
    ("columns", "channels"),
    [
        (("time", "stroke [mm]", "load [kN]"), {"displacement": "stroke [mm]", "force": "load [kN]"}),
        (("Zeit", "Weg_mm", "Kraft_N"), {"displacement": "Weg_mm", "force": "Kraft_N"}),
        (("t", "Vin", "Vout"), {"input_voltage": "Vin", "output_voltage": "Vout"}),
        (("t", "y [mm]", "Fy [N]"), {"lateral_displacement": "y [mm]", "lateral_force": "Fy [N]"}),
        (("t", "x", "F"), {"displacement": "x", "force": "F"}),
    ],
)
def test_spellings_of_other_rigs(tmp_path, columns, channels):
    test = guessed(tmp_path, dict(zip(columns, (TIME, ANGLE, FORCE), strict=True)))
    assert {name: entry["column"] for name, entry in test["channels"].items()} == channels


def test_a_unit_that_does_not_fit_rules_a_column_out(tmp_path):
    data = {"t": TIME, "alpha [N]": FORCE, "SA [deg]": ANGLE, "Fy [kN]": FORCE}
    assert guessed(tmp_path, data)["channels"]["slip_angle"]["column"] == "SA [deg]"


def test_what_varies_is_no_condition_and_guesses_are_marked(tmp_path):
    text = propose_map(
        [csv(tmp_path, {"t": TIME, "SA": 4 * ANGLE, "FY": 900 * FORCE, "V": 80 + 40 * ANGLE, "X": TIME})]
    )
    assert "conditions" not in tomllib.loads(text)["tests"][0] or not tomllib.loads(text)["tests"][0]["conditions"]
    assert "# longitudinal_velocity" in text
    assert text.count("unit guessed from the values") >= 3
    assert '# not used: "X"' in text


def test_without_a_time_the_map_asks_for_one(tmp_path):
    path = csv(tmp_path, {"alpha [deg]": ANGLE, "Fy [N]": FORCE})
    (tmp_path / "map.toml").write_text(propose_map([path]))
    with pytest.raises(InputError, match=r"no column '\?'"):
        import_files([path], tmp_path / "map.toml")


def test_columns_of_unknown_names_are_listed(tmp_path):
    path = csv(tmp_path, {"a1": TIME, "a2": ANGLE})
    with pytest.raises(InputError, match=r"no input and output found among its columns: a1 \[\?\], a2 \[\?\]"):
        propose_map([path])
    (tmp_path / "notes").mkdir()
    with pytest.raises(InputError, match="no file of a known format"):
        propose_map([tmp_path / "notes"])


def test_a_folder_is_guessed_file_by_file_and_what_is_no_table_is_reported(tmp_path):
    for name in ("b.csv", "a.csv"):
        csv(tmp_path, {"t": TIME, "alpha [deg]": ANGLE, "Fy [N]": FORCE}, name)
    (tmp_path / "notes.txt").write_text("no numbers\nat all\n")
    text = propose_map([tmp_path])
    assert [test["name"] for test in tomllib.loads(text)["tests"]] == ["a", "b"]
    assert "# skipped: file 'notes.txt': holds no row of numbers" in text


def test_two_times_of_one_length_are_reported(tmp_path):
    data = {"g1.time": TIME, "g2.time": TIME + 0.003, "alpha [deg]": ANGLE, "Fy [N]": FORCE}
    assert '# other times of as many samples: "g2.time"' in propose_map([csv(tmp_path, data)])
    same = {**data, "g2.time": TIME}
    assert "other times" not in propose_map([csv(tmp_path, same)])


def test_special_characters_make_valid_toml(tmp_path):
    names = {'q"uote': TIME, "back\\slash": TIME, "del\x7fete": TIME, "bell\x07": TIME}
    text = propose_map([csv(tmp_path, {"t": TIME, "alpha [deg]": ANGLE, "Fy [N]": FORCE, **names})])
    assert tomllib.loads(text)["tests"][0]["channels"]["slip_angle"]["column"] == "alpha [deg]"
    assert "\x7f" not in text


def test_names_and_units_come_apart():
    assert name_and_unit("FY [KN]", "lateral_force") == ("FY", "kN")
    assert name_and_unit("v_kmh", "longitudinal_velocity") == ("v", "km/h")
    assert name_and_unit("F_y", "lateral_force") == ("F_y", None)
    assert name_and_unit("T_A", "temperature") == ("T_A", None)


def test_the_command_guesses_to_a_file_or_to_standard_output(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = csv(tmp_path, {"t [s]": TIME, "alpha [deg]": ANGLE, "Fy [N]": FORCE})
    assert main(["import", str(path), "--guess"]) == 0
    text = capsys.readouterr().out
    assert main(["import", str(path), "--guess", "--out", "map.toml"]) == 0
    assert (tmp_path / "map.toml").read_text() == text
    capsys.readouterr()
    assert main(["import", str(path), "--guess", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not violations(said)
    assert (said["map"], said["file"], said["picture"]) == (text, None, None)
    assert main(["import", str(path), "--map", "map.toml", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)["tests"][0]
    assert (row["rate"], row["gaps"]) == (pytest.approx(100), 0)
    for arguments in (["import", str(path)], ["import", str(path), "--guess", "--map", "map.toml"]):
        assert main(arguments) == 2
        assert "either --map or --guess" in capsys.readouterr().err


@pytest.mark.parametrize("spoil", [lambda t: np.insert(t, 9, t[9])[:-1], lambda t: np.where(t > 2, t + 1, t)])
def test_uneven_stamps_are_proposed_for_resampling(tmp_path, spoil):
    stamps = spoil(TIME)
    path = csv(tmp_path, {"t [s]": stamps, "alpha [deg]": np.sin(stamps), "Fy [N]": FORCE})
    text = propose_map([path])
    assert tomllib.loads(text)["tests"][0]["resample"] == "100 Hz"
    (tmp_path / "map.toml").write_text(text)
    assert all(test.history for test in import_files([path], tmp_path / "map.toml").measurements)


def test_records_that_are_alike_are_proposed_as_tests(tmp_path, reader):
    run = {"t": TIME.tolist(), "x [mm]": ANGLE.tolist(), "F [N]": FORCE.tolist()}
    rig = {"cold": [run, run], "warm": [run, run], "gain": 2.0, "note.s": "text"}
    (tmp_path / "a.json").write_text(json.dumps({"rig": rig}))
    text = propose_map([tmp_path / "a.json"], reader)
    assert "# 4 records" in text
    (tmp_path / "map.toml").write_text(text)
    names = import_files([], tmp_path / "map.toml", reader).tests
    assert names == ("a_cold_1", "a_cold_2", "a_warm_1", "a_warm_2")


def test_stamps_that_are_all_alike_have_no_rate(tmp_path):
    text = propose_map([csv(tmp_path, {"t [s]": 0 * TIME, "alpha [deg]": ANGLE, "Fy [N]": FORCE})])
    assert "resample" not in text


def test_the_fastest_of_uneven_records_decides_the_rate_and_a_pulse_runs_straight(tmp_path, reader):
    """A logger that slows down at rest, and a record that was cut off after a moment, as of a cell that is empty."""
    rng = np.random.default_rng(3)

    def pulse(duration, step):
        time = np.cumsum(step * rng.uniform(0.4, 1.6, int(duration / step)))
        current = np.where(time < duration / 2, 2.5, 0.0)
        return {"time": time.tolist(), "I [A]": current.tolist(), "U [V]": (4 - 0.1 * current - 0.01 * time).tolist()}

    cells = {"a": pulse(20.0, 0.1), "b": pulse(20.0, 0.1), "empty": pulse(0.7, 0.03)}
    (tmp_path / "cells.json").write_text(json.dumps(cells))
    text = propose_map([tmp_path / "cells.json"], reader)
    (tmp_path / "map.toml").write_text(text)
    (test,) = tomllib.loads(text)["tests"]
    assert test["procedure"] == "step"
    assert float(test["resample"].split()[0]) == pytest.approx(1 / np.median(np.diff(cells["empty"]["time"])), rel=1e-3)
    assert "3 of 3 records" in text
    assert "other times" not in text  # those of other records are no rivals
    campaign = import_files([], tmp_path / "map.toml", reader)
    assert campaign.tests == ("cells_a", "cells_b", "cells_empty")
    for measurement in campaign.measurements:
        values = measurement.channel("current")
        assert (values.min(), values.max()) == (0.0, 2.5)  # no overshoot where it is switched


def test_an_input_that_is_switched_often_is_free_and_runs_straight(tmp_path):
    levels = np.repeat(np.random.default_rng(0).integers(0, 2, 40), 10)
    columns = {"t [s]": TIME, "x [mm]": levels, "F [N]": np.cumsum(levels - levels.mean())}
    test = guessed(tmp_path, columns)
    assert (test["procedure"], test["interpolation"]) == ("free", "linear")
    assert "interpolation" not in guessed(tmp_path, {"t [s]": TIME, "x [mm]": ANGLE**3, "F [N]": FORCE})
