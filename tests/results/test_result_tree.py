"""A result is complete, labelled, written whole, and read back as it was."""

from __future__ import annotations

import numpy as np
import pytest
import result_trees
import synthetic_rigs
import xarray as xr

from mofit.errors import InputError
from mofit.results import Computed, Signal, draw_axes, group_dataset, parameter_layout, quantity, signal_dataset
from mofit.results.io import RESULT_FILE, check_result, open_result, write_result
from mofit.runtime.files import atomic_path, loaded


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    return result_trees.make_result(synthetic_rigs.damper(), steps=30)


@pytest.mark.parametrize("rig", [synthetic_rigs.tyre, synthetic_rigs.damper, synthetic_rigs.oscillator])
@pytest.mark.parametrize("optional", [True, False])
def test_synthetic_results_keep_the_layout(rig, optional) -> None:
    assert check_result(result_trees.make_result(rig(), optional=optional, steps=20)) == []


@pytest.fixture(scope="module")
def content(tree, tmp_path_factory) -> bytes:
    """The tree as a file."""
    return write_result(tree, tmp_path_factory.mktemp("run")).read_bytes()


def test_round_trip_is_exact_and_nothing_is_read_later(tree, tmp_path) -> None:
    file = write_result(tree, tmp_path / "run")
    assert file == tmp_path / "run" / RESULT_FILE
    assert [p.name for p in (tmp_path / "run").iterdir()] == [RESULT_FILE]
    with xr.open_datatree(file) as opened:
        assert opened["modes/m1/posterior"].dims == tree["modes/m1/posterior"].dims
    again = open_result(tmp_path / "run")
    file.unlink()
    assert again.identical(tree)


def test_a_write_replaces_what_was_there(tree, content, tmp_path) -> None:
    (tmp_path / RESULT_FILE).write_bytes(content)
    other = tree.copy()
    other.attrs["title"] = "another"
    assert open_result(write_result(other, tmp_path)).attrs["title"] == "another"


@pytest.mark.parametrize(
    ("damage", "where"),
    [
        (lambda t: t.__delitem__("parameters"), "group 'parameters'"),
        (lambda t: t["modes/m1"].__delitem__("value"), "group 'modes/m1'"),
        (lambda t: t["modes/m1"].__delitem__("sd"), "group 'modes/m1'"),
        (lambda t: t["modes/m1"].attrs.pop("probability"), "group 'modes/m1'"),
        (lambda t: t["modes/m2/posterior"].__delitem__("v_0"), "group 'modes/m2/posterior'"),
        (lambda t: t["observed_data"].__delitem__("10mm_1Hz"), "group 'observed_data'"),
        (lambda t: t["baseline"]["nrmsd"].attrs.pop("units"), "group 'baseline', variable 'nrmsd'"),
        (lambda t: t.attrs.update(seconds="{"), "attribute 'seconds'"),
        (lambda t: t.attrs.pop("seed"), "group '/'"),
        (lambda t: t["front"].update({"nrmsd": t["front"]["nrmsd"].T}), "group 'front', variable 'nrmsd'"),
    ],
)
def test_each_departure_from_the_layout_is_named(tree, tmp_path, damage, where) -> None:
    broken = tree.copy(deep=True)
    damage(broken)
    assert where in [issue.where for issue in check_result(broken)]
    with pytest.raises(InputError):
        write_result(broken, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_all_issues_come_together(tree) -> None:
    broken = tree.copy(deep=True)
    del broken.attrs["seed"]
    del broken["parameters"]
    del broken["modes/m1"]["nrmsd"]
    assert len(check_result(broken)) == 3


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.999])
def test_a_damaged_file_is_one_clear_error(content, tmp_path, keep) -> None:
    (tmp_path / RESULT_FILE).write_bytes(content[: int(keep * len(content))])
    with pytest.raises(InputError, match=r"result\.nc.*(zero length|netCDF)") as caught:
        open_result(tmp_path)
    assert len(caught.value.issues) == 1


