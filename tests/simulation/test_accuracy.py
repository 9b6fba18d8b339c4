"""Against CVODES, anywhere in the box; derivatives against central differences."""

import numpy as np
import pytest
from kernel_models import (
    DYNAMIC,
    NOMINAL,
    RELAXATION,
    ROLLING,
    TYRE,
    draws,
    dynamic_box,
    sine_experiment,
    tyre_experiment,
)
from reference import reference_outputs

from mofit.models import Channel, Equations, Model, build_system, find_model
from mofit.parameters import Parameter, ParameterSpace
from mofit.simulation import ExperimentData, Simulator
from mofit.simulation.integrators import RK4, RODAS4
from mofit.simulation.scheduler import Scheduler
from mofit.simulation.time_grid import StepChoice, StepLevel


def worst(system, experiment, outputs, p, **reference):
    exact = reference_outputs(system, experiment, p, **reference)
    return np.max(np.abs(outputs - exact)) / np.ptp(exact)


@pytest.mark.parametrize("frequency", [0.41, 3.93])
def test_tyre_agrees_with_cvodes_throughout_its_box(frequency, rng):
    lower, upper = dynamic_box()
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T
    unit = np.zeros((len(corners) + 6, len(NOMINAL)))
    unit[:, -3:] = np.concatenate([corners, rng.uniform(size=(6, 3))])
    p = draws(lower, upper, unit)
    experiment = tyre_experiment(frequency)
    (y,) = Simulator(TYRE, [experiment], DYNAMIC, box=(lower, upper)).simulate(p)
    assert max(worst(TYRE, experiment, y[i], p[i], scale=1e-4) for i in range(len(p))) < 1e-6


def test_stiff_corner_agrees_with_cvodes():
    # T_M = d_M / c_M from 1e-7 s to 10 s at a sampling interval of 0.01 s
    lower, upper = dynamic_box(d_M=(5e-3, 6e4))
    experiment = tyre_experiment(2.03)
    p = np.tile(NOMINAL, (6, 1))
    p[:, TYRE.parameters.index("d_M")] = [5e-3, 1.0, 20.0, 100.0, 1000.0, 6e4]
    simulator = Simulator(TYRE, [experiment], DYNAMIC, box=(lower, upper))
    (y,) = simulator.simulate(p)
    errors = [worst(TYRE, experiment, y[i], p[i], scale=1e-4) for i in range(len(p))]
    assert max(errors) < 1e-6
    assert simulator.rules[0].levels[-1].scheme is RODAS4


def shipped(name):
    """A shipped model on a test of its kind."""
    model = find_model(name)
    system = build_system(model)
    if "tyre" in name:
        step, samples, conditions = 0.01, 100, ROLLING
        waves = [np.deg2rad(1.0) * np.sin(2 * np.pi * 1.07 * step * np.arange(samples))]
    else:
        # a bit more than half a period: loads both ways, and turns
        step, samples, conditions = 0.004, 160, np.zeros(len(system.conditions))
        phase = 2 * np.pi * step * np.arange(samples)
        waves = [0.02 * np.sin(phase), 0.02 * 2 * np.pi * np.cos(phase)]
    shape = (samples, len(system.outputs))
    experiment = ExperimentData(
        "about 1 Hz",
        step,
        np.stack(waves, axis=1),
        "cubic",
        np.array(conditions, float),
        np.zeros(shape),
        np.ones(shape),
    )
    return model, system, experiment


@pytest.mark.parametrize("name", ["maxwell_tyre", "kelvin_voigt_tyre", "maxwell_damper", "bouc_wen_damper"])
def test_shipped_models_agree_with_cvodes_throughout_the_box_of_all_parameters(name, rng):
    model, system, experiment = shipped(name)
    space = ParameterSpace(model.parameters)
    unit = rng.uniform(size=(16, len(space)))
    edge = rng.uniform(size=unit.shape)
    unit = np.where(edge < 0.25, 0.0, np.where(edge > 0.75, 1.0, unit))
    p = space.from_unit(unit)
    lower, upper = space.from_unit(np.array([[0.0], [1.0]]) * np.ones(len(space)))
    (y,) = Simulator(system, [experiment], box=(lower, upper)).simulate(p)
    assert max(worst(system, experiment, y[i], p[i], scale=1e-4) for i in range(len(p))) < 1e-6


