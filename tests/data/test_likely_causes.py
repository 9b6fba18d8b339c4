"""check names the likely cause of data that are wrong as a whole, and is silent about sound ones."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mofit.data import (
    Campaign,
    Experiment,
    Measurement,
    campaign_warnings,
    check_campaign,
    import_files,
    write_campaign,
)
from mofit.data.other_units import USUAL_UNITS
from mofit.errors import InputError
from mofit.units import to_si

UNITS = {"displacement": "m", "force": "N"}
FREQUENCIES = (1.0, 1.5, 2.0, 3.0, 5.0)
CAUSES = ("sign", "late", "early", "as if", "copy", "aliasing", "unit")


def stiffness(frequency, spring=800.0, damping=60.0, mass=0.0, branch=0.0):
    """Dynamic stiffness of a spring, a damper, a mass and a Maxwell branch of corner 1 Hz, all side by side."""
    s = 2j * np.pi * frequency
    return spring + s * damping + s**2 * mass + branch * s / (s + 2 * np.pi)


def sine(name, true_frequency, ratio, *, amplitude=0.01, rate=120.0, samples=720, late=0.0, seed=0, **about):
    """A sine test whose output is ``ratio`` times the input, late by so many seconds."""
    time, omega = np.arange(samples) / rate, 2 * np.pi * true_frequency
    ratio = ratio * np.exp(-1j * omega * late)
    force = amplitude * np.imag(ratio * np.exp(1j * omega * time))
    force = force + 0.003 * np.ptp(force) * np.random.default_rng(seed).normal(size=samples)
    about = {"frequency": true_frequency, "amplitude": amplitude} | about
    scale = about.pop("time_scale", 1.0)
    wave = amplitude * np.sin(omega * time)
    return Measurement(Experiment(name, "sine", scale * time, {"displacement": wave}, **about), {"force": force}, UNITS)


def sweep(signs=(1, 1, 1, 1, 1), late=0.0, **parts):
    tests = zip(FREQUENCIES, signs, strict=True)
    return [sine(f"s{f:g}", f, sign * stiffness(f, **parts), late=late, seed=k) for k, (f, sign) in enumerate(tests)]


def found(*tests):
    """The warnings of a campaign, as text."""
    return [str(issue) for issue in campaign_warnings(Campaign("t", "measured", {}, tests))]


def only(warnings, *words):
    """The one warning that holds all the words."""
    (one,) = [text for text in warnings if all(word in text for word in words)]
    return one


@settings(max_examples=8, deadline=None)
@given(
    st.floats(1, 1e6),
    st.floats(0.003, 3),
    st.floats(0, 0.3),
    st.floats(0, 3),
    st.floats(1e-6, 1e3),
    st.floats(1e-3, 0.3),
)
def test_a_passive_specimen_of_any_size_is_sound(spring, damping, mass, branch, scale, amplitude):
    parts = {"spring": spring, "damping": damping * spring / 6, "branch": branch * spring, "mass": mass * spring / 400}
    tests = [sine(f"s{f:g}", f, scale * stiffness(f, **parts), amplitude=amplitude, seed=int(f)) for f in FREQUENCIES]
    assert found(*tests) == []


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 4), st.floats(0.05, 2), st.floats(0, 2))
def test_one_test_of_the_other_sign_is_found(wrong, damping, branch):
    signs = [-1 if k == wrong else 1 for k in range(5)]
    warnings = found(*sweep(signs, damping=damping * 100, branch=branch * 800))
    assert f"group 's{FREQUENCIES[wrong]:g}', variable 'force'" in only(warnings, "opposite sign")
    assert len(warnings) == 1


def test_a_campaign_of_the_other_sign_is_found():
    text = only(found(*sweep([-1] * 5)), "opposite sign")
    assert text.startswith("groups 's1', 's1.5', 's2', 's3', 's5'")
    assert "scale = -1" in text


def test_a_sign_that_changes_where_physics_is_unknown():
    def volts(test):
        channels = {"u": test.channel("displacement")}
        about = replace(test.experiment, inputs=channels, amplitude=None)
        return Measurement(about, {"y": test.channel("force")}, {"u": "V", "y": "V"})

    assert found(*map(volts, sweep())) == []
    assert found(*map(volts, sweep([-1] * 5))) == []
    text = only(found(*map(volts, sweep([1, 1, -1, 1, 1]))), "opposite sign")
    assert text.startswith("group 's2', variable 'y'")


@pytest.mark.parametrize("kind", ["step", "free"])
def test_a_sign_that_changes_in_records_that_do_not_repeat(kind):
    time = np.arange(1000) / 100
    rng = np.random.default_rng(0)

    def record(name, sign):
        shape = (time > 2) * 1.0 if kind == "step" else np.cumsum(rng.normal(size=1000))
        inputs = {"displacement": 0.01 * shape / np.ptp(shape)}
        force = sign * 8e4 * inputs["displacement"] + rng.normal(size=1000)
        return Measurement(Experiment(name, kind, time, inputs), {"force": force}, UNITS)

    assert not [text for text in found(record("a", 1), record("b", 1), record("c", 1)) if "sign" in text]
    text = only(found(record("a", 1), record("b", -1), record("c", 1)), "as if")
    assert text.startswith("group 'b', variable 'force'")


@settings(max_examples=6, deadline=None)
@given(st.floats(0.05, 0.09), st.sampled_from([1, -1]), st.floats(0.05, 0.6))
def test_a_delay_between_the_channels_is_found(delay, direction, damping):
    text = only(found(*sweep(late=direction * delay, damping=damping * 100)), "comes")
    milliseconds = float(text.split("comes ")[1].split(" ms")[0])
    assert milliseconds == pytest.approx(1e3 * delay, rel=0.3)
    assert ("late" in text) == (direction > 0)


def test_a_delay_of_a_single_test_is_found_where_the_loop_runs_backward():
    text = only(found(sine("one", 5.0, stiffness(5.0, damping=5.0), late=0.05)), "passive")
    assert "at least" in text


LABELS = {
    "another file": ({"true_frequency": 2.0}, {"frequency": 7.0}, "unit of the time is wrong"),
    "minutes": ({"true_frequency": 0.5}, {"time_scale": 60.0}, "per minute"),
    "milliseconds": ({"true_frequency": 1.0}, {"time_scale": 1e3}, "time were in ms"),
    "angular": ({"true_frequency": 1.0}, {"frequency": 2 * np.pi}, "rad/s"),
    "aliasing": ({"true_frequency": 80.0, "rate": 100.0}, {}, "aliasing"),
    "a little off": ({"true_frequency": 1.0}, {"frequency": 1.02}, "Nothing to do"),
}


@pytest.mark.parametrize("case", LABELS)
def test_a_label_that_the_data_contradict(case):
    signal, about, message = LABELS[case]
    text = only(found(sine("a", ratio=900.0 + 200j, samples=4000, **signal, **about)), "attribute 'frequency'")
    assert message in text
    assert ("Nothing to do" in text) == (case == "a little off")


def test_metres_that_are_millimetres():
    text = only(found(sine("a", 1.0, stiffness(1.0), amplitude=5.0)), "millimetres")
    assert "moves by ± 5 m" in text


@pytest.mark.parametrize("wrong", range(5))
@pytest.mark.parametrize(("unit", "size"), [("kN", 1e3), ("kgf", 9.80665), ("lbf", 4.448)])
def test_a_test_in_another_unit(wrong, unit, size):
    """Also the fastest one, which differs by physics, too: a damper's force grows with the frequency."""
    for value, words in ((1 / size, f"{unit} read as N"), (size, f"N read as {unit}")):
        tests = sweep(damping=60.0)
        tests[wrong] = replace(tests[wrong], outputs={"force": value * tests[wrong].channel("force")})
        text = only(found(*tests), "another unit")
        assert f"group 's{FREQUENCIES[wrong]:g}', variable 'force'" in text
        assert words in text
        assert f"unit = '{words.split()[0]}'" in text


