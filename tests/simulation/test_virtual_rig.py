"""Plans in, campaigns out; plans that are written read back as they were."""

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.data import Campaign, Experiment, Measurement, bundled_campaign, read_campaign, write_campaign
from mofit.errors import InputError
from mofit.models import build_system, find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.plan import EffectPlan, NoisePlan, Plan, plan_text, read_plan
from mofit.simulation.virtual_rig.rig import simulate

PLANS = Path(__file__).resolve().parents[2] / "data" / "plans"

DAMPER = """
title = "damper"
model = "kelvin_voigt_damper"
seed = 1

[parameters]
c = "2 kN/m"
d = "500 N s/m"
F_0 = 4

[[tests]]
name = "slow"
kind = "sine"
sample_rate = "200 Hz"
amplitude = "10 mm"
frequency = "1 Hz"
periods = 3
"""


@pytest.fixture
def run(tmp_path):
    def run(text: str):
        path = tmp_path / "plan.toml"
        path.write_text(text, encoding="utf-8")
        return simulate(path)

    return run


def test_plan_without_noise_gives_the_model_exactly(run):
    campaign = run(DAMPER)
    (slow,) = campaign.measurements
    x = 0.01 * np.sin(2 * np.pi * slow.time)
    v = 0.01 * 2 * np.pi * np.cos(2 * np.pi * slow.time)
    assert campaign.source == "simulated"
    assert slow.experiment.inputs["displacement"] == pytest.approx(x)
    assert slow.outputs["force"] == pytest.approx(2000 * x + 500 * v + 4, abs=1e-3)
    assert (slow.experiment.frequency, slow.experiment.amplitude) == pytest.approx((1.0, 0.01))


def test_left_out_parameters_are_nominal_and_all_are_recorded(run):
    campaign = run(DAMPER)
    values = json.loads(campaign.attributes["simulated_parameters"])
    assert values == pytest.approx({"c": 2000, "d": 500, "F_0": 4, "p": 0})


def test_tests_follow_each_other_with_a_pause(run):
    second = DAMPER[DAMPER.index("[[tests]]") :].replace("slow", "again")
    campaign = run(DAMPER.replace("seed = 1", 'seed = 1\npause = "7 s"') + second)
    first, again = campaign.measurements
    assert again.experiment.start_time == pytest.approx(first.time[-1] + 7)


def test_seed_decides_the_noise_and_the_noise_is_as_planned(run):
    noisy = DAMPER.replace("[[tests]]", "[noise.force]\nfraction = 0.01\n\n[[tests]]").replace(
        "periods = 3", "periods = 300"
    )
    first, same, other = run(noisy), run(noisy), run(noisy.replace("seed = 1", "seed = 2"))
    assert first.hash() == same.hash() != other.hash()
    clean = run(noisy.replace("fraction = 0.01", "fraction = 0"))["slow"].outputs["force"]
    assert np.std(first["slow"].outputs["force"] - clean) == pytest.approx(0.01 * np.ptp(clean), rel=0.02)
    assert first["slow"].experiment.inputs["displacement"] == pytest.approx(
        0.01 * np.sin(2 * np.pi * first["slow"].time)
    )


def test_defaults_reach_the_tests_that_have_a_use_for_them(run):
    text = DAMPER.replace("[[tests]]", '[defaults]\nduration = "2 s"\nramp_rate = "1 mm/s"\nperiods = 2\n\n[[tests]]')
    assert len(run(text)["slow"].time) == 600


