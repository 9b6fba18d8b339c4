"""Users' simulators of which everything is known, each beside a model with the same equations."""

import numpy as np

from mofit.models import Channel, Condition, Equations, Model, Simulator
from mofit.parameters import Parameter

PARAMETERS = (
    Parameter("k", "N/m", 10.0, 1e3, 100.0, "log"),
    Parameter("d", "N s/m", 0.0, 20.0, 5.0),
    Parameter("T", "s", 1e-2, 1.0, 0.1, "log"),
)
INPUTS = (Channel("displacement", "m"),)
OUTPUTS = (Channel("force", "N"),)


class Lagging(Model):
    """F = k z + d x^3 / m^2, T z' = x - z, z(0) = x(0); the load adds a tenth of it."""

    name = "lagging"
    parameters = PARAMETERS
    states = (Channel("z", "m"),)
    inputs = INPUTS
    outputs = OUTPUTS
    conditions = (Condition("load", "N", 0.0),)

    def equations(self, s):
        """One state."""
        x = s.displacement
        return Equations(
            outputs={"force": s.k * s.z + s.d * x**3 + 0.1 * s.load},
            derivatives={"z": (x - s.z) / s.T},
            initial={"z": x},
        )


def lagging(record, parameters):
    """The same in closed form, for inputs that are straight between samples."""
    x, step = record.inputs["displacement"], record.time[1] / parameters["T"]
    decay = np.exp(-step)
    there = 1 - (1 - decay) / step
    z = np.empty_like(x)
    z[0] = x[0]
    for k in range(1, len(x)):
        z[k] = decay * z[k - 1] + (1 - decay - there) * x[k - 1] + there * x[k]
    return parameters["k"] * z + parameters["d"] * x**3 + 0.1 * record.conditions["load"]


def lagging_simulator(**more) -> Simulator:
    """Beside `Lagging`."""
    return Simulator(lagging, PARAMETERS, INPUTS, OUTPUTS, conditions=Lagging.conditions, **more)


def line(record, parameters):
    """F = k x + b, for one set or for many."""
    x = record.inputs["displacement"]
    return np.multiply.outer(parameters["k"], x) + np.expand_dims(parameters["b"], -1)


LINE = (Parameter("k", "N/m", -10.0, 10.0, 1.0), Parameter("b", "N", -10.0, 10.0, 0.0))


class LineWithSlopes:
    """The straight line with its derivatives."""

    def __call__(self, record, parameters):
        """F = k x + b."""
        return line(record, parameters)

    def sensitivities(self, record, parameters, free):
        """dF/dk = x, dF/db = 1."""
        x = record.inputs["displacement"]
        slopes = {"k": x, "b": np.ones_like(x)}
        return line(record, parameters)[:, None], np.stack([slopes[name] for name in free], axis=-1)[:, None]


def line_simulator(function=line, **more) -> Simulator:
    """Beside `straight_line.StraightLine`."""
    return Simulator(function, LINE, INPUTS, OUTPUTS, **more)