def test_several_tests_in_another_unit_are_told_one_by_one():
    tests = sweep()
    for k in (1, 4):
        tests[k] = replace(tests[k], outputs={"force": 1e-3 * tests[k].channel("force")})
    told = [text for text in found(*tests) if "kN read as N" in text]
    assert {text.split(",")[0] for text in told} == {"group 's1.5'", "group 's5'"}


def test_of_two_tests_either_may_be_in_another_unit():
    one, other, *_ = sweep()
    other = replace(other, outputs={"force": 1e-3 * other.channel("force")})
    assert only(found(one, other), "another unit", "kN").startswith("groups 's1' and 's1.5', variable 'force'")


@pytest.mark.parametrize(
    ("channels", "stated", "size", "words"),
    [
        (("angle", "torque"), ("rad", "N m"), (np.degrees(1.0), 1.0), "variable 'angle': .* deg read as rad"),
        (("strain", "stress"), ("1", "Pa"), (1.0, 1 / 6894.757), "variable 'stress': .* psi read as Pa"),
        (("displacement", "force"), ("m", "N"), (1e-3, 1.0), "variable 'displacement': .* m read as mm"),
    ],
)
def test_other_channels_and_inputs_in_another_unit(channels, stated, size, words):
    def renamed(test, sizes):
        inputs = {channels[0]: sizes[0] * test.channel("displacement")}
        about = replace(test.experiment, inputs=inputs, amplitude=None)
        output = {channels[1]: sizes[1] * test.channel("force")}
        return Measurement(about, output, dict(zip(channels, stated, strict=True)))

    tests = sweep(damping=60.0)
    assert found(*(renamed(test, (1.0, 1.0)) for test in tests)) == []
    one, *others = reversed(tests)
    (text,) = found(renamed(one, size), *(renamed(test, (1, 1)) for test in others))
    assert re.search(rf"group 's5', {words}", text)


