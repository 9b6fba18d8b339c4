import gzip

import h5py
import numpy as np
import pytest
import rig_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mofit.cli import main
from mofit.data import import_files, overview
from mofit.data.importers.registry import known_endings
from mofit.data.importers.table import read_table
from mofit.errors import InputError


def test_every_format_imports_to_the_same_campaign(tmp_path, format, reader):
    data = rig_files.record()
    path = rig_files.write(tmp_path, format, data)
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, format))
    campaign = import_files([path], tmp_path / "map.toml", reader)
    (test,) = campaign.measurements
    # bit for bit: all hold doubles, the text formats with every digit, but openpyxl writes 16 digits
    digits = 1e-15 if format == "xlsx" else 0
    np.testing.assert_allclose(test.time, data["time"], rtol=digits)
    np.testing.assert_allclose(test.channel("slip_angle"), np.deg2rad(data["slip_angle"]), rtol=digits)
    np.testing.assert_allclose(test.channel("lateral_force"), 1000 * data["lateral_force"], rtol=digits)
    conditions = test.experiment.conditions
    assert conditions["vertical_force"] == pytest.approx(np.mean(data["vertical_force"]), rel=digits, abs=0)
    assert conditions["longitudinal_velocity"] == pytest.approx(np.mean(data["speed"]) / 3.6, rel=1e-15)
    (tmp_path / "csv").mkdir()
    other = rig_files.write(tmp_path / "csv", "csv", data)
    (tmp_path / "csv" / "map.toml").write_text(rig_files.map_of(other, "csv"))
    same = import_files([other], tmp_path / "csv" / "map.toml").hash() == campaign.hash()
    assert same == (format != "xlsx")


def test_what_else_a_mat_7_3_file_holds(tmp_path, reader):
    table = read_table(rig_files.write(tmp_path, "mat73"), reader)
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


def test_mdf_groups_of_their_own_rates_keep_their_own_times(tmp_path, reader):
    asammdf = pytest.importorskip("asammdf", reason="the extra 'mdf' is not installed")
    time = np.arange(100) / 100
    with asammdf.MDF(version="4.10") as file:
        bad = np.zeros(100, dtype=bool)
        bad[7] = True
        file.append([asammdf.Signal(np.sin(time), time, name="a", unit="deg", invalidation_bits=bad)])
        file.append([asammdf.Signal(np.arange(50, dtype="i2"), time[::2], name="b", unit="N")])
        file.append([asammdf.Signal(np.array([b"x"] * 100), time, name="note", encoding="utf-8")])
        file.save(tmp_path / "a.mf4")
    table = read_table(tmp_path / "a.mf4", reader)
    assert list(table.columns) == ["g1.time", "a", "g2.time", "b", "g3.time"]
    np.testing.assert_array_equal(table.column("b"), np.arange(50.0))
    np.testing.assert_array_equal(table.column("g2.time"), time[::2])
    assert np.flatnonzero(np.isnan(table.column("a"))).tolist() == [7]
    assert (table.units["a"], table.units["b"]) == ("deg", "N")


@pytest.mark.parametrize(
    ("package", "extra", "name"),
    [("asammdf", "mdf", "a.mf4"), ("pyarrow", "parquet", "a.parquet"), ("openpyxl", "excel", "a.xlsx")],
)
def test_without_the_extra_one_message_names_it(tmp_path, monkeypatch, package, extra, name):
    (tmp_path / f"{package}.py").write_text(f"raise ModuleNotFoundError('no {package}', name='{package}')")
    (tmp_path / name).write_bytes(b"MDF")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=rf"{package}, which is not installed.*pip install 'mofit\[{extra}\]'"):
        read_table(tmp_path / name)


def test_the_help_lists_every_ending(capsys):
    main(["import", "--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert all(ending in text for ending in known_endings())


def test_a_file_that_claims_more_than_it_holds_is_refused_before_it_is_read(tmp_path, reader):
    with h5py.File(tmp_path / "big.mat", "w") as file:
        file.create_dataset("x", shape=(1, 10**9), dtype="f8", chunks=(1, 10**6), compression="gzip")
    with pytest.raises(InputError, match="claims to hold"):
        read_table(tmp_path / "big.mat", reader)


def test_a_file_that_may_not_be_opened_says_so(tmp_path, monkeypatch):
    path = rig_files.write(tmp_path, "csv")

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(InputError, match=r"file 'run\.csv': cannot be opened \(Permission denied\)"):
        read_table(path)


def test_a_column_without_a_unit_is_asked_for_one(tmp_path, reader):
    path = rig_files.write(tmp_path, "mat")
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, "csv"))
    with pytest.raises(InputError, match=r"channel 'slip_angle': column 'slip_angle' has no unit. Add unit = 'rad'"):
        import_files([path], tmp_path / "map.toml", reader)


