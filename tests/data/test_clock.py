"""A column of date and time is the time in seconds, whatever stands around it."""

from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mofit.data import import_files, propose_map
from mofit.data.importers.clock import clock_seconds
from mofit.data.importers.table import read_table
from mofit.errors import InputError

START = datetime(2021, 3, 4, 10, 11, 12)
STAMPS = [START + timedelta(milliseconds=250 * k) for k in range(40)]
SECONDS = 0.25 * np.arange(40)
#: how loggers write a stamp
WRITERS = {
    "blank": lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f"),
    "T": lambda t: t.isoformat(timespec="milliseconds"),
    "Z": lambda t: f"{t.isoformat(timespec='milliseconds')}Z",
    "offset": lambda t: t.replace(tzinfo=timezone(timedelta(hours=2))).isoformat(),
    "short offset": lambda t: f"{t.isoformat(sep=' ', timespec='microseconds')}+0530",
    "no fraction at whole seconds": lambda t: t.isoformat(sep=" "),
}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("dialect", [(",", "."), (";", "."), (";", ","), ("\t", "."), ("  ", "."), (" ", ",")])
def test_a_clock_is_the_time_in_every_dialect(tmp_path, writer, dialect):
    delimiter, decimal = dialect
    values = np.sin(SECONDS)
    rows = [
        delimiter.join([WRITERS[writer](stamp), f"{k}", f"{value!r}".replace(".", decimal)])
        for k, (stamp, value) in enumerate(zip(STAMPS, values.tolist(), strict=True))
    ]
    (tmp_path / "a.csv").write_text("\n".join([delimiter.join(["stamp", "k", "F"]), *rows]))
    table = read_table(tmp_path / "a.csv")
    assert list(table.columns) == ["stamp", "k", "F"]
    np.testing.assert_allclose(table.column("stamp"), SECONDS, atol=1e-12)
    np.testing.assert_array_equal(table.column("F"), values)
    assert table.units == {"stamp": "s"}


def test_a_decimal_comma_within_the_clock(tmp_path):
    rows = [f"{stamp:%Y-%m-%d %H:%M:%S},{stamp.microsecond // 1000:03d};{k},5" for k, stamp in enumerate(STAMPS)]
    (tmp_path / "a.csv").write_text("\n".join(["t;F", *rows]))
    table = read_table(tmp_path / "a.csv")
    np.testing.assert_allclose(table.column("t"), SECONDS, atol=1e-12)
    np.testing.assert_array_equal(table.column("F"), 0.5 + np.arange(40))


def test_a_clock_imports_and_is_proposed_without_a_unit(tmp_path):
    wave = np.sin(SECONDS)
    rows = [f"{stamp.isoformat()};{10 * w!r};{w!r}" for stamp, w in zip(STAMPS, wave.tolist(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["Timestamp;stroke [mm];load [kN]", *rows]))
    (tmp_path / "map.toml").write_text(propose_map([tmp_path / "a.csv"]))
    (test,) = import_files([], tmp_path / "map.toml").measurements
    np.testing.assert_allclose(test.time, SECONDS, atol=1e-12)
    np.testing.assert_allclose(test.channel("force"), 1000 * wave)


def test_summer_time_ends_in_the_stamps_but_not_in_the_seconds():
    before, after = "2021-10-31T02:59:59+02:00", "2021-10-31T02:00:00+01:00"
    assert clock_seconds([before, after]).tolist() == [0.0, 1.0]


def test_what_is_no_clock_stays_text_or_nan():
    assert clock_seconds(["2021-03-04", "2021-03-05"]) is None
    assert clock_seconds(["9999-99-99 99:99:99"]) is None
    assert clock_seconds([1.0, 2.0]) is None
    assert clock_seconds([]) is None
    stamps = ["", "2021-03-04 10:11:12", "lost", None, "2021-03-04 10:11:13"]
    np.testing.assert_array_equal(clock_seconds(stamps), [np.nan, 0, np.nan, np.nan, 1])


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    start=st.datetimes(datetime(1971, 1, 1), datetime(2190, 1, 1)),
    steps=st.lists(st.integers(1, 10**9), min_size=1, max_size=20),
    writer=st.sampled_from(sorted(set(WRITERS) - {"T", "Z"})),
)
def test_no_digit_of_a_microsecond_is_lost(start, steps, writer):
    offsets = np.concatenate([[0], np.cumsum(steps)])
    cells = [WRITERS[writer](start + timedelta(microseconds=int(offset))) for offset in offsets]
    np.testing.assert_allclose(clock_seconds(cells), offsets / 1e6, rtol=1e-15)


def test_a_clock_of_whole_seconds_is_too_coarse_for_four_samples_a_second(tmp_path):
    rows = [f"{stamp:%Y-%m-%d %H:%M:%S};{k}.5;{k}.25" for k, stamp in enumerate(STAMPS)]
    (tmp_path / "a.csv").write_text("\n".join(["time;stroke [mm];load [kN]", *rows]))
    (tmp_path / "map.toml").write_text(propose_map([tmp_path / "a.csv"]))
    with pytest.raises(InputError, match=r"0 s is repeated \(30x\)\. It is too coarse .*: give the sample_rate"):
        import_files([], tmp_path / "map.toml")
