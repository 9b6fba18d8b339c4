"""Values within values become columns with names, and every record of a file a test."""

import json

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.data import import_files
from mofit.data.importers.nested import flat_columns
from mofit.data.importers.table import read_table
from mofit.errors import InputError

TIME = np.arange(50) / 10
WAVES = [np.sin((k + 1) * TIME) for k in range(3)]
MAP = r"""
title = "Rig"
[[tests]]
name = "run_{k}"
file = "FILE"
records = 'rig\.runs\.(?P<k>\d+)'
procedure = "free"
time = { column = "t", unit = "s" }
channels.displacement = { column = "x", unit = "mm" }
channels.force = { column = "F", unit = "N", scale = "rig.gain" }
conditions.temperature = "2{k} degC"
"""


def runs(convert=lambda array: array):
    return [{"t": convert(TIME), "x": convert(wave), "F": convert(2 * wave), "note": "text"} for wave in WAVES]


def write_json(path):
    path.write_text(json.dumps({"rig": {"runs": runs(np.ndarray.tolist), "gain": 3.0, "name": "Rig 7"}}))


def write_mat_cell(path):
    from scipy.io import savemat

    cell = np.empty(3, dtype=object)
    cell[:] = runs()
    savemat(path, {"rig": {"runs": cell, "gain": 3.0, "name": "Rig 7"}})


def write_mat_struct_array(path):
    from scipy.io import savemat

    fields = [(name, object) for name in ("t", "x", "F", "note")]
    array = np.array([tuple(run.values()) for run in runs()], dtype=fields)
    savemat(path, {"rig": {"runs": array, "gain": 3.0}})


def hdf5_file(path):
    """A file with the references that MATLAB keeps beside its variables."""
    file = h5py.File(path, "w")
    rig = file.create_group("rig")
    rig.create_dataset("gain", data=np.array([[3.0]])).attrs["MATLAB_class"] = np.bytes_("double")
    return file, rig, file.create_group("#refs#")


def write_mat73_cell(path):
    file, rig, kept = hdf5_file(path)
    with file:
        cell = rig.create_dataset("runs", (3, 1), dtype=h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        for k, run in enumerate(runs()):
            struct = kept.create_group(f"s{k}")
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for name in ("t", "x", "F"):
                struct.create_dataset(name, data=run[name][None, :]).attrs["MATLAB_class"] = np.bytes_("double")
            cell[k, 0] = struct.ref


def write_mat73_struct_array(path):
    file, rig, kept = hdf5_file(path)
    with file:
        array = rig.create_group("runs")
        array.attrs["MATLAB_class"] = np.bytes_("struct")
        for name in ("t", "x", "F"):
            references = array.create_dataset(name, (3, 1), dtype=h5py.ref_dtype)
            for k, run in enumerate(runs()):
                value = kept.create_dataset(f"{name}{k}", data=run[name][None, :])
                value.attrs["MATLAB_class"] = np.bytes_("double")
                references[k, 0] = value.ref


WRITERS = {
    "a.json": write_json,
    "cell.mat": write_mat_cell,
    "struct_array.mat": write_mat_struct_array,
    "cell73.mat": write_mat73_cell,
    "struct_array73.mat": write_mat73_struct_array,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_record_of_a_file_becomes_a_test(tmp_path, reader, name):
    WRITERS[name](tmp_path / name)
    (tmp_path / "map.toml").write_text(MAP.replace("FILE", name))
    campaign = import_files([], tmp_path / "map.toml", reader)
    assert campaign.tests == ("run_1", "run_2", "run_3")
    for k, (test, wave) in enumerate(zip(campaign.measurements, WAVES, strict=True), 1):
        np.testing.assert_array_equal(test.time, TIME)
        np.testing.assert_allclose(test.channel("displacement"), wave / 1000)
        np.testing.assert_allclose(test.channel("force"), 6 * wave)
        assert test.experiment.conditions["temperature"] == pytest.approx(273.15 + 20 + k)


def test_a_pattern_of_files_and_one_of_records_fill_one_name(tmp_path, reader):
    for rig in "AB":
        write_json(tmp_path / f"rig{rig}.json")
    files = MAP.replace('file = "FILE"', "pattern = 'rig(?P<rig>.)\\.json'").replace("run_{k}", "{rig}{k}")
    (tmp_path / "map.toml").write_text(files)
    assert import_files([tmp_path], tmp_path / "map.toml", reader).tests == ("A1", "A2", "A3", "B1", "B2", "B3")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (r"runs\.", r"rums\.", r"test 'run_\{k\}': no record matches .*has the records rig, rig\.runs, rig\.runs\.1"),
        ("<k>", "<n>", r"records '.*': 'k'\. Write a regular expression"),
        (r"\d+)'", r"\d+'", r"records '.*': missing \)"),
        ('column = "x"', 'column = "y"', r"file 'a\.json, record rig\.runs\.1': no column 'y'"),
    ],
)
def test_records_that_are_not_there_are_named(tmp_path, reader, old, new, message):
    write_json(tmp_path / "a.json")
    assert old in MAP
    (tmp_path / "map.toml").write_text(MAP.replace("FILE", "a.json").replace(old, new))
    with pytest.raises(InputError, match=message):
        import_files([], tmp_path / "map.toml", reader)


SHAPES = {
    "columns by name": {"t": [0, 1, 2], "x": [1.5, None, 3]},
    "rows": [{"t": 0, "x": 1.5}, {"t": 1}, {"t": 2, "x": 3}],
    "names and rows": {"columns": ["t", "x"], "data": [[0, 1.5], [1, None], [2, 3]]},
}


@pytest.mark.parametrize("shape", SHAPES)
def test_three_shapes_of_one_json_table(tmp_path, reader, shape):
    (tmp_path / "a.json").write_text(json.dumps(SHAPES[shape]))
    table = read_table(tmp_path / "a.json", reader)
    assert list(table.columns) == ["t", "x"]
    np.testing.assert_array_equal(table.column("t"), [0, 1, 2])
    np.testing.assert_array_equal(table.column("x"), [1.5, np.nan, 3])


@given(
    matrix=st.integers(1, 4).flatmap(
        lambda width: st.lists(
            st.lists(st.floats(-1e9, 1e9), min_size=width, max_size=width), min_size=width, max_size=9
        )
    )
)
def test_a_matrix_is_read_along_its_longer_side(matrix):
    array = np.array(matrix)
    for value in (matrix, array, array.T.tolist()) if array.shape[0] > array.shape[1] else (matrix, array):
        columns, _ = flat_columns({"m": value, "n": value})
        assert list(columns)[: array.shape[1]] == [f"m.{k}" for k in range(1, array.shape[1] + 1)]
        np.testing.assert_array_equal(np.stack(list(columns.values()))[: array.shape[1]].T, array)


def test_clocks_and_what_is_passed_over():
    value = {
        "stamp": ["2021-03-04T10:11:12Z", "2021-03-04T10:11:12.5Z"],
        "text": ["1", "2"],
        "none": None,
        "empty": [],
        "deep": [[[1.0, 2.0]]],
        "on": [True, False],
        "huge": [10**400],
    }
    columns, units = flat_columns(value)
    assert set(columns) == {"stamp", "on"}
    assert columns["stamp"].tolist() == [0, 0.5]
    assert units == {"stamp": "s"}


def test_a_json_file_nested_without_end_is_refused(tmp_path, reader):
    (tmp_path / "a.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match=r"not a readable JSON file|crashed"):
        read_table(tmp_path / "a.json", reader)
