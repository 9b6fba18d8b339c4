"""Names and titles: what is written can be read again, and what cannot is refused with check's message."""

from dataclasses import replace

import netCDF4
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mofit.data import Campaign, Experiment, Measurement, check_campaign, import_files, read_campaign, write_campaign
from mofit.data.names import channel_name_issues, name_issues, title_issues
from mofit.errors import InputError

TIME = np.arange(400) / 100
WAVE = np.sin(2 * np.pi * TIME)
#: what people, other programs and rigs write
HOSTILE = ["", "a/b", "..", "a" * 300, "a\x00b", "a\nb", "a ", " a", "\ud800", ".a", "-a", "<b>x</b>", "µ" * 120]
FINE = ["a<i>", "a:b", "a\\b", "ü µ", "a" * 200, "7", "_", "a..b", "a'", 'a"', "x$x$", "x{0}"]


def one_test(test="one", channel="force", condition="mass"):
    experiment = Experiment(test, "sine", TIME, {"displacement": 0.01 * WAVE}, {condition: 1.0}, frequency=1.0)
    return Measurement(experiment, {channel: 100 * WAVE}, {"displacement": "m", channel: "N"})


def named(title="t", attributes=None, **names):
    return Campaign(title, "simulated", {}, (one_test(**names),), attributes or {})


@pytest.mark.parametrize("place", ["test", "channel", "condition"])
@pytest.mark.parametrize("name", HOSTILE)
def test_a_campaign_takes_no_name_that_no_file_can_hold(place, name):
    with pytest.raises(InputError, match=f"{place} name '") as caught:
        named(**{place: name})
    text = str(caught.value)
    assert all(sign.isprintable() for sign in text), text
    assert len(text) < 300


@pytest.mark.parametrize("title", ["a\x00b", "a\nb", "\ud800", "a" * 300])
def test_a_campaign_takes_no_title_that_no_page_can_head(title):
    with pytest.raises(InputError, match="the title h"):
        named(title)


@pytest.mark.parametrize("name", ["time", "force"])
def test_a_condition_with_the_name_of_something_else(name):
    with pytest.raises(InputError, match=f"'{name}'"):
        named(condition=name)


def test_an_attribute_that_no_file_can_hold(tmp_path):
    with pytest.raises(InputError, match="attribute name 'a/b'"):
        named(attributes={"a/b": "text"})
    with pytest.raises(InputError, match="half a character"):
        write_campaign(named(attributes={"note": "\ud800"}), tmp_path / "c.nc")


@given(st.text(max_size=12), st.text(max_size=12), st.sampled_from(FINE))
@example("a/b", "..", "7")
def test_what_is_written_is_read_again(tmp_path_factory, title, test, condition):
    assert not name_issues("", "condition", FINE)
    path = tmp_path_factory.mktemp("names") / "c.nc"
    wrong = title_issues("", title) + name_issues("", "test", [test]) + channel_name_issues("", [], [condition])
    if wrong:
        with pytest.raises(InputError):
            named(title, test=test, condition=condition)
        return
    write_campaign(named(title, test=test, condition=condition), path)
    assert not [issue for issue in check_campaign(path) if issue.severity == "error"]
    read = read_campaign(path)
    assert read.tests == (test,)
    assert read[test].experiment.conditions == {condition: 1.0}
    assert read.title == title


def test_check_gives_the_message_of_the_campaign(tmp_path):
    write_campaign(named("t"), tmp_path / "c.nc")
    long = "a" * 220
    with netCDF4.Dataset(tmp_path / "c.nc", "a") as file:
        file.renameGroup("one", long)
        file.title = "a\nb"
    with pytest.raises(InputError) as caught:
        named("a\nb", test=long)
    assert set(map(str, caught.value.issues)) == set(map(str, check_campaign(tmp_path / "c.nc")))


SPOILT = {
    "NaN": (lambda v: np.where(TIME >= 3, np.nan, v), "100 of 400 samples are NaN"),
    "constant": (lambda v: 0 * v + 2, r"the output is constant \(2\)"),
    "short": (lambda v: v[:300], "300 samples, but 400 time stamps"),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_data_that_check_refuses_are_refused_on_writing(tmp_path, kind):
    spoil, message = SPOILT[kind]
    good = one_test()
    bad = replace(good, outputs={"force": spoil(good.channel("force"))})
    with pytest.raises(InputError, match=message):
        write_campaign(Campaign("t", "measured", {}, (bad,)), tmp_path / "c.nc")
    with pytest.raises(InputError, match="attribute 'units': missing"):
        write_campaign(Campaign("t", "measured", {}, (replace(good, units={}),)), tmp_path / "c.nc")


def test_an_import_names_them_with_all_else(tmp_path):
    np.savetxt(tmp_path / "run.csv", np.column_stack([TIME, WAVE, WAVE]), delimiter=",", header="t,x,F", comments="")
    (tmp_path / "map.toml").write_text(
        """
title = "a\\nb"
[[tests]]
name = "a/b"
file = "run.csv"
procedure = "free"
time = { column = "t", unit = "s" }
channels.displacement = { column = "x", unit = "mm" }
channels.force = { column = "F", unit = "bar" }
"""
    )
    with pytest.raises(InputError) as caught:
        import_files([], tmp_path / "map.toml")
    text = str(caught.value)
    assert "the title holds the control character" in text
    assert "the test name 'a/b' holds '/'" in text
    assert "bar" in text


def test_a_plan_names_them_before_it_simulates(tmp_path):
    from mofit.simulation.virtual_rig.rig import simulate

    (tmp_path / "plan.toml").write_text(
        """
title = "t"
model = "kelvin_voigt_damper"
seed = 1
[[tests]]
name = ".."
kind = "sine"
sample_rate = 100.0
amplitude = "1 mm"
frequency = 1.0
periods = 3
"""
    )
    with pytest.raises(InputError, match=r"test '\.\.': the test name '\.\.' begins with"):
        simulate(tmp_path / "plan.toml")
