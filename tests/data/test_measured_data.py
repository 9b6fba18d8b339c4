"""The maps in data/maps on the measured data: true frequencies, cycles and transients."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mofit.data import check_campaign, import_files, read_campaign, write_campaign
from mofit.data.other_units import other_unit_issues
from mofit.data.repeats import repeated
from mofit.data.signals import analyse, smooth_derivative, steady_samples
from mofit.errors import InputError

ROOT = Path(__file__).parents[2]
DATA = ROOT / "../shared/data"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured data (../shared/data) are not here")


def imported(name, folder):
    return import_files([DATA / folder], ROOT / "data" / "maps" / f"{name}.toml")


@pytest.mark.parametrize("current", ["0", "0x5"])
def test_damper_true_frequencies_amplitudes_and_cycles(tmp_path, current):
    campaign = imported(f"mr_damper_{current}A", "mr_damper_sine")
    assert campaign.tests == tuple(f"sine_{f}Hz" for f in ("0.1", "0.25", "0.5", "1", "3", "5"))
    assert campaign.conditions == {"current": float(current.replace("x", "."))}
    true_amplitudes = [0.02445, 0.02445, 0.02445, 0.00973, 0.00452, 0.00162]
    for test, amplitude in zip(campaign.measurements, true_amplitudes, strict=True):
        record = analyse(test)
        label = test.experiment.frequency
        assert 1.0160 < 1 / record.period / label < 1.0205
        kept = steady_samples(test.time, record.transient, record.tail)
        assert np.ptp(test.channel("displacement")[kept]) / 2 == pytest.approx(amplitude, rel=0.015)
        # the rig ramps up for about a period and stops before the end; the record has 4.7 to 13 cycles
        cycles = len(test.time) * test.experiment.step / record.period
        assert 4.7 < cycles < 13.1
        assert 3 <= record.periods <= cycles - 1
        assert 0.25 * record.period < record.transient < 4.5 * record.period
        assert 0.2 * record.period < record.tail < 1.8 * record.period
        assert record.noise_floor["force"] < 0.02
    write_campaign(campaign, tmp_path / "c.nc")
    assert read_campaign(tmp_path / "c.nc").hash() == campaign.hash()
    said = check_campaign(tmp_path / "c.nc")
    assert {issue.severity for issue in said} == {"warning"}
    assert sum("attribute 'frequency'" in issue.where for issue in said) == 6


def test_damper_velocity_from_displacement():
    campaign = imported("mr_damper_0A", "mr_damper_sine")
    test = campaign["sine_1Hz"]
    table = np.loadtxt(DATA / "mr_damper_sine" / "10mm1Hz0A.txt.gz")
    _, velocity = smooth_derivative(test.time, test.channel("displacement"))
    assert np.std(velocity - table[:, 2] / 1000) < 0.01 * np.std(velocity)


def test_emps_cycles():
    campaign = imported("emps", "emps")
    assert campaign.tests == ("trajectory", "pulses")
    for test in campaign.measurements:
        record = analyse(test)
        # the reference repeats exactly every 6.24 s; the last of the four runs is 0.12 s short
        assert record.period == pytest.approx(6.24, rel=1e-5)
        assert len(test.time) * test.experiment.step / record.period == pytest.approx(4, abs=0.03)
        assert record.periods == 3
        assert (record.transient, record.tail) == (0, 0)
        assert np.ptp(test.channel("displacement")) == pytest.approx(0.2464, rel=1e-3)


def test_emps_force_is_gain_times_voltage():
    from scipy.io import loadmat

    raw = loadmat(DATA / "emps" / "DATA_EMPS.mat", squeeze_me=True)
    force = imported("emps", "emps")["trajectory"].channel("force")
    np.testing.assert_allclose(force, float(raw["gtau"]) * raw["vir"])


def test_silverbox_realisations_and_bursts():
    campaign = imported("silverbox", "silverbox")
    step = 2**14 / 1e7
    arrow = campaign["arrow"]
    assert analyse(arrow).period is None
    for k in range(1, 11):
        test = campaign[f"multisine_{k:02d}"]
        record = analyse(test)
        assert record.period == pytest.approx(8192 * step, rel=1e-6)
        assert record.periods == 1
        kept = steady_samples(test.time, record.transient)
        assert np.count_nonzero(kept) == 8192
        # the lead-in repeats the end of the period to the noise of the generator
        lead = np.count_nonzero(~kept)
        voltage = test.channel("force")
        assert np.std(voltage[:lead] - voltage[8192:]) < 0.02 * np.std(voltage)
        assert 0.1e-3 < record.noise_sd["displacement"] < 0.5e-3
        # an odd multisine: even lines hold nothing
        lines = np.abs(np.fft.rfft(voltage[kept] - voltage.mean()))[:2600]
        assert np.sqrt(np.mean(lines[2::2] ** 2)) < 0.02 * np.sqrt(np.mean(lines[1::2] ** 2))
    for name in ("schroeder_01", "schroeder_02"):
        test = campaign[name]
        record = analyse(test)
        assert record.period == pytest.approx(1024 * step, rel=1e-6)
        assert len(test.time) * step / record.period == pytest.approx(10.94, abs=0.01)
        assert record.periods == 10
        assert record.noise_sd["force"] == pytest.approx(0.27e-3, rel=0.1)
        assert record.noise_sd["displacement"] == pytest.approx(0.3e-3, rel=0.2)


def test_battery_records_of_uneven_stamps(tmp_path):
    campaign = imported("battery_pulses", "battery_pulses")
    assert len(campaign.tests) == 54
    for test in campaign.measurements:
        assert "repeated stamps dropped" in test.history
        assert test.gaps == 0
        # 10 s of discharge at 7.5 A, then 10 s of rest
        assert test.channel("current")[20:80] == pytest.approx(-7.5, abs=0.5)
        assert test.channel("current")[120:180] == pytest.approx(0, abs=0.1)
    map_path = tmp_path / "map.toml"
    text = (ROOT / "data" / "maps" / "battery_pulses.toml").read_text(encoding="utf-8")
    map_path.write_text(text.replace('resample = "10 Hz"', ""), encoding="utf-8")
    with pytest.raises(InputError, match=r"test 'SoC9_Cell1', variable 'time': .*resample = '"):
        import_files([DATA / "battery_pulses"], map_path)


def test_tanks():
    campaign = imported("cascaded_tanks", "cascaded_tanks")
    assert [len(test.time) for test in campaign.measurements] == [1024, 1024]
    # the sensor saturates at 10 V
    assert [int(np.sum(test.channel("level") > 9.99)) for test in campaign.measurements] == [48, 39]


def test_friction_damper():
    campaign = imported("friction_damper", "friction_damper")
    assert len(campaign.tests) == 9
    for test in campaign.measurements[:-1]:
        assert np.ptp(test.channel("displacement")) / 2 == pytest.approx(test.experiment.amplitude, rel=0.05)
        # strokes that ramp up and down: what differs from period to period is no noise
        assert analyse(test).period is None
        assert analyse(test).frequency == pytest.approx(test.experiment.frequency, rel=0.05)


MASTER_CURVE = """
title = "A polymer"
[[tests]]
name = "master"
file = "freq_user_master.csv"
procedure = "free"
time = { column = "f", unit = "s" }
channels.E = { column = "E_stor", unit = "MPa", role = "output" }
"""


@pytest.mark.parametrize(
    ("name", "folder"),
    [("mr_damper_0A", "mr_damper_sine"), ("friction_damper", "friction_damper"), ("emps", "emps")],
)
def test_any_one_test_in_another_unit_is_told_and_none_of_the_data_as_they_are(name, folder):
    """Sines of 0.1 to 5 Hz with strokes of 2 to 25 mm, an earthquake, and a campaign of two tests."""
    tests = list(imported(name, folder).measurements)
    analyses = {test.name: analyse(test) for test in tests}
    assert not list(other_unit_issues(tests, analyses))
    for k, test in enumerate(tests):
        changed = [*tests[:k], replace(test, outputs={"force": 1e-3 * test.channel("force")}), *tests[k + 1 :]]
        (issue,) = other_unit_issues(changed, analyses)
        assert f"'{test.name}'" in issue.where
        assert "variable 'force'" in issue.where
        assert "as if in another unit" in issue.message
        assert "kN" in issue.message


def test_moduli_over_the_frequency_are_no_record(tmp_path):
    (tmp_path / "map.toml").write_text(MASTER_CURVE)
    with pytest.raises(InputError, match=r"variable 'time': "):
        import_files([DATA / "nrel_dma"], tmp_path / "map.toml")


def test_different_cells_under_the_same_pulse_are_no_repeats():
    campaign = imported("battery_pulses", "battery_pulses")
    assert len(campaign.measurements) == 54
    assert repeated(campaign.measurements) == []
