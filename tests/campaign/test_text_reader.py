import gzip

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.errors import InputError
from mofit.readers import read_table

NUMBERS = st.floats(-1e12, 1e12, allow_nan=False, allow_infinity=False)


def read(folder, text, name="a.csv"):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(path)


@settings(deadline=None, max_examples=60)
@given(
    rows=st.lists(st.lists(NUMBERS, min_size=3, max_size=3), min_size=1, max_size=30),
    dialect=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), ("  ", "."), (" ", ",")]),
    header=st.booleans(),
    zipped=st.booleans(),
    trailing=st.booleans(),
)
def test_any_usual_dialect_is_read_exactly(tmp_path_factory, rows, dialect, header, zipped, trailing):
    delimiter, decimal = dialect
    end = delimiter if trailing else ""
    lines = [delimiter.join(repr(v).replace(".", decimal) for v in row) + end for row in rows]
    if header:
        lines.insert(0, delimiter.join(["time", "force", "stroke"]) + end)
    text = ("\n".join(lines) + "\n").encode()
    table = read(
        tmp_path_factory.mktemp("t"), gzip.compress(text) if zipped else text, "a.csv.gz" if zipped else "a.txt"
    )
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


def test_an_empty_or_odd_cell_is_nan(tmp_path):
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
        ("a.xlsx", b"PK", r"unknown format '\.xlsx'"),
        ("noending", b"1,2", "unknown format ''"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(tmp_path, name, content, message):
    with pytest.raises(InputError, match=f"file '{name}': .*{message}"):
        read(tmp_path, content, name)


def test_an_unknown_column_is_named(tmp_path):
    table = read(tmp_path, "time,force\n0,1\n1,2\n")
    with pytest.raises(InputError, match=r"no column 'forse'. Did you mean 'force'"):
        table.column("forse")
    with pytest.raises(InputError, match=r"no column 3. It has columns 1 to 2"):
        table.column(3)


def test_mat_vectors_scalars_and_structs(tmp_path):
    from scipy.io import savemat

    content = {
        "t": np.arange(5.0)[:, None],
        "gain": 3.0,
        "rig": {"force": np.arange(5)},
        "note": "text",
        "m": np.eye(2),
    }
    savemat(tmp_path / "a.mat", content)
    table = read_table(tmp_path / "a.mat")
    assert set(table.columns) == {"t", "gain", "rig.force"}
    np.testing.assert_array_equal(table.column("t"), np.arange(5.0))
    np.testing.assert_array_equal(table.column("rig.force"), np.arange(5.0))
    assert table.column("gain").tolist() == [3.0]