def test_effects_join_where_they_can(run):
    effects = '[[effects]]\nname = "force_offset"\nparameters = { F_off = "30 N" }\n\n[[tests]]'
    shift = run(DAMPER.replace("[[tests]]", effects))["slow"].outputs["force"] - run(DAMPER)["slow"].outputs["force"]
    assert shift == pytest.approx(np.full(600, 30.0))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('model = "kelvin_voigt_damper"', 'model = "kelvin_voigt_dampr"', "Did you mean 'kelvin_voigt_damper'"),
        ('c = "2 kN/m"', 'k = "2 kN/m"', "unknown parameter 'k'"),
        ('c = "2 kN/m"', 'c = "2 kN"', "does not fit"),
        ("F_0 = 4", "F_0 = nan", "not finite"),
        ('frequency = "1 Hz"', "", "sine needs 'frequency'"),
        ("periods = 3", 'periods = 3\nduration = "3 s"', "either 'periods' or 'duration'"),
        ("periods = 3", 'periods = 3\nramp_rate = "1 mm/s"', "no use for 'ramp_rate'"),
        ("periods = 3", "period = 3", "Did you mean 'periods'"),
        ('kind = "sine"', 'kind = "sinus"', "Did you mean 'sine'"),
        ('kind = "sine"', 'kind = "free"', "free needs 'record'"),
        ('sample_rate = "200 Hz"', 'sample_rate = "-1 Hz"', "not above 0"),
        ('sample_rate = "200 Hz"', "", "sine needs 'sample_rate'"),
        ("seed = 1", "", "missing"),
        ("seed = 1", "seed = 1\nsede = 2", "unknown key"),
        ("seed = 1", "seed = ", "no valid TOML"),
        ("[[tests]]", "[noise.forse]\nsd = 1\n\n[[tests]]", "Did you mean 'force'"),
        ("[[tests]]", '[[effects]]\nname = "dry_frictio"\n\n[[tests]]', "Did you mean 'dry_friction'"),
        ("[[tests]]", '[[effects]]\nname = "slip_offset"\n\n[[tests]]', "acts on slip_angle"),
    ],
)
def test_issue_is_named_with_its_hint(run, old, new, message):
    assert old in DAMPER
    with pytest.raises(InputError, match=r"plan|effect") as caught:
        run(DAMPER.replace(old, new, 1))
    assert message in str(caught.value)


def test_all_issues_come_together(run):
    text = DAMPER.replace('c = "2 kN/m"', 'k = "2 kN/m"').replace("10 mm", "10 N")
    with pytest.raises(InputError) as caught:
        run(text.replace("[[tests]]", "[noise.torque]\nsd = 1\n\n[[tests]]"))
    assert len(caught.value.issues) == 3


def test_missing_condition_is_an_issue_of_the_test(run):
    text = DAMPER.replace("kelvin_voigt_damper", "maxwell_tyre").replace("10 mm", "2 deg")
    text = text[: text.index("[parameters]")] + text[text.index("[[tests]]") :]
    with pytest.raises(InputError, match=r"test 'slow'.*needs condition 'longitudinal_velocity'"):
        run(text)


def test_missing_plan_is_named(tmp_path):
    with pytest.raises(InputError, match=r"there is no file.*nowhere\.toml"):
        simulate(tmp_path / "nowhere.toml")


def test_bundled_campaign_is_what_its_plan_gives():
    shipped, again = read_campaign(bundled_campaign()), simulate(PLANS / "paper.toml")
    assert shipped.source == "simulated"
    assert "not a measurement" in shipped.attributes["made_with"]
    assert shipped.tests == again.tests
    for old, new in zip(shipped.measurements, again.measurements, strict=True):
        for name, values in {**new.experiment.inputs, **new.outputs}.items():
            # kernels may integrate a little differently
            assert np.max(np.abs(old.channel(name) - values)) < 1e-5 * np.ptp(values)
    assert bundled_campaign().stat().st_size < 2e6


def test_bundled_tests_are_those_of_table_1():
    campaign = read_campaign(bundled_campaign())
    kinds = [m.kind for m in campaign.measurements]
    assert {kind: kinds.count(kind) for kind in kinds} == {"step": 3, "quasi_static": 1, "sine": 9}
    sines = [m.experiment for m in campaign.measurements if m.kind == "sine"]
    assert [s.frequency for s in sines] == [0.25, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4]
    assert all(s.amplitude == pytest.approx(np.deg2rad(2)) for s in sines)
    assert campaign.conditions["longitudinal_velocity"] == pytest.approx(60 / 3.6)
    assert campaign.conditions["inflation_pressure"] == pytest.approx(2.75e5)


