import gzip
import sys

import h5py
import numpy as np
import pytest
import rig_files

from mofit.campaign import overview
from mofit.errors import InputError
from mofit.readers import import_files, read_table


def test_every_format_imports_to_the_same_campaign(tmp_path, format):
    data = rig_files.record()
    path = rig_files.write(tmp_path, format, data)
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, format))
    campaign = import_files([path], tmp_path / "map.toml")
    (test,) = campaign.measurements
    # bit for bit: all five hold doubles, the text formats with every digit
    np.testing.assert_array_equal(test.time, data["time"])
    np.testing.assert_array_equal(test.channel("slip_angle"), np.deg2rad(data["slip_angle"]))
    np.testing.assert_array_equal(test.channel("lateral_force"), 1000 * data["lateral_force"])
    conditions = test.procedure.conditions
    assert conditions["vertical_force"] == np.mean(data["vertical_force"])
    assert conditions["longitudinal_velocity"] == pytest.approx(np.mean(data["speed"]) / 3.6, rel=1e-15)
    (tmp_path / "csv").mkdir()
    other = rig_files.write(tmp_path / "csv", "csv", data)
    (tmp_path / "csv" / "map.toml").write_text(rig_files.map_of(other, "csv"))
    assert import_files([other], tmp_path / "csv" / "map.toml").hash() == campaign.hash()


def test_what_else_a_mat_7_3_file_holds(tmp_path):
    table = read_table(rig_files.write(tmp_path, "mat73"))
    assert set(table.columns) == {*rig_files.UNITS, "rig.gain"}
    assert table.column("rig.gain").tolist() == [2.0]


def test_tydex_is_known_by_its_first_line_and_brings_units_and_constants(tmp_path):
    path = rig_files.write(tmp_path, "tdx").rename(tmp_path / "run.asc")
    table = read_table(path)
    assert set(table.columns) == {"INFLPRES", *rig_files.TYDEX_NAMES.values()}
    assert table.units["FYW"] == "kN"
    assert (table.column("INFLPRES").tolist(), table.units["INFLPRES"]) == ([2.5], "bar")
    (tmp_path / "packed.asc.gz").write_bytes(gzip.compress(path.read_bytes()))
    assert list(read_table(tmp_path / "packed.asc.gz").columns) == list(table.columns)


def test_tydex_factor_is_applied_and_offsets_are_refused(tmp_path):
    path = rig_files.write(tmp_path, "tdx")
    text, old = path.read_text(), f"{'kN':10}{1:<10}{0:<10}{0:<10}"
    before = read_table(path).column("FYW")
    path.write_text(text.replace(old, f"{'kN':10}{-2:<10}{0:<10}{0:<10}"))
    np.testing.assert_array_equal(read_table(path).column("FYW"), -2 * before)
    path.write_text(text.replace(old, f"{'kN':10}{1:<10}{5:<10}{0:<10}"))
    with pytest.raises(InputError, match="channel 'FYW': has offsets 5, 0, which are not read"):
        read_table(path)


def test_mdf_groups_of_their_own_rates_keep_their_own_times(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="the extra 'mdf' is not installed")
    time = np.arange(100) / 100
    with asammdf.MDF(version="4.10") as file:
        bad = np.zeros(100, dtype=bool)
        bad[7] = True
        file.append([asammdf.Signal(np.sin(time), time, name="a", unit="deg", invalidation_bits=bad)])
        file.append([asammdf.Signal(np.arange(50, dtype="i2"), time[::2], name="b", unit="N")])
        file.append([asammdf.Signal(np.array([b"x"] * 100), time, name="note", encoding="utf-8")])
        file.save(tmp_path / "a.mf4")
    table = read_table(tmp_path / "a.mf4")
    assert list(table.columns) == ["g1.time", "a", "g2.time", "b", "g3.time"]
    np.testing.assert_array_equal(table.column("b"), np.arange(50.0))
    np.testing.assert_array_equal(table.column("g2.time"), time[::2])
    assert np.flatnonzero(np.isnan(table.column("a"))).tolist() == [7]
    assert (table.units["a"], table.units["b"]) == ("deg", "N")


def test_without_the_extra_one_message_names_it(tmp_path, monkeypatch):
    from mofit.readers.mdf import mdf_columns

    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(InputError, match=r"asammdf, which is not installed.*mofit\[mdf\]"):
        mdf_columns(tmp_path / "a.mf4")


def test_a_file_that_claims_more_than_it_holds_is_refused_before_it_is_read(tmp_path):
    with h5py.File(tmp_path / "big.mat", "w") as file:
        file.create_dataset("x", shape=(1, 10**9), dtype="f8", chunks=(1, 10**6), compression="gzip")
    with pytest.raises(InputError, match="claims to hold"):
        read_table(tmp_path / "big.mat")


def test_a_file_that_may_not_be_opened_says_so(tmp_path, monkeypatch):
    path = rig_files.write(tmp_path, "csv")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(InputError, match=r"file 'run\.csv': cannot be opened \(Permission denied\)"):
        read_table(path)


def test_a_column_without_a_unit_is_asked_for_one(tmp_path):
    path = rig_files.write(tmp_path, "mat")
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, "csv"))
    with pytest.raises(InputError, match=r"channel 'slip_angle': column 'slip_angle' has no unit. Add unit = 'rad'"):
        import_files([path], tmp_path / "map.toml")


def test_the_summary_of_what_was_taken(tmp_path):
    path = rig_files.write(tmp_path, "csv")
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, "csv"))
    row = overview(import_files([path], tmp_path / "map.toml").measurements[0])
    assert (row["test"], row["samples"], row["gaps"]) == ("sine", 400, 0)
    assert row["rate"] == pytest.approx(100)
    assert row["channels"]["lateral_force"]["unit"] == "N"
    assert row["channels"]["slip_angle"]["range"] == pytest.approx([-np.deg2rad(4), np.deg2rad(4)])
    assert set(row["conditions"]) == {"vertical_force", "longitudinal_velocity"}
