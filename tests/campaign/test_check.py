from dataclasses import replace

import numpy as np
import pytest

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.campaign_file import write_campaign
from mofit.check import check_campaign

UNITS = {"slip_angle": "rad", "lateral_force": "N"}
CONDITIONS = {"vertical_force": 3000.0, "longitudinal_velocity": 2.0, "dynamic_rolling_radius": 0.3}


def faults_of(folder, *tests, conditions=CONDITIONS):
    path = folder / "c.nc"
    write_campaign(Campaign("t", "measured", conditions, tests), path)
    return check_campaign(path)


def sine(name="a", noise=0.005, change=lambda time, force: force, seed=0, **about):
    time = np.arange(1000) * 0.01
    angle = 0.02 * np.sin(2 * np.pi * time)
    force = 100 * np.sin(2 * np.pi * time + 0.3) + 100 * noise * np.random.default_rng(seed).normal(size=1000)
    about = {"frequency": 1.0, "amplitude": 0.02} | about
    procedure = Procedure(name, about.pop("kind", "sine"), time, {"slip_angle": angle}, **about)
    return Measurement(procedure, {"lateral_force": change(time, force)}, UNITS)


def test_a_good_campaign_has_no_faults(tmp_path):
    assert faults_of(tmp_path, sine(), sine("b", seed=1)) == []


ODD = {
    "frequency off": (sine(frequency=0.98), r"labelled 0.98 Hz, the data say 1 Hz"),
    "amplitude off": (sine(amplitude=0.03), r"labelled 0.03, half the range of 'slip_angle' is 0.02"),
    "clipped": (sine(change=lambda t, f: np.clip(f, -80, None)), r"equal samples in a row at its extreme"),
    "drift": (sine(change=lambda t, f: f + 3 * t), r"its mean drifts by \+"),
    "coarse": (sine(change=lambda t, f: np.round(f / 10) * 10), r"resolved in steps of 5.0 % of its range"),
    "noisy": (sine(noise=1.0), r"noise is \d+ % of its range"),
    "rig stops": (sine(change=lambda t, f: np.where(t > 8, 0, f)), r"the last .* do not repeat: the rig stopped"),
}


@pytest.mark.parametrize("kind", ODD)
def test_what_is_odd_is_a_warning_with_a_cure(tmp_path, kind):
    import re

    test, message = ODD[kind]
    faults = faults_of(tmp_path, test)
    assert [f for f in faults if re.search(message, str(f)) and f.where.startswith("group 'a'")], faults
    assert {f.severity for f in faults} == {"warning"}
    assert all(f.cure for f in faults)


def test_a_quantised_smooth_peak_is_not_clipped(tmp_path):
    faults = faults_of(tmp_path, sine(noise=0, change=lambda t, f: np.round(f)))
    assert not [fault for fault in faults if "extreme" in fault.what]


def test_a_sine_test_whose_input_is_none(tmp_path):
    time = np.arange(1000) * 0.01
    rng = np.random.default_rng(0)
    procedure = Procedure("a", "sine", time, {"slip_angle": rng.normal(size=1000)}, frequency=1.0)
    faults = faults_of(tmp_path, Measurement(procedure, {"lateral_force": rng.normal(size=1000)}, UNITS))
    assert "a sine test whose input does not repeat" in {fault.what for fault in faults}


def test_few_samples_and_few_periods(tmp_path):
    time = np.arange(100) * 0.1
    phase = 2 * np.pi * 1.03 * time
    procedure = Procedure("fast", "sine", time, {"slip_angle": 0.02 * np.sin(phase)}, frequency=1.03)
    fast = Measurement(procedure, {"lateral_force": np.cos(phase)}, UNITS)
    short = sine("short")
    cut = slice(0, 150)
    short = Measurement(
        replace(short.procedure, time=short.time[cut], inputs={"slip_angle": short.channel("slip_angle")[cut]}),
        {"lateral_force": short.channel("lateral_force")[cut]}, UNITS,
    )  # fmt: skip
    said = [fault.what for fault in faults_of(tmp_path, fast, short)]
    assert [what for what in said if "9.7 samples per period" in what]
    assert [what for what in said if "only one whole period" in what]


def test_copies_overlaps_and_missing_conditions(tmp_path):
    one, copy = sine(start_time=0.0), sine("copy", start_time=5.0)
    faults = faults_of(tmp_path, one, copy, conditions={"vertical_force": 3000.0})
    said = " ".join(str(fault) for fault in faults)
    assert "groups 'a' and 'copy': hold the same output" in said
    assert "groups 'a' and 'copy': overlap in time" in said
    assert "group 'a': no condition 'longitudinal_velocity'" in said


def test_errors_come_before_warnings(tmp_path):
    import netCDF4

    faults_of(tmp_path, sine(frequency=0.98), sine("b", seed=1))
    with netCDF4.Dataset(tmp_path / "c.nc", "a") as file:
        file["b"]["lateral_force"].units = "Pa"
    severities = [fault.severity for fault in check_campaign(tmp_path / "c.nc")]
    assert severities[0] == "error"
    assert severities == sorted(severities)
