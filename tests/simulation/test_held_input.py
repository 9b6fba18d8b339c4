"""An input that is held between its samples."""

import numpy as np

from mofit.models import Channel, Equations, Model, build_system
from mofit.parameters import Parameter
from mofit.simulation import ExperimentData, Simulator


def test_a_held_input_is_that_of_the_exact_recursion():
    """First-order lag with a zero-order hold: x[k+1] = a x[k] + (1 - a) u[k]."""
    rng, step, lag = np.random.default_rng(0), 0.1, 0.37

    class Lag(Model):
        name = "lag"
        parameters = (Parameter("lag", "s", 0.01, 10.0, lag),)
        states = (Channel("x", "1"),)
        inputs = (Channel("u", "1"),)
        outputs = (Channel("y", "1"),)

        def equations(self, s):
            return Equations(outputs={"y": s.x + s.u}, derivatives={"x": (s.u - s.x) / s.lag})

    u = rng.normal(size=50)
    zero = np.zeros((50, 1))
    experiment = ExperimentData("held", step, u[:, None], "hold", np.empty(0), zero, zero + 1)
    exact, decay = np.zeros(50), np.exp(-step / lag)
    for k in range(49):
        exact[k + 1] = decay * exact[k] + (1 - decay) * u[k]
    (found,) = Simulator(build_system(Lag()), [experiment], steps=16).simulate([[lag]])
    np.testing.assert_allclose(found[0, :, 0], exact + u, atol=1e-8)
