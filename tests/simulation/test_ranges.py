"""Ranges from the data: another unit of force, length or time changes nothing but the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.data import Campaign, Experiment, Measurement, read_campaign
from mofit.data.campaign_file import bundled_campaign
from mofit.models import drifts_of, effect_names, find_effect, find_model, incompatibility, model_names, with_effects
from mofit.parameters import PER_CAMPAIGN, ParameterSpace
from mofit.problem import build_problem
from mofit.simulation.ranges import data_scales, scaled, with_parameters

GENERAL = [name for name in model_names() if "force" in find_model(name).typical]
EFFECTS = [n for n in effect_names() if incompatibility(find_effect(n), find_model(GENERAL[0])) is None]
EFFECTS += drifts_of(find_model("kelvin_voigt_damper"))
TIME = np.arange(0, 2, 0.01)
DRIVE = np.sin(2 * np.pi * 1.5 * TIME) + 0.3 * np.sin(2 * np.pi * 4.0 * TIME)


def campaign(model, sizes, second=1.0):
    """A multisine with a range per channel, in seconds of some length; the output is made up."""
    source = next(channel for channel in model.inputs if channel.derivative_of is None)
    output = model.outputs[0]
    time = TIME * second
    values = {source.name: sizes[source.name] * DRIVE}
    measured = {output.name: sizes[output.name] * np.roll(DRIVE, 5)}
    turning = {"rotational_speed": 40.0 / second}
    experiment = Experiment("multisine", "multisine", time, values, turning, start_time=100.0 * second)
    units = {source.name: source.unit, output.name: output.unit}
    return Campaign("units", "simulated", {}, (Measurement(experiment, measured, units),))


def responses(model, sizes, second, u):
    data = campaign(model, sizes, second)
    own = scaled(model, data_scales(model, data))
    # the response to a point is asked for: no value per test is fitted along
    shared = with_parameters(own, tuple(replace(one, per=PER_CAMPAIGN) for one in own.parameters))
    problem = build_problem(shared, data)
    return problem.simulate(u)[0][..., 0]


@pytest.mark.parametrize("name", [*GENERAL, *(f"kelvin_voigt_damper+{effect}" for effect in EFFECTS)])
@settings(max_examples=5, deadline=None)
@given(force=st.sampled_from([1e-3, 1.0, 1e3]), length=st.sampled_from([1e-3, 1e3]), second=st.sampled_from([1e-3, 60]))
def test_a_point_of_the_ranges_means_the_same_in_any_unit(name, force, length, second):
    """Ranges that grow with the data as the equations demand: every parameter in the power that its unit has."""
    base, *effects = name.split("+")
    model = with_effects(find_model(base), *map(find_effect, effects))
    u = np.random.default_rng(0).uniform(0.3, 0.7, (3, len(model.parameters)))
    for parameter, column in zip(model.parameters, u.T, strict=True):
        if parameter.name == "a_f":  # the unit of a springpot's coefficient holds its exponent
            column[:] = (parameter.nominal - parameter.lower) / (parameter.upper - parameter.lower)
    own = {"force": 2.0, "displacement": 0.02}
    other = {"force": 2.0 * force, "displacement": 0.02 * length}
    factor = force if model.outputs[0].name == "force" else length
    here, there = responses(model, own, 1.0, u), responses(model, other, second, u)
    assert there / factor == pytest.approx(here, rel=1e-3, abs=1e-3 * np.ptp(here))


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_on_dampers_grow_with_the_data_too(name):
    model, effect = find_model("kelvin_voigt_damper"), find_effect(name)
    data = campaign(model, {"force": 2e6, "displacement": 2e-4}, 1e-3)
    own = scaled(effect, data_scales(model, data))
    dimensionless = [p.name for p in with_effects(model, effect).parameters if p.unit == "1"]
    for before, after in zip(effect.parameters, own.parameters, strict=True):
        if before.name not in dimensionless:
            assert after.upper != before.upper, before.name
        assert (before.neutral is None) == (after.neutral is None)


def test_a_channel_that_never_moves_gives_no_scale():
    model = find_model("kelvin_voigt_damper")
    still = campaign(model, {"force": 2.0, "displacement": 0.0})
    assert set(data_scales(model, still)) == {"force", "output", "time"}
    assert scaled(model, data_scales(model, still)).parameters[0] == model.parameters[0]


def test_ranges_of_a_tyre_grow_with_its_load():
    """A lorry's tyre; the bundled one keeps its ranges to the last digit."""
    tyre, bundled = find_model("maxwell_tyre"), read_campaign(bundled_campaign())
    assert scaled(tyre, data_scales(tyre, bundled)) is tyre
    heavy = tuple(
        replace(m, experiment=replace(m.experiment, conditions={**m.experiment.conditions, "vertical_force": 36e3}))
        for m in bundled.measurements
    )
    lorry = replace(bundled, measurements=heavy)
    for before, after in zip(tyre.parameters, scaled(tyre, data_scales(tyre, lorry)).parameters, strict=True):
        assert after == (before if before.name in ("s_M", "p_y") else before.times(10.0))


