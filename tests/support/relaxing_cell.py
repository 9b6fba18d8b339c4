"""Current pulses on a cell with a series resistance and one RC branch, by the closed form."""

import numpy as np

from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter

SERIES, BRANCH, TAU = 0.03, 0.012, 1.5
#: open-circuit voltage (V) and the current (A) between moments (s) of each record
PULSES = (
    (3.6, ((0.5, 3.0, -5.0), (5.0, 7.0, 3.0))),
    (3.8, ((1.0, 2.0, -8.0), (4.0, 8.0, -3.0))),
    (4.0, ((0.5, 6.0, 4.0),)),
    (3.7, ((2.0, 2.5, -8.0), (3.5, 4.0, -8.0), (5.0, 9.0, 4.0))),
)


class Resistor(Model):
    """U = U_0 + R_0 I."""

    name = "resistor"
    parameters = (
        Parameter("R_0", "ohm", 1e-3, 1.0, 0.03, "log", "series resistance"),
        Parameter("U_0", "V", 2.5, 4.5, 3.7, description="open-circuit voltage", per="test"),
    )
    inputs = (Channel("current", "A"),)
    outputs = (Channel("voltage", "V"),)

    def equations(self, s):
        return Equations(outputs={"voltage": s.U_0 + s.R_0 * s.current})


def step(time, start, branches):
    """Voltage per ampere that flows from ``start`` on."""
    relaxed = sum(size * (1 - np.exp(-(time - start) / tau)) for size, tau in branches)
    return np.where(time >= start, SERIES + relaxed, 0.0)


def cell(noise=2e-4, seed=0, branch=BRANCH, slow=(0.0, 1.0)) -> Campaign:
    """Four records; a branch of 0 ohm leaves the resistance. ``slow`` is a further one: resistance, time constant."""
    branches = ((branch, TAU), slow)
    rng, tests = np.random.default_rng(seed), []
    time = np.arange(200) * 0.05
    for number, (rest, pulses) in enumerate(PULSES):
        current = sum(size * ((time >= start) & (time < end)) for start, end, size in pulses)
        voltage = rest + sum(
            size * (step(time, start, branches) - step(time, end, branches)) for start, end, size in pulses
        )
        experiment = Experiment(
            f"pulses_{number}", "free", time, {"current": current.astype(float)}, {}, interpolation="hold"
        )
        values = voltage + noise * rng.normal(size=len(time))
        tests.append(Measurement(experiment, {"voltage": values}, {"current": "A", "voltage": "V"}))
    return Campaign("cell", "simulated", {}, tuple(tests))
