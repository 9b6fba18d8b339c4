"""Free decays without an input: the shipped oscillator with initial states and offsets per test."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Channel, Equations, Model, find_effect, find_model, with_effects
from mofit.models.model import Symbols
from mofit.parameters import Parameter
from mofit.problem.scoped_estimates import scoped_estimates
from mofit.sampling import laplace_covariance

FREQUENCY, DAMPING, NOISE = 12.0, 0.03, 2e-4
#: position (m), velocity (m/s) and offset (m) at the start of each tap
STARTS = np.array([[0.02, 0.0, -1e-3], [0.0, 3.0, 0.0], [-0.01, 1.0, 1e-3]])


def taps() -> Campaign:
    """The closed form of a damped oscillation."""
    rng, measurements = np.random.default_rng(0), []
    omega, time = 2 * np.pi * FREQUENCY, np.arange(600) / 500
    damped = omega * np.sqrt(1 - DAMPING**2)
    for k, (position, velocity, offset) in enumerate(STARTS):
        sine = (velocity + DAMPING * omega * position) / damped
        motion = np.exp(-DAMPING * omega * time) * (position * np.cos(damped * time) + sine * np.sin(damped * time))
        values = motion + offset + NOISE * rng.normal(size=len(time))
        experiment = Experiment(name=f"tap{k}", kind="free", time=time, inputs={}, conditions={})
        measurements.append(Measurement(experiment, {"displacement": values}, {"displacement": "m"}))
    return Campaign("taps", "simulated", {}, tuple(measurements))


def test_ringdown_gives_frequency_damping_and_the_start_of_every_tap() -> None:
    model = with_effects(find_model("oscillator"), find_effect("start:position"), find_effect("start:velocity"))
    settings = Settings(fixed={"k": 1e3}, scopes={"x_0": "test"}, evaluations=200, jobs=1)
    found = locate_minima(taps(), model, settings)
    minimum, _ = adjusted_modes(found.posterior, found.minima, settings)[0]
    space, covariance = found.posterior.space, laplace_covariance(minimum.hessian)
    assert space.names == ("f_0", "zeta")
    values = space.from_unit(minimum.point)
    sd = np.sqrt(np.diag(covariance)) * space.derivative(values)
    assert np.all(np.abs(values - [FREQUENCY, DAMPING]) < 4 * sd)
    assert np.all(sd < 0.01 * values)
    estimates = scoped_estimates(found.problem, minimum.point, covariance)
    assert estimates is not None
    assert estimates.space.names == ("x_0", "position_start", "velocity_start")
    assert estimates.space.units == ("m", "m", "m/s")
    off = (estimates.values - STARTS[:, [2, 0, 1]]) / estimates.sd
    assert np.all(np.abs(off) < 4.5)
    assert np.all(estimates.sd < [2e-5, 1e-4, 1e-2])


def test_a_static_model_needs_its_input() -> None:
    with pytest.raises(InputError, match="needs channel 'displacement'"):
        locate_minima(
            Campaign("taps", "simulated", {}, tuple(
                Measurement(m.experiment, {"force": m.channel("displacement")}, {"force": "N"})
                for m in taps().measurements
            )),
            find_model("kelvin_voigt_damper"),
            Settings(),
        )  # fmt: skip


def test_a_state_that_is_not_there_is_named() -> None:
    with pytest.raises(InputError, match=r"effect 'start:speed': needs speed, which model 'oscillator' does not have"):
        with_effects(find_model("oscillator"), find_effect("start:speed"))


class Decay(Model):
    """A damped oscillation that nothing drives."""

    name = "decay"
    parameters = (
        Parameter("omega", "rad/s", 1.0, 1e3, 50.0, "log"),
        Parameter("zeta", "1", 0.0, 0.2, 0.02),
        Parameter("start", "m", -0.1, 0.1, 0.01, per="test"),
        Parameter("start_velocity", "m/s", -10.0, 10.0, 1.0, per="test"),
        Parameter("offset", "m", -0.01, 0.01, 0.0, per="test"),
    )
    states = (Channel("position", "m"), Channel("velocity", "m/s"))
    outputs = (Channel("displacement", "m"),)

    def equations(self, s: Symbols) -> Equations:
        slope = -2 * s.zeta * s.omega * s.velocity - s.omega**2 * s.position
        return Equations(
            outputs={"displacement": s.position + s.offset},
            derivatives={"position": s.velocity, "velocity": slope},
            initial={"position": s.start, "velocity": s.start_velocity},
        )


@pytest.mark.parametrize("recorded", [False, True])
def test_a_model_without_inputs_describes_free_decays(recorded: bool) -> None:
    """Whether or not the records hold a channel beside the output."""
    tests = taps()
    if recorded:
        beside = [{"load": np.sin(m.experiment.time)} for m in tests.measurements]
        tests = replace(
            tests,
            measurements=tuple(
                replace(m, experiment=replace(m.experiment, inputs=inputs), units={**m.units, "load": "N"})
                for m, inputs in zip(tests.measurements, beside, strict=True)
            ),
        )
    settings = Settings(evaluations=200, jobs=1)
    found = locate_minima(tests, Decay(), settings)
    minimum, _ = adjusted_modes(found.posterior, found.minima, settings)[0]
    values = found.posterior.space.from_unit(minimum.point)
    assert values == pytest.approx([2 * np.pi * FREQUENCY, DAMPING], rel=2e-3)
