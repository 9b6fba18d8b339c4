"""Uneven stamps, gaps and several rates: refused with a cure, or resampled as the map says."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mofit.cli import main
from mofit.data import check_campaign, import_files, read_campaign
from mofit.errors import InputError

MAP = """
title = "A damper"
[[tests]]
name = "run"
file = "run.csv"
procedure = "free"
{keys}
time = {{ column = "t", unit = "s" }}
channels.displacement = {{ column = "x", unit = "m" }}
channels.force = {{ column = "F", unit = "N" }}
"""
RATE = 100.0


def wave(time):
    return np.sin(2 * np.pi * 2 * time)


def even(seconds=10.0):
    return np.arange(round(seconds * RATE)) / RATE


def write(folder, time, keys="", **columns):
    """A record of displacement ``wave`` and force of five times that at the stamps, with its map."""
    columns = {"t": time, "x": wave(time), "F": 5 * wave(time)} | columns
    rows = (",".join(map(repr, row)) for row in zip(*(c.tolist() for c in columns.values()), strict=True))
    (folder / "run.csv").write_text("\n".join([",".join(columns), *rows]))
    (folder / "map.toml").write_text(MAP.format(keys=keys))
    return folder / "map.toml"


def imported(*arguments, **columns):
    return import_files([], write(*arguments, **columns)).measurements


def jittering():
    return even() + np.random.default_rng(0).uniform(-0.3, 0.3, 1000) / RATE


def repeating():
    return np.insert(even(), 300, even()[299])


def interrupted():
    return np.delete(even(), np.s_[300:500])


UNEVEN = {
    "jitter": (jittering, r"not uniform: stamp \d+, [\d.]+ s, is 0\.\d+ sampling steps of 0\.0[\d]+ s off the grid"),
    "repeated stamp": (repeating, r"does not increase after sample 299: 2\.99 s is repeated \(1x\)"),
    "gap": (interrupted, r"1 gap\(s\), the first after 2\.99 s: 2\.01 s instead of 0\.01 s"),
}


@pytest.mark.parametrize("kind", UNEVEN)
def test_the_message_names_what_is_wrong_and_its_cure_works(tmp_path, kind):
    make, message = UNEVEN[kind]
    with pytest.raises(InputError, match=message) as caught:
        imported(tmp_path, make())
    (cure,) = re.findall(r"resample = '[\d.]+ Hz'", str(caught.value))
    assert float(cure.split("'")[1].split()[0]) == pytest.approx(RATE, rel=0.02)
    for test in imported(tmp_path, make(), cure.replace("'", '"')):
        # of 50 samples per period, at steps of up to 1.6 usual ones
        begin = float(re.search(r"the record from ([\d.]+)", test.history + "the record from 0")[1])
        begin = begin or make()[0]
        np.testing.assert_allclose(test.channel("displacement"), wave(test.time + begin), atol=1e-3)


def test_rounded_stamps_are_taken_as_they_are(tmp_path):
    (test,) = imported(tmp_path, np.round(np.arange(1000) / 30, 3))
    assert test.history == ""
    np.testing.assert_array_equal(test.channel("force"), 5 * wave(np.round(np.arange(1000) / 30, 3)))


def test_every_stretch_becomes_a_test_and_short_ones_are_named(tmp_path, capsys):
    time = np.concatenate([even(3.0), even(0.05) + 5.0, even(2.0) + 8.0])
    map_path = write(tmp_path, time, 'resample = "100 Hz"\nstart_time = "60 s"\ntransient = "1 s"')
    assert main(["import", str(tmp_path), "--map", str(map_path), "--out", str(tmp_path / "a.nc")]) == 0
    said = capsys.readouterr().out
    assert "cut from a record with 2 gap(s)" in said
    assert "the record from 8 to 9.99 s; dropped as too short: 5 to 5.04 s" in said
    assert not any(issue.severity == "error" for issue in check_campaign(tmp_path / "a.nc"))
    first, second = read_campaign(tmp_path / "a.nc").measurements
    assert (first.name, second.name) == ("run_1", "run_2")
    assert [len(test.time) for test in (first, second)] == [300, 200]
    assert [test.experiment.start_time for test in (first, second)] == [60.0, 68.0]
    assert [test.experiment.transient for test in (first, second)] == [1.0, 0.0]
    assert second.gaps == 2
    assert second.history.startswith("resampled to 100 Hz from 100 Hz (steps of 0.01 to ")
    np.testing.assert_allclose(second.channel("force"), 5 * wave(8 + second.time), atol=1e-9)


def test_the_longest_stretch_alone_keeps_the_name(tmp_path):
    (test,) = imported(tmp_path, interrupted(), 'resample = "100 Hz"\ngaps = "longest"')
    assert (test.name, len(test.time), test.gaps) == ("run", 500, 1)
    assert "dropped as not the longest: 0 to 2.99 s" in test.history
    with pytest.raises(InputError, match=r"1 gap\(s\), the first after 2.99 s"):
        imported(tmp_path, interrupted(), 'resample = "100 Hz"\ngaps = "refuse"')


def test_a_stretch_shorter_than_the_period_is_dropped(tmp_path):
    time = np.concatenate([even(6.0), even(3.0) + 10.0])
    keys = 'resample = "100 Hz"\nfrequency = "0.2 Hz"'
    map_path = write(tmp_path, time, keys, x=np.sin(0.4 * np.pi * time))
    map_path.write_text(map_path.read_text().replace('"free"', '"sine"'))
    (test,) = import_files([], map_path).measurements
    assert "dropped as too short: 10 to 12.99 s" in test.history


def test_a_longest_gap_of_the_map_decides(tmp_path):
    keys = 'resample = "100 Hz"\nmax_gap = "3 s"'
    assert [len(test.time) for test in imported(tmp_path, interrupted(), keys)] == [1000]
    assert len(imported(tmp_path, interrupted(), keys.replace("3 s", "1 s"))) == 2
    with pytest.raises(InputError, match="'max_gap' needs 'resample'"):
        imported(tmp_path, interrupted(), 'max_gap = "3 s"')


def test_a_logger_that_slows_down_leaves_no_gap(tmp_path):
    slow = 10 + 0.5 * np.arange(20)
    (test,) = imported(tmp_path, np.concatenate([even(), slow]), 'resample = "50 Hz"\ninterpolation = "linear"')
    assert test.gaps == 0
    assert test.time[-1] == pytest.approx(slow[-1])


def test_of_repeated_stamps_the_last_is_kept(tmp_path):
    time = repeating()
    switched = (np.arange(len(time)) >= 300).astype(float)  # a step that the logger noted twice, before and after
    (test,) = imported(tmp_path, time, 'resample = "100 Hz"\ninterpolation = "linear"', x=switched)
    np.testing.assert_array_equal(test.channel("displacement"), (np.arange(1000) >= 299).astype(float))
    assert "1 repeated stamps dropped (the last is kept), the first at 2.99 s" in test.history


def test_samples_that_are_no_numbers_are_left_out_and_counted(tmp_path):
    time = even()
    force = 5 * wave(time)
    force[[100, 500]] = np.nan
    force[600:650] = np.nan
    before, behind = imported(tmp_path, time, 'resample = "100 Hz"', F=force)
    assert "52 samples of force left out that are no numbers" in before.history
    np.testing.assert_allclose(before.channel("force"), 5 * wave(before.time), atol=1e-3)
    assert (len(before.time), len(behind.time)) == (600, 350)


RATES = """
title = "A damper"
[[tests]]
name = "run"
file = "run.csv"
procedure = "free"
{resample}
time = {{ column = "t", unit = "s" }}
channels.displacement = {{ column = "x", unit = "m" }}
channels.force = {{ column = "F", unit = "N", {own} }}
conditions.temperature = {{ column = "T", unit = "K", time = {{ column = "t", unit = "s" }} }}
"""


@pytest.mark.parametrize("own", ['time = { column = "t2", unit = "ms" }', 'sample_rate = "400 Hz"'])
def test_channels_of_several_rates_meet_on_one_grid(tmp_path, own):
    time, other = even(), np.arange(4000) / 400
    columns = {"t": time, "x": wave(time), "T": 300 + time, "t2": 1000 * other, "F": 5 * wave(other)}
    cells = [[repr(float(c[k])) if k < len(c) else "" for c in columns.values()] for k in range(4000)]
    (tmp_path / "run.csv").write_text("\n".join([",".join(columns), *map(",".join, cells)]))
    (tmp_path / "map.toml").write_text(RATES.format(resample='resample = "50 Hz"', own=own))
    (test,) = import_files([], tmp_path / "map.toml").measurements
    inner = slice(30, -30)
    np.testing.assert_allclose(test.channel("displacement")[inner], wave(test.time)[inner], atol=4e-4)
    np.testing.assert_allclose(test.channel("force")[inner], 5 * wave(test.time)[inner], atol=2e-3)
    assert test.experiment.conditions["temperature"] == pytest.approx(300 + test.time.mean(), rel=1e-6)
    assert "400 Hz (steps of 0.0025 to 0.0025 s) of force" in test.history
    assert "zero-phase FIR low-pass where the rate fell (pass band to 20 Hz, stop band from 25 Hz" in test.history
    (tmp_path / "map.toml").write_text(RATES.format(resample="", own=own))
    with pytest.raises(InputError, match=r"channel '\w+': has a time of its own\. Add resample = "):
        import_files([], tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("time", "keys", "message"),
    [
        (np.where(even() > 5, even() - 1, even()), '"100 Hz"', r"'displacement': its time goes back after sample 500"),
        (even(), '"0 Hz"', r"resample: 0 Hz is no rate"),
        (even(), '"100 GHz"', r"resample: 1e\+11 Hz takes 9.99e\+11 samples of one channel\. Give a rate"),
        (
            even(),
            '"1e-9 Hz"',
            r"the longest stretch without gaps has 1 samples at 1e-09 Hz, 9.99 s\. It takes at least 8",
        ),
        (even(), '"100 mm"', r"resample: '100 mm': unit 'mm' does not fit 'Hz'"),
        (np.ones(1000), '"100 Hz"', r"fewer than two samples at different times"),
        (
            even(0.05),
            '"100 Hz"',
            r"the longest stretch without gaps has 5 samples at 100 Hz, 0.04 s\. It takes at least 8: ",
        ),
    ],
)
def test_what_cannot_be_resampled_says_why(tmp_path, time, keys, message):
    with pytest.raises(InputError, match=message):
        imported(tmp_path, time, f"resample = {keys}")


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lengths=st.lists(st.integers(1, 60), min_size=1, max_size=6), pause=st.integers(6, 50))
def test_no_stretch_is_lost_and_none_is_invented(tmp_path, lengths, pause):
    """Stretches of known lengths: those of at least 8 samples are the tests, the others are named."""
    starts = np.cumsum([0, *(length + pause for length in lengths[:-1])])
    time = np.concatenate([start + np.arange(length) for start, length in zip(starts, lengths, strict=True)]) / RATE
    long = [length for length in lengths if length >= 8]
    if not long or np.median(np.diff(time)) > 1.5 / RATE:
        return
    tests = imported(tmp_path, time, f'resample = "100 Hz"\nmax_gap = "{(pause - 1) / RATE} s"')
    assert [len(test.time) for test in tests] == long
    assert tests[0].gaps == len(lengths) - 1
    named = re.search("dropped as too short: (.*)", tests[0].history)
    assert (len(named[1].split(",")) if named else 0) == len(lengths) - len(long)
