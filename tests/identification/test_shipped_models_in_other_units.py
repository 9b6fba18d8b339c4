"""Every shipped model, identified on the same data in other units: the same verdicts, the same values, converted."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from kernel_response import output

from mofit import identify
from mofit.data import Campaign, Experiment, Measurement, bundled_campaign, read_campaign
from mofit.identification.settings import Settings
from mofit.models import find_model, model_names
from mofit.sampling import SampleSettings

#: newton, metre and second in the units of the numbers, which are taken for SI
UNITS = {"kN, mm, ms": (1e-3, 1e3, 1e3), "mN, km, min": (1e3, 1e-3, 1 / 60)}
#: the law of a tyre tells lengths and times by no channel: of its units that of force may change
OF_TYRES = {"kN": (1e-3, 1.0, 1.0), "mN": (1e3, 1.0, 1.0)}
#: values inside of the ranges; where none is given, the nominal one
TRUE = {
    "kelvin_voigt_damper": {"c": 2e4, "d": 500.0, "F_0": 20.0},
    "maxwell_damper": {"c": 2e4, "d": 100.0, "c_M": 4e4, "d_M": 1500.0, "F_0": 20.0},
    "bouc_wen_damper": {"c": 2e4, "F_y": 300.0, "delta": 1e-3, "F_r": 80.0, "v_s": 0.01},
    "oscillator": {"k": 50.0, "f_0": 3.0, "zeta": 0.1, "x_0": 0.01},
    "duffing_oscillator": {"k": 50.0, "f_0": 3.0, "zeta": 0.1, "k_2": 50.0, "k_3": 3e3},
}
#: those that the bundled campaign has the channels of, at its one load
OF_BUNDLED = {"slip_angle", "lateral_displacement"}
TYRES = [
    name
    for name in model_names()
    if {channel.name for channel in find_model(name).inputs} <= OF_BUNDLED and not name.endswith("_over_load")
]
CASES = [(name, units) for name in TRUE for units in UNITS] + [(name, units) for name in TYRES for units in OF_TYRES]
#: tests of the models that are stages of others; those of the others are chosen by their kind
TESTS = {"tmeasy_curve": ("step_1deg", "step_2deg", "step_4deg"), "quasi_static_spring": ("quasi_static",)}
COUNT, STEP = 1000, 0.01


def factor(unit: str, newton: float, metre: float, second: float) -> float:
    """What 1 of an SI unit is in other units."""
    sizes = {"N": newton, "m": metre, "s": second, "Hz": 1 / second}
    above, _, below = unit.partition("/")
    found = 1.0
    for text, sign in ((above, 1), (below, -1)):
        for part in text.split():
            name, _, power = part.partition("^")
            found *= sizes.get(name, 1.0) ** (sign * int(power or 1))
    return found


def in_units(campaign: Campaign, units: Mapping[str, str], sizes: tuple[float, float, float]) -> Campaign:
    """The campaign as numbers in other units; ``units``: SI units of its channels and conditions by name."""

    def changed(values):
        return {name: value * factor(units.get(name, "1"), *sizes) for name, value in values.items()}

    def test(one: Measurement) -> Measurement:
        own = one.experiment
        driven = next(iter(own.inputs))
        experiment = replace(
            own,
            time=own.time * sizes[2],
            inputs=changed(own.inputs),
            conditions=changed(own.conditions),
            frequency=own.frequency and own.frequency / sizes[2],
            amplitude=own.amplitude and own.amplitude * factor(units.get(driven, "1"), *sizes),
            start_time=own.start_time and own.start_time * sizes[2],
            transient=own.transient and own.transient * sizes[2],
        )
        return replace(one, experiment=experiment, outputs=changed(one.outputs))

    return replace(campaign, measurements=tuple(map(test, campaign.measurements)))


@cache
def campaign(name: str) -> tuple[Campaign, dict[str, str]]:
    """Data in SI, and the units of its channels and conditions by name."""
    model = find_model(name)
    units = {one.name: one.unit for one in (*model.inputs, *model.outputs, *model.conditions)}
    if name in TYRES:
        whole = read_campaign(bundled_campaign())
        return whole, {"vertical_force": "N", **units}
    time, rng = np.arange(COUNT) * STEP, np.random.default_rng(0)
    omegas = 2 * np.pi * np.array([0.3, 0.7, 1.1, 2.3, 3.1, 4.7])
    phases = rng.uniform(0, 2 * np.pi, len(omegas))
    size = 2e-3 if model.inputs[0].name == "displacement" else 0.4
    waves = [(w, p) for w, p in zip(omegas, phases, strict=True)]
    drive = size * sum(np.sin(w * time + p) - np.sin(p) for w, p in waves)
    rate = size * sum(w * np.cos(w * time + p) for w, p in waves)
    channels = dict(zip([channel.name for channel in model.inputs], (drive, rate), strict=False))
    values = output(model, TRUE[name], channels, STEP, steps=16)
    measured = values + 5e-3 * np.ptp(values) * rng.normal(size=COUNT)
    experiment = Experiment("multisine", "free", time, {model.inputs[0].name: drive})
    return Campaign(
        "units", "simulated", {}, (Measurement(experiment, {model.outputs[0].name: measured}, units),)
    ), units


@cache
def identified(name: str, sizes: tuple[float, float, float], folder) -> Mapping[str, tuple[float, float, str]]:
    """MAP estimate, standard deviation (Laplace) and verdict by parameter, of the best mode."""
    data, units = campaign(name)
    sampling = SampleSettings(max_steps=200)
    settings = Settings(sampling=sampling, jobs=1, evaluations=400)
    _, tree = identify(in_units(data, units, sizes), find_model(name), settings, tests=TESTS.get(name, ()), out=folder)
    found = tree["modes/m1"].dataset
    columns = (found[key].values for key in ("parameter", "value", "laplace_sd", "verdict"))
    return {str(name): (float(v), float(sd), str(text)) for name, v, sd, text in zip(*columns, strict=True)}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "units"), CASES)
def test_a_shipped_model_is_identified_alike_in_any_unit(name, units, tmp_path_factory):
    sizes = (UNITS | OF_TYRES)[units]
    own = identified(name, (1.0, 1.0, 1.0), tmp_path_factory.getbasetemp() / name)
    found = identified(name, sizes, tmp_path_factory.getbasetemp() / f"{name} {units}")
    model = find_model(name)
    for parameter in model.parameters:
        if parameter.name not in own:
            continue
        size = factor(parameter.unit, *sizes)
        (value, sd, verdict), (there, sd_there, said) = own[parameter.name], found[parameter.name]
        assert there / size == pytest.approx(value, abs=0.02 * sd), parameter.name
        assert sd_there / size == pytest.approx(sd, rel=0.02), parameter.name
        assert said == verdict, parameter.name
    assert found.keys() == own.keys()
