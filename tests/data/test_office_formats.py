"""What Excel and Parquet files hold beside columns of numbers."""

from datetime import datetime, timedelta

import numpy as np
import pytest

from mofit.data.importers.table import read_table
from mofit.errors import InputError

STAMPS = [datetime(2021, 3, 4, 10, 11, 12) + timedelta(milliseconds=500 * k) for k in range(4)]


def workbook(path, **sheets):
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl, which an extra installs, is not here")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_names_units_clock_and_cells_that_are_no_numbers(tmp_path, reader):
    rows = [["Rig 7", None, None], [], ["when", "F", None, "note"], ["", "kN", "mm", ""]]
    rows += [[stamp, k, 10.0 * k, "fine"] for k, stamp in enumerate(STAMPS)]
    rows[6][1] = "broken"
    table = read_table(workbook(tmp_path / "a.xlsx", run=rows), reader)
    assert table.columns["when"].tolist() == [0, 0.5, 1, 1.5]
    np.testing.assert_array_equal(table.columns["F"], [0, 1, np.nan, 3])
    assert table.columns["3"].tolist() == [0, 10, 20, 30]
    assert table.units == {"when": "s", "F": "kN", "3": "mm"}


def test_several_sheets_are_several_records(tmp_path, reader):
    one, two = [["t", "F"], [0, 1], [1, 2]], [["t", "F"], ["s", "N"], [0, 3], [1, 4]]
    table = read_table(workbook(tmp_path / "a.xlsx", one=one, notes=[["text"]], two=two), reader)
    assert list(table.columns) == ["one.t", "one.F", "two.t", "two.F"]
    assert table.records() == ["one", "two"]
    assert table.record("two").column("F").tolist() == [3, 4]
    assert table.record("two").units == {"t": "s", "F": "N"}
    assert read_table(workbook(tmp_path / "b.xlsx", one=one), reader).column("F").tolist() == [1, 2]


def test_a_workbook_without_numbers_is_refused(tmp_path, reader):
    with pytest.raises(InputError, match="holds no numeric vector"):
        read_table(workbook(tmp_path / "a.xlsx", notes=[["no"], ["numbers"]]), reader)


def test_parquet_integers_missing_values_stamps_and_text(tmp_path, reader):
    pa = pytest.importorskip("pyarrow", reason="pyarrow, which an extra installs, is not here")
    import pyarrow.parquet as pq

    content = {
        "count": pa.array([1, None, 3, 4], pa.int32()),
        "single": pa.array([0.5, 1.5, 2.5, None], pa.float32()),
        "on": pa.array([True, False, True, True]),
        "when": pa.array(STAMPS, pa.timestamp("us", tz="UTC")),
        "text": pa.array([stamp.isoformat() for stamp in STAMPS]),
        "note": pa.array(["a", "b", "c", "d"]),
        "list": pa.array([[1.0], [2.0], [3.0], [4.0]]),
    }
    pq.write_table(pa.table(content), tmp_path / "a.parquet")
    table = read_table(tmp_path / "a.parquet", reader)
    assert list(table.columns) == ["count", "single", "on", "when", "text"]
    np.testing.assert_array_equal(table.column("count"), [1, np.nan, 3, 4])
    np.testing.assert_array_equal(table.column("single"), [0.5, 1.5, 2.5, np.nan])
    assert table.column("on").tolist() == [1, 0, 1, 1]
    assert table.column("when").tolist() == table.column("text").tolist() == [0, 0.5, 1, 1.5]
    assert table.units == {"when": "s", "text": "s"}


def test_a_constant_column_that_takes_few_bytes_is_read(tmp_path, reader):
    pa = pytest.importorskip("pyarrow", reason="pyarrow, which an extra installs, is not here")
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"x": np.zeros(1_000_000)}), tmp_path / "a.parquet")
    assert 1032 * (tmp_path / "a.parquet").stat().st_size < 8_000_000
    assert len(read_table(tmp_path / "a.parquet", reader).column("x")) == 1_000_000
