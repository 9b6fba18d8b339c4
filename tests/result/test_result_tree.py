"""A result is complete, labelled, written whole, and read back as it was."""

from __future__ import annotations

import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr

from mofit.errors import InputError
from mofit.result import RESULT_FILE, Signal, atomic_path, check_result, open_result, signal_dataset, write_result


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    return result_trees.make_result(synthetic_rigs.damper(), steps=30)


@pytest.mark.parametrize("rig", [synthetic_rigs.tyre, synthetic_rigs.damper, synthetic_rigs.oscillator])
@pytest.mark.parametrize("optional", [True, False])
def test_synthetic_results_keep_the_layout(rig, optional) -> None:
    assert check_result(result_trees.make_result(rig(), optional=optional, steps=20)) == []


def test_round_trip_is_exact(tree, tmp_path) -> None:
    file = write_result(tree, tmp_path / "run")
    assert file == tmp_path / "run" / RESULT_FILE
    again = open_result(tmp_path / "run")
    assert again.identical(tree)
    assert open_result(file).identical(tree)
    assert [p.name for p in (tmp_path / "run").iterdir()] == [RESULT_FILE]


def test_nothing_is_read_after_the_file_is_closed(tree, tmp_path) -> None:
    file = write_result(tree, tmp_path)
    again = open_result(file)
    file.unlink()
    for node in tree.subtree:
        for name, variable in node.variables.items():
            np.testing.assert_array_equal(again[node.path].variables[name].values, variable.values)


def test_xarray_opens_the_file(tree, tmp_path) -> None:
    with xr.open_datatree(write_result(tree, tmp_path)) as opened:
        assert opened["clusters/c1/posterior"].dims == tree["clusters/c1/posterior"].dims
        assert opened["clusters/c1"]["value"].attrs["units"] == "1"


def test_second_write_replaces_the_first(tree, tmp_path) -> None:
    write_result(tree, tmp_path)
    other = tree.copy()
    other.attrs["title"] = "another"
    write_result(other, tmp_path)
    assert open_result(tmp_path).attrs["title"] == "another"


@pytest.mark.parametrize(
    ("damage", "where"),
    [
        (lambda t: t.__delitem__("parameters"), "group 'parameters'"),
        (lambda t: t["clusters/c1"].__delitem__("value"), "group 'clusters/c1'"),
        (lambda t: t["clusters/c1"].__delitem__("sd"), "group 'clusters/c1'"),
        (lambda t: t["clusters/c1"].attrs.pop("weight"), "group 'clusters/c1'"),
        (lambda t: t["clusters/c2/posterior"].__delitem__("v_0"), "group 'clusters/c2/posterior'"),
        (lambda t: t["observed_data"].__delitem__("10mm_1Hz"), "group 'observed_data'"),
        (lambda t: t["baseline"]["nrmsd"].attrs.pop("units"), "group '/baseline', variable 'nrmsd'"),
        (lambda t: t.attrs.update(seconds="{"), "attribute 'seconds'"),
        (lambda t: t.attrs.pop("seed"), "group '/'"),
        (lambda t: t["front"].update({"nrmsd": t["front"]["nrmsd"].T}), "group 'front', variable 'nrmsd'"),
    ],
)
def test_each_departure_from_the_layout_is_named(tree, tmp_path, damage, where) -> None:
    broken = tree.copy(deep=True)
    damage(broken)
    assert where in [fault.where for fault in check_result(broken)]
    with pytest.raises(InputError):
        write_result(broken, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_all_faults_come_together(tree) -> None:
    broken = tree.copy(deep=True)
    del broken.attrs["seed"]
    del broken["parameters"]
    del broken["clusters/c1"]["nrmsd"]
    assert len(check_result(broken)) == 3


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.999])
def test_a_damaged_file_is_one_clear_error(tree, tmp_path, keep) -> None:
    file = write_result(tree, tmp_path)
    whole = file.read_bytes()
    file.write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(InputError, match=r"result\.nc.*(empty|netCDF)") as caught:
        open_result(tmp_path)
    assert len(caught.value.faults) == 1


def test_missing_and_foreign_files(tmp_path) -> None:
    with pytest.raises(InputError, match="no such file"):
        open_result(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        open_result(tmp_path / "nowhere" / "result.nc")
    (tmp_path / "text.nc").write_text("hello")
    with pytest.raises(InputError, match="netCDF"):
        open_result(tmp_path / "text.nc")
    xr.Dataset({"a": ("x", [1.0])}, attrs={"schema": "mofit.campaign/1"}).to_netcdf(tmp_path / "result.nc")
    with pytest.raises(InputError, match=r"mofit\.campaign/1"):
        open_result(tmp_path)


def test_a_failed_write_leaves_the_old_file(tmp_path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")

    def fail_midway() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail_midway()
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_signals_of_different_length_live_in_one_dataset() -> None:
    data = signal_dataset(
        {
            "a": Signal("a", np.arange(5.0), np.zeros(5), "N", "force"),
            "b": Signal("b", np.arange(7.0), np.zeros((2, 3, 7)), "N", "force"),
        }
    )
    assert data["a"].dims == ("time_a",)
    assert data["b"].dims == ("chain", "draw", "time_b")
    assert data["time_b"].attrs["units"] == "s"