def test_the_summary_of_what_was_taken(tmp_path):
    path = rig_files.write(tmp_path, "csv")
    (tmp_path / "map.toml").write_text(rig_files.map_of(path, "csv"))
    row = overview(import_files([path], tmp_path / "map.toml").measurements[0])
    assert (row["test"], row["samples"], row["gaps"]) == ("sine", 400, 0)
    assert row["rate"] == pytest.approx(100)
    assert row["channels"]["lateral_force"]["unit"] == "N"
    assert row["channels"]["slip_angle"]["range"] == pytest.approx([-np.deg2rad(4), np.deg2rad(4)])
    assert set(row["conditions"]) == {"vertical_force", "longitudinal_velocity"}


NUMBERS = st.floats(-1e12, 1e12, allow_nan=False, allow_infinity=False)


def read(folder, text, name="a.csv", contained=None):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path, contained)


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.lists(NUMBERS, min_size=3, max_size=3), min_size=1, max_size=30),
    dialect=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("  ", "."), (" ", ",")]),
    header=st.booleans(),
    zipped=st.booleans(),
    trailing=st.booleans(),
)
def test_any_usual_dialect_is_read_exactly(tmp_path, rows, dialect, header, zipped, trailing):
    delimiter, decimal = dialect
    end = delimiter if trailing else ""
    lines = [delimiter.join(repr(v).replace(".", decimal) for v in row) + end for row in rows]
    if header:
        lines.insert(0, delimiter.join(["time", "force", "stroke"]) + end)
    text = ("\n".join(lines) + "\n").encode()
    table = read(tmp_path, gzip.compress(text) if zipped else text, "a.csv.gz" if zipped else "a.txt")
    assert list(table.columns) == (["time", "force", "stroke"] if header else ["1", "2", "3"])
    np.testing.assert_array_equal(np.stack(list(table.columns.values()), axis=1), np.array(rows))
    np.testing.assert_array_equal(table.column(2), np.array(rows)[:, 1])


def test_comments_quotes_units_rows_and_blank_lines(tmp_path):
    text = '# rig 7\n% 2022\n\n"t";"F in N"\ns;N\n0;1\n0.1;2\n\n0.2;3\n'
    table = read(tmp_path, text)
    np.testing.assert_array_equal(table.column("t"), [0, 0.1, 0.2])
    np.testing.assert_array_equal(table.column("F in N"), [1, 2, 3])


def test_a_name_used_twice_hides_no_column(tmp_path):
    table = read(tmp_path, "t;F;s;F\n0;1;2;3\n1;4;5;6\n")
    assert list(table.columns) == ["t", "F", "s", "F (4)"]
    np.testing.assert_array_equal(table.column(4), [3, 6])


def test_an_empty_or_bad_cell_is_nan(tmp_path):
    table = read(tmp_path, "a,b\n1,2\n,3\n4,oops\n5,6\n")
    np.testing.assert_array_equal(table.column("a"), [1, np.nan, 4, 5])
    np.testing.assert_array_equal(table.column("b"), [2, 3, np.nan, 6])


def test_a_latin_file_with_a_byte_order_mark(tmp_path):
    table = read(tmp_path, "α in °\n1\n2\n".encode("utf-8-sig"))
    assert next(iter(table.columns)).startswith("α")
    assert "Weg in °" in read(tmp_path, "Weg in °\t2\n1\t2\n".encode("latin-1")).columns


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "zero length"),
        ("a.csv", b"no numbers\nat all\n", "holds no row of numbers"),
        ("a.csv", b"1,2\n3,4,5,6\n", "no regular table"),
        ("a.csv.gz", gzip.compress(b"1,2\n" * 999, mtime=0)[:-9], "damaged gzip"),
        ("a.mat", b"MATLAB 5.0 MAT-file but not really", "not a readable MAT file"),
        ("a.ods", b"PK", r"unknown format '\.ods'"),
        ("noending", b"1,2", "unknown format ''"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(tmp_path, reader, name, content, message):
    with pytest.raises(InputError, match=f"file '{name}': .*{message}"):
        read(tmp_path, content, name, reader)


def test_an_unknown_column_is_named(tmp_path):
    table = read(tmp_path, "time,force\n0,1\n1,2\n")
    with pytest.raises(InputError, match=r"no column 'forse'. Did you mean 'force'"):
        table.column("forse")
    with pytest.raises(InputError, match=r"no column 3. It has columns 1 to 2"):
        table.column(3)


def test_mat_vectors_scalars_and_structs(tmp_path, reader):
    from scipy.io import savemat

    content = {
        "t": np.arange(5.0)[:, None],
        "gain": 3.0,
        "rig": {"force": np.arange(5)},
        "note": "text",
        "m": np.eye(2),
    }
    savemat(tmp_path / "a.mat", content)
    table = read_table(tmp_path / "a.mat", reader)
    assert set(table.columns) == {"t", "gain", "rig.force", "m.1", "m.2"}
    np.testing.assert_array_equal(table.column("m.2"), [0, 1])
    np.testing.assert_array_equal(table.column("t"), np.arange(5.0))
    np.testing.assert_array_equal(table.column("rig.force"), np.arange(5.0))
    assert table.column("gain").tolist() == [3.0]