def test_missing_and_foreign_files(tmp_path) -> None:
    with pytest.raises(InputError, match="there is no file"):
        open_result(tmp_path)
    with pytest.raises(InputError, match="there is no file"):
        open_result(tmp_path / "nowhere" / "result.nc")
    (tmp_path / "text.nc").write_text("hello")
    with pytest.raises(InputError, match="netCDF"):
        open_result(tmp_path / "text.nc")
    xr.Dataset({"a": ("x", [1.0])}, attrs={"schema": "mofit.campaign/1"}).to_netcdf(tmp_path / "result.nc")
    with pytest.raises(InputError, match=r"mofit\.campaign/1"):
        open_result(tmp_path)


def test_a_result_of_an_earlier_version_asks_for_a_new_identification(tmp_path) -> None:
    xr.Dataset({"a": ("x", [1.0])}, attrs={"schema": "mofit.result/1"}).to_netcdf(tmp_path / "result.nc")
    with pytest.raises(InputError, match=r"(?s)earlier version of mofit.*Run the identification again"):
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


def test_the_parameters_of_a_result_are_a_layout_again() -> None:
    rig = synthetic_rigs.damper()
    tree = result_trees.make_result(rig, steps=20)
    tree.attrs["configuration"] = '{"fixed": {"m": 2.5}}'
    layout = parameter_layout(tree)
    assert layout.names == (*rig.names, "m")
    assert dict(layout.fixed) == {"m": 2.5}
    np.testing.assert_array_equal(layout.space.lower, rig.lower)
    np.testing.assert_allclose(layout.full(layout.space.to_unit(rig.truth)[None]), [[*rig.truth, 2.5]])


def test_the_schema_labels_what_is_written() -> None:
    group = group_dataset("/modes/m2/sample_stats", {"lp": np.zeros((2, 3))}, draw_axes((2, 3)))
    assert (group["lp"].dims, group["lp"].attrs["long_name"]) == (("chain", "draw"), "log posterior density")
    stage = group_dataset(
        "/calibration/spring", {"x": [1.0]}, {}, units={"x": "m"}, long_names={"x": "lateral displacement"}
    )
    assert stage["x"].attrs == {"units": "m", "long_name": "lateral displacement"}


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


@pytest.mark.parametrize("shape", [(40,), (2, 3, 40)], ids=["signal", "draws"])
def test_computed_signals_are_written_as_those_in_memory(tree, tmp_path, shape) -> None:
    known, asked = np.random.default_rng(0).normal(size=shape).astype(np.float32), []

    def compute() -> np.ndarray:
        asked.append(1)
        return known

    def written(values, folder) -> xr.DataTree:
        changed = tree.copy()
        signal = Signal("t", np.arange(40.0), values, "N", "force")
        changed["further"] = xr.DataTree(signal_dataset({"t": signal}))
        return open_result(write_result(changed, tmp_path / folder))

    computed = written(Computed(compute, shape, np.float32), "computed")
    assert computed.identical(written(known, "in memory"))
    assert computed["further/t"].dtype == np.float32
    assert len(asked) == 1


def test_computed_numbers_are_read_in_part_and_kept_only_when_loaded() -> None:
    asked = []

    def compute() -> np.ndarray:
        asked.append(1)
        return np.arange(12.0).reshape(3, 4)

    tree = xr.DataTree(xr.Dataset({"y": quantity(("a", "b"), Computed(compute, (3, 4)), "N", "force")}))
    assert asked == []
    np.testing.assert_array_equal(tree["y"][1, ::2].values, [4.0, 6.0])
    np.testing.assert_array_equal(tree["y"].isel(a=[2, 0]).values, np.arange(12.0).reshape(3, 4)[[2, 0]])
    assert len(asked) == 2
    loaded(tree)
    assert tree["y"].values.sum() == tree["y"].values.sum() == 66.0
    assert len(asked) == 3