def test_table_5_plan_is_the_maxwell_tyre_of_table_5():
    """A sine of the plan against CVODES, within the plan's 1 % of noise."""
    campaign = simulate(PLANS / "table5.toml")
    values = json.loads(campaign.attributes["simulated_parameters"])
    published = {"c_y": 121_819, "p_y": -7.547, "d_y": 281, "c_M": 19_910, "d_M": 7_535}
    assert {name: values[name] for name in published} == pytest.approx(published)
    test = campaign["sine_2_00Hz"]
    system = build_system(find_model("maxwell_tyre"))
    p, c = [values[name] for name in system.parameters], [60 / 3.6, 1.0, 0.01]
    t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
    angle = np.deg2rad(2) * ca.sin(4 * np.pi * t)
    dae = {"x": x, "t": t, "ode": system.rhs(x, angle, p, c)}
    solver = ca.integrator("run", "cvodes", dae, 0.0, test.time[1:], {"abstol": 1e-12, "reltol": 1e-10})
    states = np.hstack([np.zeros((2, 1)), solver(x0=[0, 0])["xf"].full()])
    angles = np.deg2rad(2) * np.sin(4 * np.pi * test.time)
    exact = np.array([float(system.out(states[:, k], angles[k], p, c)) for k in range(len(test.time))])
    residual = test.outputs["lateral_force"] - exact
    assert np.std(residual) == pytest.approx(0.01 * np.ptp(exact), rel=0.1)
    assert abs(np.mean(residual)) < 4 * np.std(residual) / np.sqrt(len(residual))


DRIFTING = """
pause = "97 s"

[[effects]]
name = "drift"
parameters = { k_t = RATE }
kinds = ["chirp"]
"""

CHIRP = """
[[tests]]
name = "NAME"
kind = "chirp"
sample_rate = "200 Hz"
amplitude = "10 mm"
frequency = "1 Hz"
last_frequency = "2 Hz"
duration = "3 s"
"""


def test_effect_joins_the_kinds_it_is_given_and_knows_the_clock(run):
    head, slow = DAMPER.split("[parameters]")
    tests = "\n[parameters]" + slow + CHIRP.replace("NAME", "second") + CHIRP.replace("NAME", "third")
    plain, drifting = (run(head + DRIFTING.replace("RATE", rate) + tests) for rate in ("0", "1e-3"))
    assert drifting["slow"].outputs["force"] == pytest.approx(plain["slow"].outputs["force"])
    for name, start in (("second", 100), ("third", 200)):
        test, force = drifting[name], plain[name].outputs["force"]
        assert test.experiment.start_time == pytest.approx(start, abs=0.02)
        expected = force * (1 + 1e-3 * (test.experiment.start_time + test.time))
        assert test.outputs["force"] == pytest.approx(expected)


def test_unknown_kind_of_an_effect_is_an_issue(run):
    plan = DAMPER + '\n[[effects]]\nname = "force_gain"\nkinds = ["sines"]\n'
    with pytest.raises(InputError, match=r"unknown kind 'sines'.*Did you mean 'sine'"):
        run(plan)


numbers = st.floats(1e-3, 1e6)
words = st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), max_size=12)


