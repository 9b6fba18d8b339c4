"""The same test in other units of time, force and length: the same values, converted, and the same verdicts."""

from functools import cache

import numpy as np
import pytest
from kernel_response import output

from mofit import identify
from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model, find_effect, find_model, with_effects
from mofit.parameters import Parameter
from mofit.problem.scoped_estimates import scoped_estimates
from mofit.sampling import SampleSettings, laplace_covariance

#: seconds, newtons and metres in the units of the test
UNITS = [(1e-3, 1e3, 1e-3), (1e3, 1.0, 1.0)]
COUNT, STEP = 800, 0.01
TRUE = {"c": 2e4, "p": 0.0, "d": 300.0, "F_0": 10.0}
EFFECTS = {
    "springpot": {"c_f": 4e3, "a_f": 0.3},
    "relaxation_spectrum": {"c_R": 2e4, "tau_R": 0.1, "w_R": 2.5},
}


def size_in_units(name: str, exponent: float, second: float, newton: float, metre: float) -> float:
    """What 1 in SI is in other units, for a springpot with that exponent."""
    fractional, stiffness = second**exponent, newton / metre
    return {
        "c": stiffness, "p": stiffness / metre, "d": stiffness * second, "F_0": newton,
        "c_f": stiffness * fractional, "a_f": 1.0, "c_R": stiffness, "tau_R": second, "w_R": 1.0,
    }[name]  # fmt: skip


@cache
def stroke_and_force(effect: str) -> tuple[np.ndarray, np.ndarray]:
    """A multisine from 0.25 to 5 Hz and the force of a damper with the effect, with noise."""
    time, rng = np.arange(COUNT) * STEP, np.random.default_rng(0)
    omegas = 2 * np.pi * np.array([0.25, 0.5, 1.0, 2.0, 3.5, 5.0])
    phases = rng.uniform(0, 2 * np.pi, len(omegas))
    stroke = 2e-3 * sum(np.sin(w * time + p) - np.sin(p) for w, p in zip(omegas, phases, strict=True))
    rate = 2e-3 * sum(w * np.cos(w * time + p) for w, p in zip(omegas, phases, strict=True))
    model = with_effects(find_model("kelvin_voigt_damper"), find_effect(effect))
    channels = {"displacement": stroke, "velocity": rate}
    force = output(model, TRUE | EFFECTS[effect], channels, STEP, steps=16)
    return stroke, force + 1e-3 * np.ptp(force) * rng.normal(size=COUNT)


@cache
def damper(effect: str, second: float, newton: float, metre: float):
    """Values, standard deviations and verdicts, in the units of the test."""
    stroke, force = stroke_and_force(effect)
    experiment = Experiment("free", "free", np.arange(COUNT) * STEP * second, {"displacement": stroke * metre})
    channels = {"displacement": "m", "force": "N"}
    campaign = Campaign("units", "simulated", {}, (Measurement(experiment, {"force": force * newton}, channels),))
    model = with_effects(find_model("kelvin_voigt_damper"), find_effect(effect))
    return campaign, model


def mode(campaign, model, folder):
    """MAP estimate and standard deviation by parameter, and the verdicts."""
    sampling = SampleSettings(max_steps=200)
    _, tree = identify(campaign, model, Settings(sampling=sampling, jobs=1, evaluations=400), out=folder)
    found = tree["modes/m1"].dataset
    return {str(name): found.sel(parameter=name) for name in found["parameter"].values}


@pytest.mark.slow
@pytest.mark.parametrize("effect", EFFECTS)
def test_relaxation_is_identified_alike_in_any_unit(effect, tmp_path):
    own = mode(*damper(effect, 1.0, 1.0, 1.0), tmp_path / "si")
    for name, value in EFFECTS[effect].items():
        assert abs(float(own[name]["value"]) - value) < 4 * float(own[name]["laplace_sd"])
    for number, units in enumerate(UNITS):
        found = mode(*damper(effect, *units), tmp_path / str(number))
        exponent = float(own["a_f"]["value"]) if "a_f" in own else 0.0
        for name, one in own.items():
            size, sd = size_in_units(name, exponent, *units), float(one["laplace_sd"])
            assert float(found[name]["value"]) / size == pytest.approx(float(one["value"]), abs=0.01 * sd), name
            if name != "c_f":  # its unit holds the exponent, and its uncertainty that of the exponent
                assert float(found[name]["laplace_sd"]) / size == pytest.approx(sd, rel=0.01)
            assert str(found[name]["verdict"].values) == str(one["verdict"].values)


