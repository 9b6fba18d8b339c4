import hashlib
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from labels import unlabelled

from mofit.data import Campaign, Experiment, Measurement, read_campaign, write_campaign
from mofit.errors import InputError

FINITE = st.floats(-1e6, 1e6, allow_nan=False)
NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,8}(\.[0-9]Hz)?", fullmatch=True)


@st.composite
def campaigns(draw):
    tests = []
    for name in draw(st.lists(NAMES, min_size=1, max_size=3, unique=True)):
        n = draw(st.integers(8, 40))
        time = np.arange(n) * draw(st.floats(1e-3, 0.1))
        rng = np.random.default_rng(draw(st.integers(0, 99)))
        experiment = Experiment(
            name,
            draw(st.sampled_from(["step", "free", "chirp", "quasi_static"])),
            time,
            {"slip_angle": rng.normal(size=n)},
            draw(st.dictionaries(st.sampled_from(["camber_angle", "vertical_force", "preload"]), FINITE, max_size=2)),
            start_time=draw(st.none() | FINITE),
            amplitude=draw(st.none() | FINITE),
            interpolation=draw(st.sampled_from(["", "cubic", "linear"])),
            transient=draw(st.none() | st.floats(0, 1)),
        )
        outputs = {"lateral_force": rng.normal(size=n), "belt_speed": rng.normal(size=n)}
        units = {"slip_angle": "rad", "lateral_force": "N", "belt_speed": "rad/s"}
        tests.append(Measurement(experiment, outputs, units))
    title = draw(st.text(st.characters(codec="utf-8", exclude_categories=("C",)), min_size=1, max_size=20))
    conditions = draw(st.dictionaries(st.sampled_from(["vertical_force", "preload"]), FINITE, max_size=2))
    source = draw(st.sampled_from(["measured", "simulated"]))
    return Campaign(title, source, conditions, tuple(tests), {"note": "x", "count": 3}, {"preload": "N m"})


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(campaign=campaigns())
def test_write_then_read_gives_the_same_campaign(tmp_path, campaign):
    write_campaign(campaign, tmp_path / "c.nc")
    with xr.open_datatree(tmp_path / "c.nc") as stored:
        assert unlabelled(stored) == []
    back = read_campaign(tmp_path / "c.nc")
    assert back.hash() == campaign.hash()
    assert back.tests == campaign.tests
    assert dict(back.attributes) == {"note": "x", "count": 3}
    for one, other in zip(back.measurements, campaign.measurements, strict=True):
        np.testing.assert_array_equal(one.channel("belt_speed"), other.channel("belt_speed"))
        assert dict(one.experiment.conditions) == dict(other.experiment.conditions)
    if "preload" in campaign.conditions:
        assert back.units["preload"] == "N m"


def test_the_same_campaign_gives_the_same_bytes(tmp_path, campaign):
    for name in ("a.nc", "b.nc"):
        write_campaign(campaign, tmp_path / name)
    digests = {hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in ("a.nc", "b.nc")}
    assert len(digests) == 1


def test_the_hash_sees_every_number_and_name(campaign, make_test):
    hashes = {campaign.hash(), campaign.select(["sine_1Hz"]).hash(), campaign.select(["sine_2Hz", "sine_1Hz"]).hash()}
    for change in ({"noise": 0.011}, {"label": 1.01}, {"name": "other"}, {"seed": 5}):
        tests = (make_test(**change), campaign.measurements[1])
        hashes.add(Campaign(campaign.title, campaign.source, campaign.conditions, tests).hash())
    assert len(hashes) == 7


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path, campaign, monkeypatch):
    path = tmp_path / "c.nc"
    write_campaign(campaign, path)
    before = path.read_bytes()

    def fail(self, target, **_):
        target.write_bytes(b"half a file")
        raise KeyboardInterrupt

    monkeypatch.setattr(xr.DataTree, "to_netcdf", fail)
    with pytest.raises(KeyboardInterrupt):
        write_campaign(campaign, path)
    assert path.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["c.nc"]


def test_a_folder_that_is_not_there(tmp_path, campaign):
    with pytest.raises(InputError, match="its folder is not there"):
        write_campaign(campaign, tmp_path / "none" / "c.nc")


def test_units_in_a_file_are_converted(tmp_path):
    t_ms = np.arange(100) * 10.0
    wave = np.sin(2 * np.pi * t_ms / 1000)
    root = xr.Dataset(
        {"vertical_force": ((), 3.0, {"units": "kN"}), "longitudinal_velocity": ((), 7.2, {"units": "km/h"}),
         "inflation_pressure": ((), 2.5, {"units": "bar"})},
        attrs={"schema": "mofit.campaign/1", "title": "t", "source": "measured"},
    )  # fmt: skip
    group = xr.Dataset(
        {"slip_angle": ("time", wave, {"units": "deg"}), "lateral_force": ("time", wave, {"units": "kN"}),
         "camber_angle": ((), 90.0, {"units": "deg"})},
        coords={"time": ("time", t_ms, {"units": "ms"})},
        attrs={"procedure": "sine", "frequency": 1.0, "amplitude": 0.0175},
    )  # fmt: skip
    xr.DataTree.from_dict({"/": root, "/one": group}).to_netcdf(tmp_path / "c.nc")
    campaign = read_campaign(tmp_path / "c.nc")
    test = campaign["one"]
    assert campaign.conditions == pytest.approx(
        {"vertical_force": 3000.0, "longitudinal_velocity": 2.0, "inflation_pressure": 2.5e5}
    )
    assert test.experiment.conditions["camber_angle"] == pytest.approx(np.pi / 2)
    assert test.experiment.step == pytest.approx(0.01)
    np.testing.assert_allclose(test.channel("slip_angle"), np.deg2rad(wave))
    np.testing.assert_allclose(test.channel("lateral_force"), 1000 * wave)
    assert test.units == {"slip_angle": "rad", "lateral_force": "N"}


def test_reading_si_units_imports_no_converter_of_units(tmp_path, campaign):
    path = tmp_path / "campaign.nc"
    write_campaign(campaign, path)
    script = f"import sys, mofit.data; mofit.data.read_campaign({str(path)!r}); sys.exit('pint' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_selecting_and_asking_name_what_is_missing(campaign):
    with pytest.raises(InputError, match=r"sine_3Hz.*Did you mean 'sine_2Hz'|sine_3Hz.*Did you mean 'sine_1Hz'"):
        campaign.select(["sine_3Hz"])
    with pytest.raises(InputError, match=r"test 'sine_1Hz': no channel 'lateral_forse'.*'lateral_force'"):
        campaign["sine_1Hz"].channel("lateral_forse")
    with pytest.raises(InputError, match="used twice"):
        Campaign("t", "measured", {}, campaign.measurements + campaign.measurements)
    with pytest.raises(InputError, match=r"'sinus'.*'sine'"):
        Experiment("x", "sinus", np.arange(9.0), {})


def test_a_step_is_linear_between_samples_by_default():
    time = np.arange(9.0)
    assert Experiment("x", "step", time, {}).interpolation == "linear"
    assert Experiment("x", "sine", time, {}).interpolation == "cubic"
    assert Experiment("x", "sine", time, {}, interpolation="linear").interpolation == "linear"
