"""Design spaces: every combination once, all issues together, and the limits of a rig."""

from pathlib import Path

import numpy as np
import pytest

from mofit.data import Experiment
from mofit.errors import InputError
from mofit.experimental_design.candidate_space import default_space, read_space
from mofit.experimental_design.candidates import Limits, RigLimits, declared_limits, required_limits, violation
from mofit.models import Channel, find_model

GOOD = """
overhead = "30 s"

[limits]
amplitude = "3 deg"
rate = "60 deg/s"

[limits.outputs]
lateral_force = "5 kN"

[defaults]
sample_rate = "100 Hz"
amplitude = ["1 deg", "2 deg"]

[[tests]]
kind = "sine"
frequency = { from = "0.1 Hz", to = "10 Hz", count = 3 }
duration = ["20 s", "40 s"]
conditions = { longitudinal_velocity = ["30 km/h", "60 km/h"] }

[[tests]]
kind = "multisine"
frequency = "0.1 Hz"
lines = [[1, 3], [1, 2]]
periods = 3
"""


def space_of(tmp_path, text):
    path = tmp_path / "space.toml"
    path.write_text(text)
    return read_space(path)


def test_every_combination_is_a_test_of_its_own(tmp_path):
    plans = space_of(tmp_path, GOOD).plans()
    assert len(plans) == 2 * 3 * 2 * 2 + 2 * 2
    assert len({plan.name for plan in plans}) == len(plans)
    first = plans[0]
    assert (first.name, first.frequency, first.conditions) == (
        "sine_0_1Hz_1deg_20s_30kmh",
        "0.1 Hz",
        {"longitudinal_velocity": "30 km/h"},
    )
    assert {plan.frequency for plan in plans if plan.kind == "sine"} == {"0.1 Hz", "1 Hz", "10 Hz"}
    assert {plan.lines for plan in plans if plan.kind == "multisine"} == {(1, 3), (1, 2)}


def test_tests_that_differ_only_in_sampling_are_kept_apart(tmp_path):
    text = '[[tests]]\nkind = "sine"\nfrequency = 1.0\namplitude = 0.1\nduration = 5.0\nsample_rate = [50.0, 100.0]\n'
    plans = space_of(tmp_path, text).plans()
    assert {plan.sample_rate for plan in plans} == {50.0, 100.0}
    assert len({plan.name for plan in plans}) == 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('overhead = "30 s"', 'overhed = "30 s"', "Did you mean 'overhead'"),
        ("periods = 3", "perods = 3", "Did you mean 'periods'"),
        ('to = "10 Hz"', 'to = "10 rad"', "'from' is in 'Hz', 'to' in 'rad'"),
        ('from = "0.1 Hz"', 'from = "0 Hz"', "above 0"),
        ("count = 3", "cont = 3", "count"),
        ('kind = "sine"', 'kind = "sin"', "Did you mean 'sine'"),
        ('duration = ["20 s", "40 s"]', "", "either 'periods' or 'duration'"),
        ("count = 3", "count = 200", None),
        ('"30 km/h", "60 km/h"', ", ".join(f'"{k} km/h"' for k in range(10, 60)), "10000|combinations"),
    ],
)
def test_issues_are_named(tmp_path, old, new, message):
    assert old in GOOD
    text = GOOD.replace(old, new)
    if message is None:
        assert len(space_of(tmp_path, text).plans()) == 2 * 200 * 2 * 2 + 4
        return
    if "combinations" in message:
        text = text.replace("count = 3", "count = 50")
    with pytest.raises(InputError, match=message):
        space_of(tmp_path, text)


def test_limits_come_in_si_units_and_name_what_they_do_not_know():
    model = find_model("maxwell_tyre")
    limits = declared_limits(Limits(amplitude="90 deg", outputs={"lateral_force": "5 kN"}), model)
    assert limits.amplitude == pytest.approx(np.pi / 2)
    assert limits.outputs == {"lateral_force": pytest.approx(5000)}
    assert limits.rate == np.inf
    with pytest.raises(InputError) as caught:
        declared_limits(Limits(amplitude="3 kg", rate="-1 deg/s", outputs={"force": 1.0}), model)
    assert len(caught.value.issues) == 3


def sine(amplitude, frequency):
    time = np.arange(0, 10, 0.01)
    values = amplitude * np.sin(2 * np.pi * frequency * time)
    return Experiment("sine", "sine", time, {"displacement": values}, frequency=frequency)


def test_what_a_sine_requires_is_what_calculus_says():
    required = required_limits(sine(0.02, 1.5), "displacement")
    omega = 2 * np.pi * 1.5
    assert required.amplitude == pytest.approx(0.02, rel=1e-3)
    assert required.rate == pytest.approx(0.02 * omega, rel=1e-3)
    assert required.acceleration == pytest.approx(0.02 * omega**2, rel=2e-3)
    assert required.duration == pytest.approx(10.0)
    noisy = sine(0.02, 1.5)
    rough = noisy.inputs["displacement"] + 2e-5 * np.random.default_rng(0).normal(size=1000)
    measured = required_limits(
        Experiment("sine", "sine", noisy.time, {"displacement": rough}), "displacement", measured=True
    )
    assert measured.rate == pytest.approx(0.02 * omega, rel=0.05)
    assert measured.acceleration == pytest.approx(0.02 * omega**2, rel=0.1)


def test_the_violated_limit_is_named():
    required = required_limits(sine(0.02, 1.5), "displacement")
    own = {"channel": "displacement"}
    assert violation(required, RigLimits(**own), "m") == ""
    assert violation(required, RigLimits(**own, amplitude=0.02), "m") == ""
    assert violation(required, RigLimits(**own, amplitude=0.01), "m").startswith("amplitude: 0.02 m, limit 0.01")
    assert violation(required, RigLimits(**own, rate=0.1), "m").startswith("rate")
    assert violation(required, RigLimits(**own, acceleration=0.1), "m").startswith("acceleration")
    assert violation(required, RigLimits(**own, duration=5.0), "m").startswith("duration")
    # a calibration stage has an input of its own
    assert violation(required, RigLimits(channel="slip_angle", amplitude=0.01), "m") == ""


def test_the_default_space_stays_within_demonstrated_limits():
    known = [sine(0.02, f) for f in (0.5, 1.5)]
    kinds = ("sine", "multisine", "chirp", "step")
    space = default_space(known, Channel("displacement", "m"), kinds, budget=100.0, overhead=10.0)
    plans = space.plans()
    assert len(plans) >= 200
    assert {plan.kind for plan in plans} == {"sine", "multisine", "chirp", "step"}
    assert {plan.amplitude for plan in plans} == {"5 mm", "10 mm", "20 mm"}
    assert max(float(str(plan.duration).split()[0]) for plan in plans) == pytest.approx(90.0)
    assert space.limits.rate == "188.5 mm/s"


def test_the_space_in_the_docs_is_one(tmp_path):
    text = (Path(__file__).resolve().parents[2] / "docs" / "design.md").read_text(encoding="utf-8")
    space = space_of(tmp_path, text.split("```toml\n")[1].split("```")[0])
    assert len(space.plans()) == 12 * 3 * 2 * 2 + 2
    assert np.isfinite(declared_limits(space.limits, find_model("maxwell_tyre")).acceleration)