class Tank(Model):
    """A volume that leaks: the pressure, whose unit no channel tells, and the flow that is measured."""

    name = "tank"
    parameters = (Parameter("rate", "1/s", 1e-2, 1e2, 1.0, "log"), Parameter("g", "1", 0.99, 1.01, 1.0))
    states = (Channel("pressure", "Pa"),)
    inputs = (Channel("pump", "A"),)
    outputs = (Channel("flow", "V"),)

    def equations(self, s):
        return Equations(
            outputs={"flow": s.g * s.pressure * 1e-9}, derivatives={"pressure": s.pump - s.rate * s.pressure}
        )


def released(model, outputs, time, unit) -> Campaign:
    name = model.outputs[0].name
    tests = [
        Measurement(Experiment(f"tap{k}", "free", time, {}), {name: values}, {name: unit})
        for k, values in enumerate(outputs)
    ]
    return Campaign("released", "simulated", {}, tuple(tests))


def starts(campaign, model, **settings):
    """Best values of the shared parameters, and those of the initial states with their standard deviations."""
    found = locate_minima(campaign, model, Settings(jobs=1, evaluations=200, **settings))
    minimum, _ = adjusted_modes(found.posterior, found.minima, Settings(jobs=1))[0]
    estimates = scoped_estimates(found.problem, minimum.point, laplace_covariance(minimum.hessian))
    assert estimates is not None
    return found.posterior.space.from_unit(minimum.point), estimates, found


@pytest.mark.parametrize(("second", "metre"), [(1e-3, 1e-3), (1e3, 1e3)])
def test_initial_states_are_identified_alike_in_any_unit(second, metre):
    """Free decays of an oscillator: starts from 20 micrometres to 20 metres, and up to 3 km/s."""
    time, rng = np.arange(600) / 500, np.random.default_rng(0)
    pole = 2 * np.pi * 12 * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
    taps = [(a * np.exp(pole * time)).real + 2e-4 * rng.normal(size=600) for a in (0.02, 0.03j, -0.01 + 0.01j)]
    model = with_effects(find_model("oscillator"), find_effect("start:position"), find_effect("start:velocity"))

    def run(second, metre):
        campaign = released(model, [metre * tap for tap in taps], time * second, "m")
        # the stiffness means nothing without a force
        return starts(campaign, model, fixed={"k": 10.0, "x_0": 0.0})[:2]

    shared, own = run(1.0, 1.0)
    scaled, found = run(second, metre)
    assert scaled * [second, 1] == pytest.approx(shared, rel=1e-5)
    speed = metre / second
    assert found.values / [metre, speed] == pytest.approx(own.values, abs=1e-3 * own.sd.min())
    assert found.sd / [metre, speed] == pytest.approx(own.sd, rel=1e-2)
    assert own.values[:, 0] == pytest.approx([0.02, 0.0, -0.01], abs=5e-4)


def test_a_start_that_no_channel_gives_a_scale_to_is_looked_for_ever_farther():
    """Gigapascals behind volts."""
    time, model = np.arange(300) / 100, with_effects(Tank(), find_effect("start:pressure"))
    noise = 1e-3 * np.random.default_rng(0).normal(size=(2, 300))
    campaign = released(model, [a * np.exp(-2 * time) + e for a, e in zip((3.0, -0.5), noise, strict=True)], time, "V")
    shared, found, located = starts(campaign, model, fixed={"g": 1.0})
    assert shared == pytest.approx([2.0], rel=1e-2)
    assert found.values[:, 0] == pytest.approx([3e9, -0.5e9], rel=1e-2)
    assert any("pressure_start was widened" in note for note in located.warnings)
