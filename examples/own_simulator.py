"""A simulator of your own: any Python function in place of equations. Copy, change, run.

mofit identify campaign.nc --model examples/own_simulator.py:damper --simulations 2000
"""

import numpy as np
from scipy.integrate import solve_ivp

from mofit import Channel, Parameter, Simulator


def force(record, parameters):
    """A spring, and in parallel a damper behind another spring: c (x - z) = d z', F = k x + c (x - z).

    record.time (n,) begins at 0 s, record.inputs and record.conditions are by name, all in SI units. Return the output
    at these times, or a dict of several outputs. What you raise counts as a failed simulation.
    """
    x = record.inputs["displacement"]

    def rate(t, z):
        return parameters["c"] / parameters["d"] * (np.interp(t, record.time, x) - z)

    # stiff where the damper is weak: an implicit method, so that no corner of the ranges takes minutes
    span = (0.0, record.time[-1])
    found = solve_ivp(rate, span, x[:1], method="LSODA", t_eval=record.time, rtol=1e-6, atol=1e-9)
    return parameters["k"] * x + parameters["c"] * (x - found.y[0])


damper = Simulator(
    force,
    parameters=[
        # name, unit, lower bound, upper bound, typical value, scale; a log scale suits positive scale parameters
        Parameter("k", "N/m", 1e3, 1e5, 1e4, "log", "stiffness at rest"),
        Parameter("d", "N s/m", 1e2, 1e4, 1e3, "log", "damping"),
        Parameter("c", "N/m", 1e4, 1e6, 1e5, "log", "stiffness of the spring in series"),
    ],
    inputs=[Channel("displacement", "m")],
    outputs=[Channel("force", "N")],
    name="own_damper",
)
