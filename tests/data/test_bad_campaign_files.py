"""Every way in which a campaign file can be bad: one list that names the place and a hint, never a traceback."""

import numpy as np
import pytest
import xarray as xr

from mofit.data import check_campaign
from mofit.data.campaign_file import load, read_campaign, write_campaign
from mofit.errors import InputError


def tree():
    """A sound campaign as plain data, to be spoilt."""
    time = np.arange(600) * 0.01
    wave = np.sin(2 * np.pi * time)
    group = xr.Dataset(
        {
            "slip_angle": ("time", 0.02 * wave, {"units": "rad"}),
            "lateral_force": ("time", 100 * wave + 0.5 * np.random.default_rng(0).normal(size=600), {"units": "N"}),
        },
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"procedure": "sine", "frequency": 1.0, "amplitude": 0.02},
    )
    conditions = {"vertical_force": (3000.0, "N"), "longitudinal_velocity": (2.0, "m/s")}
    conditions["dynamic_rolling_radius"] = (0.3, "m")
    root = xr.Dataset(
        {name: ((), value, {"units": unit}) for name, (value, unit) in conditions.items()},
        attrs={"schema": "mofit.campaign/1", "title": "t", "source": "measured"},
    )
    return {"/": root, "/one": group}


def set_time(change):
    def spoil(parts):
        time = np.array(parts["/one"].time.values)
        parts["/one"] = parts["/one"].assign_coords(time=("time", change(time), {"units": "s"}))

    return spoil


def set_values(name, change):
    def spoil(parts):
        variable = parts["/one"][name]
        parts["/one"][name] = ("time", change(np.array(variable.values)), variable.attrs)

    return spoil


def set_attribute(place, key, value, variable=None):
    def spoil(parts):
        attrs = parts[place].attrs if variable is None else parts[place][variable].attrs
        if value is None:
            del attrs[key]
        else:
            attrs[key] = value

    return spoil


def drop(name):
    def spoil(parts):
        parts["/one"] = parts["/one"].drop_vars(name)

    return spoil


def with_nan(values, at=17):
    values[at] = np.nan
    return values


def lack(parts):
    del parts["/one"]


BAD = {
    "missing group": (lack, r"root: no test groups"),
    "missing schema": (set_attribute("/", "schema", None), r"attribute 'schema': missing"),
    "other schema": (set_attribute("/", "schema", "mofit.campaign/9"), r"unknown schema 'mofit.campaign/9'"),
    "missing source": (set_attribute("/", "source", None), r"attribute 'source': missing"),
    "other source": (set_attribute("/", "source", "guessed"), r"attribute 'source': is 'guessed'"),
    "missing time": (drop("time"), r"group 'one': no variable 'time'"),
    "missing input": (drop("slip_angle"), r"group 'one': no input channel"),
    "missing output": (drop("lateral_force"), r"group 'one': no output channel"),
    "missing procedure": (set_attribute("/one", "procedure", None), r"group 'one', attribute 'procedure': missing"),
    "unknown procedure": (set_attribute("/one", "procedure", "sinus"), r"unknown value 'sinus'. Did you mean 'sine'"),
    "old name of the interpolation": (
        set_attribute("/one", "hold", "linear"),
        r"group 'one', attribute 'hold': no longer read. Rename it to 'interpolation'",
    ),
    "unknown interpolation": (
        set_attribute("/one", "interpolation", "cubical"),
        r"attribute 'interpolation'.*Did you mean 'cubic'",
    ),
    "bad role": (set_attribute("/one", "role", "inputs", "slip_angle"), r"'slip_angle': role 'inputs'"),
    "wrong unit": (
        set_attribute("/one", "units", "bar", "lateral_force"),
        r"group 'one', variable 'lateral_force': unit 'bar' does not fit 'N'",
    ),
    "wrong unit of time": (set_attribute("/one", "units", "m", "time"), r"variable 'time': unit 'm' does not fit 's'"),
    "unknown unit": (set_attribute("/one", "units", "newtoon", "lateral_force"), r"unknown unit 'newtoon'"),
    "missing unit": (set_attribute("/one", "units", None, "slip_angle"), r"'slip_angle', attribute 'units': missing"),
    "missing unit of time": (set_attribute("/one", "units", None, "time"), r"'time', attribute 'units': missing"),
    "wrong unit of condition": (
        set_attribute("/", "units", "kg", "vertical_force"),
        r"root, variable 'vertical_force': unit 'kg' does not fit 'N'",
    ),
    "NaN in time": (set_time(with_nan), r"variable 'time': 1 of 600 samples are NaN .* index 17"),
    "gap in time": (set_time(lambda t: t + (t > 2) * 0.5), r"variable 'time': 1 gap\(s\), the first after 2 s"),
    "time going back": (set_time(lambda t: np.where(t > 3, t - 1, t)), r"'time': goes back after sample 300"),
    "non-uniform time": (set_time(lambda t: t + 2e-3 * np.sin(t)), r"variable 'time': not uniform"),
    "NaN in a channel": (set_values("lateral_force", with_nan), r"'lateral_force': 1 of 600 samples are NaN"),
    "constant output": (set_values("lateral_force", lambda v: 0 * v + 3), r"the output is constant \(3\)"),
    "constant input": (set_values("slip_angle", lambda v: 0 * v), r"the input is constant \(0\)"),
    "no whole period": (set_attribute("/one", "frequency", 0.1), r"no whole period: 0.6 periods of 0.1 Hz"),
    "no frequency": (set_attribute("/one", "frequency", -1.0), r"attribute 'frequency': frequency is -1 Hz"),
    "text for a number": (set_attribute("/one", "frequency", "one"), r"'frequency': 'one' is no finite number"),
}  # fmt: skip


