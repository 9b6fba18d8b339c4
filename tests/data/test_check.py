from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement, check_campaign, write_campaign

UNITS = {"slip_angle": "rad", "lateral_force": "N"}
CONDITIONS = {"vertical_force": 3000.0, "longitudinal_velocity": 2.0, "dynamic_rolling_radius": 0.3}


def issues_of(folder, *tests, conditions=CONDITIONS):
    path = folder / "c.nc"
    write_campaign(Campaign("t", "measured", conditions, tests), path)
    return check_campaign(path)


def sine(name="a", noise=0.005, change=lambda time, force: force, seed=0, **about):
    time = np.arange(1000) * 0.01
    angle = 0.02 * np.sin(2 * np.pi * time)
    force = 100 * np.sin(2 * np.pi * time + 0.3) + 100 * noise * np.random.default_rng(seed).normal(size=1000)
    about = {"frequency": 1.0, "amplitude": 0.02} | about
    experiment = Experiment(name, about.pop("kind", "sine"), time, {"slip_angle": angle}, **about)
    return Measurement(experiment, {"lateral_force": change(time, force)}, UNITS)


def test_a_good_campaign_has_no_issues(tmp_path):
    assert issues_of(tmp_path, sine(), sine("b", seed=1)) == []


WARNINGS = {
    "frequency off": (sine(frequency=0.98), r"labelled 0.98 Hz, the data show 1 Hz"),
    "amplitude off": (sine(amplitude=0.03), r"labelled 0.03, half the range of 'slip_angle' is 0.02"),
    "clipped": (sine(change=lambda t, f: np.clip(f, -80, None)), r"equal samples in a row at its extreme"),
    "drift": (sine(change=lambda t, f: f + 3 * t), r"its mean drifts by \+"),
    "coarse": (sine(change=lambda t, f: np.round(f / 10) * 10), r"resolved in steps of 5.0 % of its range"),
    "noisy": (sine(noise=1.0), r"noise is \d+ % of its range"),
    "rig stops": (sine(change=lambda t, f: np.where(t > 8, 0, f)), r"the last .* do not repeat: the rig stopped"),
}


@pytest.mark.parametrize("kind", WARNINGS)
def test_a_warning_names_the_place_and_a_hint(tmp_path, kind):
    import re

    test, message = WARNINGS[kind]
    issues = issues_of(tmp_path, test)
    assert [f for f in issues if re.search(message, str(f)) and f.where.startswith("group 'a'")], issues
    assert {f.severity for f in issues} == {"warning"}
    assert all(f.hint for f in issues)


def test_a_campaign_itself_is_checked_as_its_file_is(tmp_path):
    tests = (WARNINGS["drift"][0], sine("b", seed=1))
    found = check_campaign(Campaign("t", "measured", CONDITIONS, tests))
    assert [str(issue) for issue in found] == [str(issue) for issue in issues_of(tmp_path, *tests)]
    assert "drifts" in str(found[0])


def test_a_quantised_smooth_peak_is_not_clipped(tmp_path):
    issues = issues_of(tmp_path, sine(noise=0, change=lambda t, f: np.round(f)))
    assert not [issue for issue in issues if "extreme" in issue.message]


def test_a_sine_test_whose_input_is_none(tmp_path):
    time = np.arange(1000) * 0.01
    rng = np.random.default_rng(0)
    experiment = Experiment("a", "sine", time, {"slip_angle": rng.normal(size=1000)}, frequency=1.0)
    issues = issues_of(tmp_path, Measurement(experiment, {"lateral_force": rng.normal(size=1000)}, UNITS))
    assert "a sine test whose input does not repeat" in {issue.message for issue in issues}


def test_few_samples_and_few_periods(tmp_path):
    time = np.arange(100) * 0.1
    phase = 2 * np.pi * 1.03 * time
    experiment = Experiment("fast", "sine", time, {"slip_angle": 0.02 * np.sin(phase)}, frequency=1.03)
    fast = Measurement(experiment, {"lateral_force": np.cos(phase)}, UNITS)
    short = sine("short")
    cut = slice(0, 150)
    short = Measurement(
        replace(short.experiment, time=short.time[cut], inputs={"slip_angle": short.channel("slip_angle")[cut]}),
        {"lateral_force": short.channel("lateral_force")[cut]}, UNITS,
    )  # fmt: skip
    said = [issue.message for issue in issues_of(tmp_path, fast, short)]
    assert [what for what in said if "9.7 samples per period" in what]
    assert [what for what in said if "only one whole period" in what]


def test_copies_overlaps_and_missing_conditions(tmp_path):
    one, copy = sine(start_time=0.0), sine("copy", start_time=5.0)
    issues = issues_of(tmp_path, one, copy, conditions={"vertical_force": 3000.0})
    said = " ".join(str(issue) for issue in issues)
    assert "groups 'a' and 'copy': hold the same output" in said
    assert "groups 'a' and 'copy': overlap in time" in said
    assert "group 'a': no condition 'longitudinal_velocity'" in said


def test_errors_come_before_warnings(tmp_path):
    import netCDF4

    issues_of(tmp_path, sine(frequency=0.98), sine("b", seed=1))
    with netCDF4.Dataset(tmp_path / "c.nc", "a") as file:
        file["b"]["lateral_force"].units = "Pa"
    severities = [issue.severity for issue in check_campaign(tmp_path / "c.nc")]
    assert severities[0] == "error"
    assert severities == sorted(severities)
