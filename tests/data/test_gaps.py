"""A record with gaps is refused, or its longest whole stretch is taken; the summary counts them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from published_schemas import violations

from mofit.cli import main
from mofit.data import import_files, overview, read_campaign
from mofit.data.validation import longest_stretch
from mofit.errors import InputError

MAP = """
title = "A damper"
[[tests]]
name = "run"
file = "run.csv"
procedure = "free"
start_time = "10 s"
transient = "2 s"
{gaps}
time = {{ column = "t", unit = "s" }}
channels.displacement = {{ column = "x", unit = "mm" }}
channels.force = {{ column = "F", unit = "N" }}
conditions.temperature = {{ column = "T", unit = "degC" }}
"""
TIME = np.arange(1000) / 100


def record(tmp_path, damage, gaps='gaps = "longest"'):
    """A record of 10 s, damaged, as CSV with its map."""
    table = np.column_stack([TIME, np.sin(TIME), np.cos(TIME), 20 + 0.1 * TIME])
    table = damage(table)
    rows = ["t,x,F,T", *(",".join("nan" if np.isnan(v) else repr(float(v)) for v in row) for row in table)]
    (tmp_path / "run.csv").write_text("\n".join(rows))
    (tmp_path / "map.toml").write_text(MAP.format(gaps=gaps))
    return tmp_path / "map.toml"


def missing_stamps(table):
    return np.delete(table, np.s_[300:340], axis=0)


def no_numbers(table):
    table[300:340, 2] = np.nan
    return table


def three_gaps(table):
    table[:3, 1], table[300:340, 2] = np.nan, np.nan
    return np.delete(table, np.s_[900:905], axis=0)


@pytest.mark.parametrize(
    ("damage", "gaps", "samples", "begin"),
    [(missing_stamps, 1, 660, 3.4), (no_numbers, 1, 660, 3.4), (three_gaps, 3, 560, 3.4), (lambda t: t, 0, 1000, 0.0)],
)
def test_the_longest_whole_stretch_is_taken_and_the_gaps_are_counted(tmp_path, damage, gaps, samples, begin):
    test = import_files([tmp_path], record(tmp_path, damage)).measurements[0]
    row = overview(test)
    assert (row["gaps"], row["samples"]) == (gaps, samples)
    expected = TIME[round(100 * begin) :][:samples]
    np.testing.assert_allclose(test.channel("force"), np.cos(expected))
    np.testing.assert_allclose(test.time, expected - begin, atol=1e-12)
    assert test.experiment.start_time == pytest.approx(10 + begin)
    assert test.experiment.transient == pytest.approx(max(2 - begin, 0))
    assert test.experiment.conditions["temperature"] == pytest.approx(293.15 + 0.1 * expected.mean())


@pytest.mark.parametrize(
    ("damage", "what"), [(missing_stamps, r"1 gap\(s\), the first after 2.99 s"), (no_numbers, "40 of 1000 samples")]
)
def test_gaps_are_refused_unless_the_map_says_otherwise(tmp_path, damage, what):
    with pytest.raises(InputError, match=what):
        import_files([tmp_path], record(tmp_path, damage, gaps=""))


def test_the_command_reports_how_many_and_the_file_keeps_the_number(tmp_path, capsys):
    command = ["import", str(tmp_path), "--map", str(record(tmp_path, three_gaps)), "--out", str(tmp_path / "a.nc")]
    assert main([*command, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert not violations(said)
    assert said["tests"][0]["gaps"] == 3
    assert read_campaign(tmp_path / "a.nc").measurements[0].gaps == 3
    (tmp_path / "a.nc").unlink()
    assert main(command) == 0
    assert "cut from a record with 3 gap(s)" in capsys.readouterr().out


def test_a_record_that_is_nothing_but_gaps_is_refused(tmp_path):
    def nothing(table):
        table[:, 1] = np.nan
        return table

    with pytest.raises(InputError, match="0 samples"):
        import_files([tmp_path], record(tmp_path, nothing))


@given(st.data())
def test_the_stretch_is_whole_and_none_is_longer(data):
    """Against a walk through the record, sample by sample."""
    n = data.draw(st.integers(1, 40))
    steps = data.draw(st.lists(st.sampled_from([1.0] * 9 + [3.0]), min_size=n, max_size=n))
    good = np.array(data.draw(st.lists(st.sampled_from([True] * 5 + [False]), min_size=n, max_size=n)))
    time, signal = np.cumsum(steps), np.where(good, 0.0, np.nan)
    kept, gaps = longest_stretch(time, [signal])
    usual = np.median(np.diff(time)[good[1:] & good[:-1]]) if (good[1:] & good[:-1]).any() else np.inf
    longest, length, counted = 0, 0, 0
    for k in range(n):
        apart = k > 0 and good[k - 1] and steps[k] > 1.5 * usual
        counted += int(good[k] and apart) + int(not good[k] and (k == 0 or good[k - 1]))
        length = 0 if not good[k] else 1 if apart else length + 1
        longest = max(longest, length)
    assert kept.stop - kept.start == longest
    assert np.isfinite(signal[kept]).all()
    assert gaps == counted
