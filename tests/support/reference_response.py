"""A plain reference for models: CVODES through CasADi over a smooth input."""

from collections.abc import Callable, Mapping

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.models import Model, build_system


def response(
    model: Model,
    parameters: Mapping[str, float],
    time: FloatArray,
    inputs: Callable[[ca.SX], list[ca.SX]],
    conditions: Mapping[str, float] | None = None,
) -> FloatArray:
    """First output of a model at ``time`` under inputs given as functions of time."""
    system = build_system(model)
    p = [parameters[name] for name in system.parameters]
    given = dict(conditions or {})
    c = [given.get(condition.name, condition.default) for condition in model.conditions]
    t, x = ca.SX.sym("t"), ca.SX.sym("x", len(system.states))
    u = ca.vertcat(*inputs(t))
    signal = ca.Function("u", [t], [u])
    states = np.zeros((0, len(time)))
    if system.states:
        options = {"abstol": 1e-12, "reltol": 1e-10, "max_num_steps": 100_000}
        dae = {"x": x, "t": t, "ode": system.rhs(x, u, p, c)}
        run = ca.integrator("run", "cvodes", dae, float(time[0]), time[1:], options)
        start = system.initial(signal(time[0]), p, c)
        states = np.hstack([start.full(), run(x0=start)["xf"].full()])
    return np.array([float(system.out(states[:, k], signal(time[k]), p, c)[0]) for k in range(len(time))])