def test_other_amplitudes_and_saturation_are_no_other_unit():
    """A dry friction's force does not grow with the stroke, which differs by a factor of 25; the other one's does."""
    for power in (0.0, 1.0):
        strokes = (0.002, 0.05, 0.01, 0.05, 0.002)
        ratios = [900 * (stroke / 0.01) ** (power - 1) for stroke in strokes]
        tests = [
            sine(f"s{f:g}", f, ratio * np.exp(0.2j), amplitude=stroke, seed=k)
            for k, (f, ratio, stroke) in enumerate(zip(FREQUENCIES, ratios, strokes, strict=True))
        ]
        assert found(*tests) == []


def test_the_usual_units_are_those_of_the_registry():
    for stated, units in USUAL_UNITS.items():
        for unit, size in units.items():
            assert to_si(1.0, unit, stated) == pytest.approx(size, rel=1e-9)


COPIES = {
    "exact": lambda v: v,
    "rounded": lambda v: np.round(v, 3),
    "without its begin": lambda v: v[100:],
    "without its end": lambda v: v[:-130],
}


@pytest.mark.parametrize("kind", COPIES)
def test_the_same_record_under_two_names(kind):
    one, change = sine("a", 1.0, stiffness(1.0)), COPIES[kind]
    wave, force = change(one.channel("displacement")), change(one.channel("force"))
    about = replace(one.experiment, name="b", time=one.time[: len(wave)], inputs={"displacement": wave})
    text = only(found(one, Measurement(about, {"force": force}, UNITS)), "same output")
    assert "groups 'a' and 'b'" in text
    assert not found(one, sine("c", 1.0, stiffness(1.0), seed=7))


SIZES = {
    "1e300": (lambda v: v * 1e298, "larger than any measurement"),
    "1e-300": (lambda v: v * 1e-302, "no sample is larger than"),
    "one sample": (lambda v: np.where(np.arange(len(v)) == 500, 1e300, v), "sample 500 is 1e.300"),
    "NaN block": (lambda v: np.where(np.arange(len(v)) // 100 == 3, np.nan, v), "100 of 720 samples are NaN"),
    "constant": (lambda v: 0 * v + 1e-300, "no sample is larger|constant"),
}


@pytest.mark.parametrize("kind", SIZES)
def test_sizes_that_no_unit_makes_are_refused(tmp_path, kind):
    change, message = SIZES[kind]
    test = sine("a", 1.0, stiffness(1.0))
    bad = replace(test, outputs={"force": change(test.channel("force"))})
    with pytest.raises(InputError, match=message):
        write_campaign(Campaign("t", "measured", {}, (bad,)), tmp_path / "c.nc")


@settings(max_examples=8, deadline=None)
@given(st.floats(-98, 90), st.floats(-98, 90))
def test_any_other_size_is_checked_without_a_word(input_power, output_power):
    assume(input_power + output_power < 95)
    test = sine("a", 1.0, stiffness(1.0))
    wave = 10.0**input_power * test.channel("displacement")
    force = 10.0**output_power * test.channel("force")
    about = replace(test.experiment, inputs={"u": wave}, amplitude=None)
    assert found(Measurement(about, {"y": force}, {"u": "V", "y": "V"})) == []


def test_a_cell_of_text_in_a_file_of_decimal_commas(tmp_path):
    rows = [f"{k / 100:.2f};{np.sin(k / 9):.4f};{np.cos(k / 9):.4f}".replace(".", ",") for k in range(2000)]
    rows[700] = rows[700].rsplit(";", 1)[0] + ";overflow"
    (tmp_path / "run.csv").write_text("\n".join(["t;x;F", *rows]))
    (tmp_path / "map.toml").write_text(
        """
title = "t"
[[tests]]
name = "a"
file = "run.csv"
procedure = "free"
time = { column = "t", unit = "s" }
channels.displacement = { column = "x", unit = "mm" }
channels.force = { column = "F", unit = "N" }
"""
    )
    with pytest.raises(InputError, match="1 of 2000 samples are NaN or infinite, the first at index 700"):
        import_files([], tmp_path / "map.toml")


def test_progress_names_every_test(tmp_path):
    write_campaign(Campaign("t", "measured", {}, tuple(sweep())), tmp_path / "c.nc")
    heard = []
    assert check_campaign(tmp_path / "c.nc", lambda *about: heard.append(about)) == []
    assert [note for stage, _, _, note in heard if stage == "check"] == ["s1", "s1.5", "s2", "s3", "s5"]