@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_without_a_box_every_set_is_measured(interpolation):
    experiment = sine_experiment(RELAXATION, 2.0, 80, interpolation=interpolation)
    p = np.array([[1e-5, 2.0, 0.5], [1e-3, 2.0, 0.5], [0.05, 1.0, -1.0], [5.0, 1.0, 0.2]])
    (y,) = Simulator(RELAXATION, [experiment]).simulate(p)
    assert max(worst(RELAXATION, experiment, y[i], p[i]) for i in range(len(p))) < 1e-6


@pytest.mark.parametrize("scheme", [RK4, RODAS4], ids=["RK4", "RODAS4"])
def test_tyre_derivatives_agree_with_central_differences(scheme):
    experiment = tyre_experiment(3.1)
    step = 1e-5
    shifts = np.diag(step * NOMINAL)
    p = np.concatenate([NOMINAL[None], NOMINAL + shifts, NOMINAL - shifts])
    choice = [StepChoice.everywhere(StepLevel(scheme, 2), len(p))]
    values = Scheduler(TYRE, TYRE.parameters, jobs=1).stored([experiment], p, choice, True)[0]
    up, down = np.split(values[1:, ..., 0], 2)
    for j in range(len(NOMINAL)):
        difference = (up[j] - down[j]) / (2 * step * NOMINAL[j])
        error = np.max(np.abs(values[0, ..., 1 + j] - difference))
        assert error < 1e-6 * np.max(np.abs(difference)), TYRE.parameters[j]


@pytest.mark.parametrize("scheme", [RK4, RODAS4], ids=["RK4", "RODAS4"])
def test_gradient_of_the_cost_agrees_with_central_differences(scheme):
    experiment = tyre_experiment(1.3)
    scheduler = Scheduler(TYRE, DYNAMIC, jobs=1)
    at = [TYRE.parameters.index(name) for name in DYNAMIC]
    choice = [StepChoice.everywhere(StepLevel(scheme, 1), 1)]
    gradient = scheduler.reduced([experiment], NOMINAL[None], choice, True)[0, 0, 0, 1:4]
    for j, index in enumerate(at):
        ends = []
        for sign in (1, -1):
            p = NOMINAL.copy()
            p[index] *= 1 + sign * 1e-4
            ends.append(scheduler.reduced([experiment], p[None], choice, False)[0, 0, 0, 0])
        difference = (ends[0] - ends[1]) / (2e-4 * NOMINAL[index]) / 2
        assert gradient[j] == pytest.approx(
            difference, rel=1e-6, abs=1e-6 * np.max(np.abs(gradient * NOMINAL[at])) / NOMINAL[index]
        )


@pytest.mark.parametrize(("scheme", "order"), [(RK4, 4), (RODAS4, 4)], ids=["RK4", "RODAS4"])
def test_order_of_convergence(scheme, order):
    experiment = sine_experiment(RELAXATION, 1.0, 50, step=0.1)
    scheduler = Scheduler(RELAXATION, RELAXATION.parameters, jobs=1)
    p = np.array([[0.4, 1.0, 0.5]])
    y = [
        scheduler.stored([experiment], p, [StepChoice.everywhere(StepLevel(scheme, n), 1)], False)[0]
        for n in (2, 4, 64)
    ]
    ratio = np.max(np.abs(y[0] - y[2])) / np.max(np.abs(y[1] - y[2]))
    assert np.log2(ratio) > order - 0.5


class StiffSpring(Model):
    """y = u + 0.001 (u - x), x' = (u - x) / tau: a fast branch that hardly shows in the output."""

    name = "stiff_spring"
    states = (Channel("x", "m"),)
    inputs = (Channel("u", "m"),)
    outputs = (Channel("y", "N"),)
    parameters = (Parameter("tau", "s", 1e-6, 10.0, 0.3, "log"),)

    def equations(self, s):
        return Equations({"y": s.u + 1e-3 * (s.u - s.x)}, {"x": (s.u - s.x) / s.tau}, {"x": s.u})


@pytest.mark.parametrize("stiffness", [17.0, 20.0, 31.0, 41.7, 65.0, 83.0])
def test_no_unstable_number_of_steps_is_chosen(stiffness):
    system, step = build_system(StiffSpring()), 0.05
    experiment = sine_experiment(system, 0.1, 800, step)
    p = np.array([[step / stiffness]])
    (y,) = Simulator(system, [experiment], ()).simulate(p)
    assert worst(system, experiment, y[0], p[0]) < 1e-6
