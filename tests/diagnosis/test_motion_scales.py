"""Effects of a model that does not say for which rig its ranges are written have them from its motion in the tests."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter

STEP, TIME = 0.02, 10.0


class Table(Model):
    """A mass on spring and damper of 1 Hz: force in, its acceleration out, so that no record shows the deflection."""

    name = "table"

    def __init__(self, mass: float) -> None:
        stiffness, damping = mass * (2 * np.pi) ** 2, mass * 2 * np.pi * 0.2
        self.parameters = tuple(
            Parameter(name, unit, value / 8, value * 8, value, "log")
            for name, unit, value in (("m", "kg", mass), ("k", "N/m", stiffness), ("d", "N s/m", damping))
        )

    states = (Channel("displacement", "m"), Channel("velocity", "m/s"))
    inputs = (Channel("force", "N"),)
    outputs = (Channel("acceleration", "m/s^2"),)

    def equations(self, s):
        """Newton's law."""
        spring = s.quantity("spring_force", s.k * s.quantity("deflection", s.displacement))
        acceleration = (s.force - spring - s.quantity("damper_force", s.d * s.velocity)) / s.m
        return Equations({"acceleration": acceleration}, {"displacement": s.velocity, "velocity": acceleration})


def campaign(mass: float, stroke: float, cubic: float, friction: float) -> Campaign:
    """Sines from rest by SciPy's integrator; shares of a law in the spring's force at the stroke."""
    rng, measured = np.random.default_rng(3), []
    k, d = mass * (2 * np.pi) ** 2 * 1.1, mass * 2 * np.pi * 0.25
    time = np.arange(0.0, TIME, STEP)
    for frequency, size in ((0.5, 0.7), (0.7, 0.5), (1.6, 1.0), (0.4, 0.4)):
        amplitude = size * k * stroke

        def rate(t, y, amplitude=amplitude, frequency=frequency):
            law = cubic * k * stroke * (y[0] / stroke) ** 3 + friction * k * stroke * np.tanh(y[1] / (0.1 * stroke))
            force = amplitude * np.sin(2 * np.pi * frequency * t)
            return [y[1], (force - k * y[0] - d * y[1] - law) / mass]

        found = solve_ivp(rate, (0.0, TIME), [0.0, 0.0], t_eval=time, rtol=1e-8, atol=1e-10 * stroke)
        output = np.array([rate(t, y)[1] for t, y in zip(time, found.y.T, strict=True)])
        force = amplitude * np.sin(2 * np.pi * frequency * time)
        noise = 0.01 * np.ptp(output) * rng.standard_normal(len(time))
        experiment = Experiment(f"sine_{frequency}", "sine", time, {"force": force}, {}, frequency=frequency)
        measured.append(Measurement(experiment, {"acceleration": output + noise}, {"acceleration": "m/s^2"}))
    return Campaign("table", "simulated", {}, tuple(measured))


@pytest.mark.parametrize(("mass", "stroke"), [(5e3, 1e-6), (0.02, 0.4)])
@pytest.mark.parametrize("law", ["cubic", "friction"])
def test_a_law_is_named_whatever_the_size_of_the_rig(mass, stroke, law):
    shares = {"cubic": 0.0, "friction": 0.0} | {law: 0.2 if law == "cubic" else 0.05}
    found = diagnose(
        campaign(mass, stroke, **shares),
        Table(mass),
        ("cubic_stiffness", "dry_friction"),
        Settings(jobs=1),
        diagnosis=DiagnosisSettings(propose=False),
    )
    # no law of friction in the catalogue depends on the speed alone
    assert found.conclusion.verdict == {"cubic": "effect", "friction": "partly"}[law]
    assert found.conclusion.effects[0].name == {"cubic": "cubic_stiffness", "friction": "dry_friction"}[law]
