"""CVODES through CasADi, sampling interval by sampling interval, with the kernel's own input curve."""

from __future__ import annotations

import casadi as ca
import numpy as np


def reference_outputs(system, experiment, p, tolerance=1e-10, scale=1.0):
    """Outputs (n, ny) at one parameter set; ``scale`` is the size of the states."""
    curve = experiment.curve
    order = curve.c.shape[0]
    x = ca.SX.sym("x", len(system.states))
    t, coefficients = ca.SX.sym("t"), ca.SX.sym("a", order, len(system.inputs))
    u = ca.vertcat(
        *(sum(coefficients[k, i] * t ** (order - 1 - k) for k in range(order)) for i in range(len(system.inputs)))
    )
    rates = system.rhs(x, u, ca.DM(p), ca.DM(experiment.conditions))
    integrator = ca.integrator(
        "reference", "cvodes", {"x": x, "t": t, "p": ca.vec(coefficients), "ode": rates}, 0.0, experiment.step,
        {"reltol": tolerance, "abstol": tolerance * scale, "max_num_steps": 100000},
    )  # fmt: skip
    state = system.initial(experiment.inputs[0], p, experiment.conditions)
    outputs = []
    for k in range(experiment.samples):
        outputs.append(np.array(system.out(state, experiment.inputs[k], p, experiment.conditions)).ravel())
        if k < experiment.samples - 1:
            state = integrator(x0=state, p=curve.c[:, k].T.ravel())["xf"]
    return np.array(outputs)