#: effects on a tyre whose parameters are angles, forces, times and travelled lengths
ROLLING = ["slip_offset", "contact_patch_lag", "turn_slip", "backlash", "load_coupling", "steering_compliance"]
ROLLING += ["force_offset", "delay", "sensor_lowpass", "warm_up"]


def rolling(angle, force, length, second):
    """A tyre steered by a multisine in other units of force, length and time; the force is made up."""
    conditions = {"vertical_force": 4e3 * force}
    conditions |= {"longitudinal_velocity": 20.0 * length / second, "fictitious_velocity": 0.01 * length / second}
    experiment = Experiment("multisine", "multisine", TIME * second, {"slip_angle": angle * DRIVE}, conditions)
    units = {"slip_angle": "rad", "lateral_force": "N"}
    measured = {"lateral_force": 1e3 * force * np.roll(DRIVE, 5)}
    return Campaign("units", "simulated", {}, (Measurement(experiment, measured, units),))


def tyre_response(effect, force, length, second):
    """At points of the effect's ranges; the carcass is the same one in every unit."""
    tyre, data, sizes = find_model("maxwell_tyre"), rolling(0.03, force, length, second), find_effect(effect)
    own = scaled(sizes, data_scales(tyre, data))
    shared = with_parameters(own, tuple(replace(one, per=PER_CAMPAIGN) for one in own.parameters))
    units = {"N": force, "N/m": force / length, "N s/m": force * second / length, "1/m": 1 / length, "1": 1.0}
    carcass = {one.name: one.nominal * units[one.unit] for one in tyre.parameters}
    problem = build_problem(with_effects(tyre, shared), data, space=ParameterSpace(shared.parameters), fixed=carcass)
    u = np.random.default_rng(0).uniform(0.3, 0.7, (3, len(shared.parameters)))
    return problem.simulate(u)[0][..., 0]


@pytest.mark.parametrize("effect", ROLLING)
@settings(max_examples=4, deadline=None)
@given(force=st.sampled_from([1e-3, 1e3]), length=st.sampled_from([1e-3, 1e3]), second=st.sampled_from([1e-3, 60]))
def test_a_point_of_the_ranges_of_a_tyres_effect_means_the_same_in_any_unit(effect, force, length, second):
    """N to kN, m to mm, s to ms: the unit cube is searched and sampled, so that verdicts are the same too."""
    here, there = tyre_response(effect, 1.0, 1.0, 1.0), tyre_response(effect, force, length, second)
    assert there / force == pytest.approx(here, rel=1e-3, abs=1e-3 * np.ptp(here))


def test_ranges_of_slip_and_travel_are_those_of_a_car_on_its_campaign():
    """And five times as wide where the angle, or the speed, is."""
    tyre, bundled = find_model("maxwell_tyre"), read_campaign(bundled_campaign())
    sines = replace(bundled, measurements=tuple(m for m in bundled.measurements if m.kind == "sine"))

    def upper(effect, **data):
        changed = tuple(
            replace(
                m,
                experiment=replace(m.experiment, **{k: {**getattr(m.experiment, k), **v(m)} for k, v in data.items()}),
            )
            for m in sines.measurements
        )
        (own,) = scaled(find_effect(effect), data_scales(tyre, replace(sines, measurements=changed))).parameters
        return own.upper

    def fast(m):
        return {"longitudinal_velocity": 5 * m.experiment.conditions["longitudinal_velocity"]}

    def wide(m):
        return {"slip_angle": 5 * m.experiment.inputs["slip_angle"]}

    assert upper("slip_offset") == pytest.approx(0.02, rel=0.1)
    assert upper("contact_patch_lag") == pytest.approx(0.5, rel=0.1)
    assert upper("slip_offset", inputs=wide) == pytest.approx(5 * upper("slip_offset"))
    assert upper("contact_patch_lag", conditions=fast) == pytest.approx(5 * upper("contact_patch_lag"))
    assert upper("turn_slip", conditions=fast) == pytest.approx(5 * upper("turn_slip"))


def test_the_range_of_a_play_grows_with_the_input_that_it_acts_on():
    play, bundled = find_effect("backlash"), read_campaign(bundled_campaign())
    tyre, damper = find_model("maxwell_tyre"), find_model("kelvin_voigt_damper")
    wide = tuple(
        replace(m, experiment=replace(m.experiment, inputs={**m.experiment.inputs, "slip_angle": 5 * angle}))
        for m in bundled.measurements
        if (angle := m.experiment.inputs.get("slip_angle")) is not None
    )
    few = replace(bundled, measurements=tuple(m for m in bundled.measurements if "slip_angle" in m.experiment.inputs))
    (narrow,), (far,) = (
        scaled(play, data_scales(tyre, one)).parameters for one in (few, replace(few, measurements=wide))
    )
    assert far.upper == pytest.approx(5 * narrow.upper)
    strokes = [campaign(damper, {"force": 2.0, "displacement": stroke}) for stroke in (0.01, 0.1)]
    (short,), (long,) = (scaled(play, data_scales(damper, one)).parameters for one in strokes)
    assert long.upper == pytest.approx(10 * short.upper)