def write(path, parts):
    xr.DataTree.from_dict(parts).to_netcdf(path)


def test_the_sound_file_is_sound(tmp_path):
    write(tmp_path / "c.nc", tree())
    assert check_campaign(tmp_path / "c.nc") == []


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_file_is_refused_with_place_and_hint(tmp_path, kind):
    spoil, message = BAD[kind]
    parts = tree()
    spoil(parts)
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError, match=message) as caught:
        read_campaign(tmp_path / "c.nc")
    assert len(caught.value.issues) == 1
    assert all(issue.hint for issue in caught.value.issues)
    assert set(caught.value.issues) <= set(check_campaign(tmp_path / "c.nc"))


def test_all_issues_come_in_one_list(tmp_path):
    parts = tree()
    parts["/two"] = parts["/one"].copy(deep=True)
    kinds = ("wrong unit of condition", "wrong unit", "gap in time", "unknown interpolation", "missing source")
    for kind in kinds:
        BAD[kind][0](parts)
    parts["/two"].attrs["procedure"] = "tap"
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError) as caught:
        read_campaign(tmp_path / "c.nc")
    assert len(caught.value.issues) == len(kinds) + 1


def test_too_short_a_record(tmp_path):
    parts = tree()
    parts["/one"] = parts["/one"].isel(time=slice(0, 5))
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError, match="'time': 5 samples"):
        read_campaign(tmp_path / "c.nc")


def test_an_empty_time_axis(tmp_path):
    parts = tree()
    parts["/one"] = parts["/one"].isel(time=slice(0, 0))
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError, match="'time': 0 samples"):
        read_campaign(tmp_path / "c.nc")


@pytest.mark.parametrize("dims", [("time", "axle"), ("sample",)])
def test_a_channel_over_other_dimensions(tmp_path, dims):
    parts = tree()
    parts["/one"]["lateral_force"] = (
        dims,
        np.zeros((600, 2))[:, 0] if len(dims) == 1 else np.zeros((600, 2)),
        {"units": "N"},
    )
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError, match="not over 'time' alone"):
        read_campaign(tmp_path / "c.nc")


def test_a_channel_of_text(tmp_path):
    parts = tree()
    parts["/one"]["lateral_force"] = ("time", np.array(["a"] * 600), {"units": "N"})
    write(tmp_path / "c.nc", parts)
    with pytest.raises(InputError, match=r"'lateral_force': holds .*, not numbers"):
        read_campaign(tmp_path / "c.nc")


def test_a_channel_at_the_root_is_named(tmp_path):
    parts = tree()
    parts["/"]["lateral_force"] = ("sample", np.zeros(4), {"units": "N"})
    write(tmp_path / "c.nc", parts)
    assert "outside any test group" in str(load(tmp_path / "c.nc")[1][0])


@pytest.mark.parametrize("content", [b"", b"CDF?", b"\x89HDF\r\n\x1a\n" + b"\0" * 600, b"time,force\n0,1\n"])
def test_a_file_that_is_no_netcdf(tmp_path, content):
    path = tmp_path / "c.nc"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"file 'c\.nc': (the file has zero length|not a readable netCDF-4)") as caught:
        read_campaign(path)
    assert len(caught.value.issues) == 1
    assert len(check_campaign(path)) == 1


@pytest.mark.parametrize("share", [0.05, 0.3, 0.6, 0.9, 0.999])
def test_a_truncated_file(tmp_path, campaign, share):
    path = tmp_path / "c.nc"
    write_campaign(campaign, path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match="truncated, damaged"):
        read_campaign(path)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        read_campaign(tmp_path / "none.nc")
    assert check_campaign(tmp_path)[0].hint == "Check the path"