def read_back(plan, tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(plan_text(plan, "one line\nand another"), encoding="utf-8")
    return read_plan(path)


@pytest.mark.parametrize("name", ["paper.toml", "table5.toml"])
def test_the_shipped_plans_survive(name, tmp_path):
    plan = read_plan(PLANS / name)
    assert read_back(plan, tmp_path) == plan


@settings(max_examples=25)
@given(words, words, numbers, st.dictionaries(words, numbers, max_size=3))
def test_any_text_and_number_survives(tmp_path_factory, title, name, number, conditions):
    plan = Plan(
        title=title,
        model="maxwell_tyre",
        seed=7,
        parameters={"c_y": number, "d_y": "281 N s/m"},
        conditions=conditions,
        effects=(EffectPlan(name="force_gain", parameters={"g_F": number}),),
        noise={"lateral_force": NoisePlan(sd="5 N", level=0.01)},
        attributes={"a key": title, "number": 3},
        pause="30 s",
        tests=(
            plans.TestPlan(
                name=f"m{name}",
                kind="multisine",
                sample_rate="100 Hz",
                amplitude=number,
                frequency="0.5 Hz",
                lines=(1, 3),
                periods=4.0,
                conditions=conditions,
            ),
            plans.TestPlan(
                name=f"s{name}", kind="step", sample_rate=100.0, amplitude="-1 deg", ramp_rate=1.0, duration=2.0
            ),
        ),
    )
    assert read_back(plan, tmp_path_factory.mktemp("plans")) == plan


EARTHQUAKE = """
title = "replay"
model = "kelvin_voigt_damper"
seed = 1

[parameters]
c = "2 kN/m"
d = "500 N s/m"
F_0 = 4

[[tests]]
name = "shaken"
kind = "free"
record = "measured.nc"
test = "earthquake"
"""


@pytest.fixture
def measured(tmp_path):
    """A campaign file beside the plan: a record of any shape, with the force of another specimen."""
    time = np.arange(0, 6, 0.005)
    x = 0.01 * np.exp(-0.3 * time) * np.sin(2 * np.pi * time) + 0.002 * np.sin(17 * time)
    experiment = Experiment("earthquake", "free", time, {"displacement": x}, {"load": 7.0}, transient=0.5)
    units = {"displacement": "m", "force": "N"}
    tests = (Measurement(experiment, {"force": np.cos(time)}, units),)
    write_campaign(Campaign("site", "measured", {}, tests, units={"load": "N"}), tmp_path / "measured.nc")
    return experiment


def test_inputs_of_a_record_are_taken_as_they_are(run, measured):
    campaign = run(EARTHQUAKE)
    (shaken,) = campaign.measurements
    assert (shaken.name, shaken.kind, campaign.source) == ("shaken", "free", "simulated")
    np.testing.assert_array_equal(shaken.time, measured.time)
    np.testing.assert_array_equal(shaken.experiment.inputs["displacement"], measured.inputs["displacement"])
    x, time = measured.inputs["displacement"], measured.time
    decay, angle = 0.01 * np.exp(-0.3 * time), 2 * np.pi * time
    v = decay * (2 * np.pi * np.cos(angle) - 0.3 * np.sin(angle)) + 0.002 * 17 * np.cos(17 * time)
    assert shaken.outputs["force"] == pytest.approx(2000 * x + 500 * v + 4, abs=0.5)
    assert dict(shaken.experiment.conditions) == {"load": 7.0}


def test_conditions_of_the_plan_precede_those_of_a_record(run, measured):
    campaign = run(EARTHQUAKE.replace("[parameters]", '[conditions]\nload = "3 N"\n\n[parameters]'))
    assert campaign["shaken"].experiment.conditions["load"] == 3.0


def test_records_and_planned_tests_stand_side_by_side(run, measured):
    both = EARTHQUAKE.replace("[[tests]]", '[defaults]\nsample_rate = "200 Hz"\n\n[[tests]]')
    both += '\n[[tests]]\nname = "slow"\nkind = "sine"\namplitude = "10 mm"\nfrequency = "1 Hz"\nperiods = 3\n'
    campaign = run(both)
    assert campaign.tests == ("shaken", "slow")
    assert campaign["slow"].experiment.start_time == pytest.approx(6 - 0.005)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("measured.nc", "absent.nc", "absent.nc"),
        ('"earthquake"', '"earthquak"', "Did you mean 'earthquake'"),
        ('test = "earthquake"', "", "needs 'test'"),
        ('test = "earthquake"', 'test = "earthquake"\nperiods = 3', "no use for 'periods'"),
        ('test = "earthquake"', 'test = "earthquake"\nsample_rate = 10', "no use for 'sample_rate'"),
        ('kind = "free"', 'kind = "fre"', "Did you mean"),
        ('kelvin_voigt_damper"', 'maxwell_tyre"', "slip_angle"),
    ],
)
def test_an_unusable_record_is_named(run, measured, old, new, message):
    text = EARTHQUAKE.replace(old, new)
    if "maxwell" in new:
        text = text[: text.index("[parameters]")] + text[text.index("[[tests]]") :]
    with pytest.raises(InputError) as caught:
        run(text)
    assert message in str(caught.value)
