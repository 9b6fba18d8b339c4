"""Every effect on the paper's nine sines with Table 5's tyre: its size, none at neutral, and its derivatives."""

from functools import cache

import numpy as np
import pytest
from kernel_response import point, simulator

from mofit.models import effect_names, find_effect, find_model, incompatibility, with_effects

FREQUENCIES = (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
TABLE_5 = {
    "dF0": 62e3, "s_M": 0.13, "F_M": 3100.0, "c_y": 121819.0, "p_y": -7.547, "d_y": 281.0, "c_M": 19910.0, "d_M": 7535.0
}  # fmt: skip
#: RMS of what a typical effect adds [N], estimated by hand; right within a factor of 2
CATALOGUE = {
    "contact_patch_lag": 56, "delay": 74, "sensor_lowpass": 92, "inertia": 14, "second_branch": 28, "springpot": 40,
    "dry_friction": 11, "quadratic_damping": 5, "cubic_stiffness": 12, "asymmetric_stiffness": 3, "slip_offset": 75,
    "force_offset": 25, "force_gain": 26, "cornering_stiffness": 31, "friction_level": 48, "carcass_stiffness": 23,
    "speed": 13, "steering_compliance": 79, "load_coupling": 10, "wheel_order": 14, "drum_runout": 6, "drift": 14,
    "warm_up": 4, "backlash": 25, "graded_play": 25,
}  # fmt: skip
ON_TYRES = [name for name in effect_names() if incompatibility(find_effect(name), find_model("maxwell_tyre")) is None]
#: integration steps per sample; the washout of a mass is stiff
STEPS, STIFF = 4, {"inertia": 16}
STEP = 0.01
#: samples per test: three periods of the slowest sine, of which the first is dropped
COUNT = 1200


def nine_sines():
    time = np.arange(COUNT) * STEP
    conditions = {"longitudinal_velocity": 60 / 3.6, "dynamic_rolling_radius": 0.305, "vertical_force": 3600.0}
    return [
        (
            # no sample at zero slip: the tyre's curve has a kink there, and two slopes
            {"slip_angle": np.radians(2) * np.sin(2 * np.pi * frequency * time + 0.3)},
            {**conditions, "camber_angle": 0.01, "start_time": 300.0 + 50 * number, "rotational_speed": 55.0},
        )
        for number, frequency in enumerate(FREQUENCIES)
    ]


def settled(outputs):
    return [y[round(1 / (frequency * STEP)) :] for y, frequency in zip(outputs, FREQUENCIES, strict=True)]


def rms(signals) -> float:
    return float(np.sqrt(np.mean([np.mean(signal**2) for signal in signals])))


@cache
def plain(steps):
    model = find_model("maxwell_tyre")
    return [y[0, :, 0] for y in simulator(model, nine_sines(), STEP, steps=steps).simulate(point(model, TABLE_5))]


@pytest.mark.parametrize("name", ON_TYRES)
def test_effect_on_the_nine_sines(name):
    steps = STIFF.get(name, STEPS)
    without = plain(steps)
    effect = find_effect(name)
    model = with_effects(find_model("maxwell_tyre"), effect)
    run = simulator(model, nine_sines(), STEP, effect.size, steps=steps)
    # behind another slip angle or speed, steps are not cut at the kink of the tyre's curve any more
    kink = model.effects[0][1] in ("slip_angle", "longitudinal_velocity")
    finer = simulator(model, nine_sines(), STEP, effect.size, steps=16) if kink else run
    neutral = {**TABLE_5, **effect.neutral}
    # play is there for positive sizes only, and to one side first order at best
    one_sided = effect.abrupt
    nudge = 1e-3 * effect.typical
    sets = [neutral, TABLE_5]
    for parameter in effect.size:
        sets += [
            neutral | {parameter: neutral[parameter] + nudge * side} for side in ((0, 1) if one_sided else (-1, 1))
        ]
    values = np.concatenate([point(model, given) for given in sets])
    simulated = [y[..., 0] for y in run.simulate(values)]

    # neutral: the very same numbers, but for the order of operations and where a step is cut at a kink
    unchanged = max(np.max(np.abs(y[0] - expected)) for y, expected in zip(simulated, without, strict=True))
    span = max(np.ptp(expected) for expected in without)
    assert unchanged < (1e-5 if kink else 1e-9) * span

    # typical
    raw = rms(settled([y[1] - expected for y, expected in zip(simulated, without, strict=True)]))
    if name in CATALOGUE:
        assert 0.5 < raw / CATALOGUE[name] < 2
    else:
        assert raw > 1

    # slopes at neutral
    simulated = [y[..., 0] for y in finer.simulate(values)]
    slopes = [s[0, :, 0, :] for _, s in finer.sensitivities(values[:1])]
    for number in range(len(effect.size)):
        low, high = 2 + 2 * number, 3 + 2 * number
        differences = [(y[high] - y[low]) / (nudge * (1 if one_sided else 2)) for y in simulated]
        exact = settled([slope[:, number] for slope in slopes])
        error = rms([d - e for d, e in zip(settled(differences), exact, strict=True)])
        assert error < (2e-2 if one_sided else 1e-4) * rms(exact)
        assert np.isfinite(rms(exact))


def candidates(name):
    """Names of the effects that a model may leave out, and why it does not admit the others."""
    effects = [effect for effect in map(find_effect, effect_names()) if effect.candidate]
    reasons = {effect.name: incompatibility(effect, find_model(name)) for effect in effects}
    return {n for n, r in reasons.items() if r is None}, {n: r for n, r in reasons.items() if r is not None}


def test_a_tyre_admits_every_candidate():
    admitted, refused = candidates("maxwell_tyre")
    assert admitted >= set(CATALOGUE)
    # a tyre names its carcass, so that a branch is a force beside it
    assert refused == {"relaxation": "is for models without carcass_force"}


def test_a_damper_admits_what_it_has_the_quantity_for():
    names, refused = candidates("kelvin_voigt_damper")
    assert {
        "dry_friction",
        "cubic_stiffness",
        "delay",
        "sensor_lowpass",
        "second_branch",
        "backlash",
        "inertia",
    } <= names
    assert {"slip_offset", "wheel_order", "cornering_stiffness", "steering_compliance"} <= set(refused)
    assert refused["slip_offset"] == "acts on slip_angle, which model 'kelvin_voigt_damper' does not have"


@pytest.mark.parametrize("name", effect_names())
def test_grid_for_what_exists_only_under_the_alternative(name):
    effect = find_effect(name)
    assert all(p.grid for p in effect.parameters if p.neutral is None)
    assert len(effect.grid_points) == np.prod([len(values) for values in effect.grid.values()], initial=1)
    assert effect.typical > 0
    assert effect.issues() == []
