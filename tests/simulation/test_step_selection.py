"""The choice of method and number of steps."""

import casadi as ca
import numpy as np
import pytest
from kernel_models import DYNAMIC, NOMINAL, OSCILLATOR, RELAXATION, TYRE, dynamic_box, sine_experiment, tyre_experiment
from kernel_response import point, simulator

from mofit.errors import InputError
from mofit.models import Channel, Equations, Model, build_system, find_effect, find_model, with_effects
from mofit.parameters import Parameter
from mofit.simulation import Simulator
from mofit.simulation.integrators import RK4, RODAS4
from mofit.simulation.step_probing import StepProbe, StepSettings, Stiffness
from mofit.simulation.step_selection import StepSelection, sample_box


def test_sample_lies_in_the_box_and_holds_its_corners():
    lower, upper = np.array([0.1, -1.0, 3.0]), np.array([100.0, 1.0, 3.0])
    p = sample_box(lower, upper, StepSettings())
    assert np.all((p >= lower) & (p <= upper))
    for corner in ((0.1, -1.0, 3.0), (0.1, 1.0, 3.0), (100.0, -1.0, 3.0), (100.0, 1.0, 3.0)):
        assert np.any(np.all(np.isclose(p, corner), axis=1))
    # logarithmic where the bounds are far apart
    assert 2 < np.median(p[:, 0]) < 5


def test_stiffness_is_the_fastest_rate_whatever_the_units():
    probes = [np.zeros((n, 1)) for n in (2, 1, 0)]
    m, d, k = 2.0, 1.0, 2e6
    rate = Stiffness(OSCILLATOR, *probes)(np.array([[m, d, k], [1.0, 1e5, 1.0], [np.nan, 1.0, 1.0]]))
    # the norm of the 16th power lies above the spectral radius by at most the 16th root of the condition
    assert np.sqrt(k / m) <= rate[0] < 2.1 * np.sqrt(k / m)
    assert 1e5 * 0.99 < rate[1] < 2.1e5


def test_stiffer_sets_get_more_work_and_the_stiffest_the_l_stable_method():
    experiment = sine_experiment(RELAXATION, 1.0)
    simulator = Simulator(RELAXATION, [experiment], box=([1e-6, 1.0, -0.5], [10.0, 1.0, 0.5]))
    rule = simulator.rules[0]
    assert rule.levels[0].scheme is RK4
    assert rule.levels[-1].scheme is RODAS4
    assert list(rule.limits) == sorted(rule.limits)


def test_a_small_box_or_a_loose_tolerance_takes_fewer_steps():
    experiment = tyre_experiment(3.3, 100)
    whole = Simulator(TYRE, [experiment], DYNAMIC, box=dynamic_box())
    work = whole.rules[0].levels[-2].cost
    around = (0.95 * NOMINAL, 1.05 * NOMINAL)
    near = whole.within((np.minimum(*around), np.maximum(*around)))
    loose = near.within((np.minimum(*around), np.maximum(*around)), tolerance=1e-3)
    assert loose.rules[0].levels[0].cost < near.rules[0].levels[0].cost <= work
    np.testing.assert_allclose(near.cost(NOMINAL), whole.cost(NOMINAL), rtol=1e-5)
    assert loose.tolerance == 1e-3
    assert whole.tolerance == near.tolerance == 1e-6


def test_fast_undamped_oscillations_have_outputs_though_no_step_level_resolves_them():
    experiment = sine_experiment(OSCILLATOR, 1.0, 60)
    simulator = Simulator(OSCILLATOR, [experiment], box=([1e-6, 1e-6, 1.0], [1.0, 1.0, 1e8]))
    assert np.all(np.isfinite(simulator.simulate([1e-6, 1e-6, 1e8])[0]))


@pytest.mark.parametrize("boxed", [False, True])
def test_kinks_that_no_step_level_resolves_take_the_finest(boxed):
    time = np.arange(1000) / 500
    x = 0.01 * np.sin(8 * time) * np.cos(0.7 * time)
    channels = {"displacement": x, "velocity": np.gradient(x, time)}
    model = with_effects(find_model("kelvin_voigt_damper"), find_effect("backlash"))
    fine, values = simulator(model, [(channels, {})], 1 / 500, steps=512), point(model, {"b_0": 1e-3})
    box = (values[0], values[0]) if boxed else None  # all fixed, as where a record is predicted
    chosen = Simulator(build_system(model), fine.experiments, (), box=box)
    (expected,), (found,) = fine.simulate(values), chosen.simulate(values)
    assert np.max(np.abs(found - expected)) < 0.01 * np.ptp(expected)


def test_bounds_that_coincide_are_a_box_too():
    experiment = sine_experiment(RELAXATION)
    p = np.array([0.2, 2.0, 0.1])
    fixed, measured = Simulator(RELAXATION, [experiment], box=(p, p)), Simulator(RELAXATION, [experiment])
    np.testing.assert_allclose(fixed.simulate(p)[0], measured.simulate(p)[0], atol=1e-6)


def test_changed_data_keep_the_time_grid_and_the_rule():
    experiment = tyre_experiment(1.37, 200)
    simulator = Simulator(TYRE, [experiment], DYNAMIC, box=dynamic_box())
    cut = experiment.changed(inputs=experiment.inputs[:90], measured=experiment.measured[:90], weights=np.ones((90, 1)))
    shorter = simulator.with_experiments([cut.changed(measured=cut.measured + 1.0)])
    assert shorter.rules == simulator.rules
    # the spline of fewer samples differs next to its end
    whole, part = simulator.simulate(NOMINAL)[0], shorter.simulate(NOMINAL)[0]
    np.testing.assert_allclose(part[0, :80], whole[0, :80], atol=1e-9 * np.ptp(whole))


def test_box_of_another_size_is_an_input_error():
    with pytest.raises(InputError, match="tau, gain, start"):
        Simulator(RELAXATION, [sine_experiment(RELAXATION)], box=([0.0], [1.0]))


class Stops(Model):
    """A lag that hits a stop on either side: a kink in the state, met at any moment between samples."""

    name = "stops"
    states = (Channel("x", "m"),)
    inputs = (Channel("u", "m"),)
    outputs = (Channel("y", "N"),)
    parameters = (Parameter("tau", "s", 0.1, 1.0, 0.3, "log"), Parameter("gap", "m", 0.1, 0.9, 0.4))

    def equations(self, s):
        beyond = ca.fmax(s.x - s.gap, 0) + ca.fmin(s.x + s.gap, 0)
        return Equations({"y": s.x}, {"x": (s.u - s.x) / s.tau - 40 * beyond}, {})


class MostOfAll(StepSelection):
    """As if the number of steps that a kink asks for were a property of the parameters."""

    settings = StepSettings(kinks=1.0)


def test_kinks_that_a_few_sets_meet_by_chance_do_not_make_all_others_dear():
    system, box, tolerance = build_system(Stops()), ([0.1, 0.1], [1.0, 0.9]), 1e-5
    experiment, p = sine_experiment(system, 0.4, 200, 0.05), sample_box(*map(np.array, box), StepSettings(points=32))
    probe = StepProbe(system, [experiment], system.parameters, 1)

    def cost(kind):
        (choice,) = kind(lambda: probe, box, tolerance).choices(p, [experiment])
        return np.mean([choice.levels[k].cost for k in choice.taken])

    assert cost(StepSelection) < 0.7 * cost(MostOfAll)
    usual = Simulator(system, [experiment], box=box, tolerance=tolerance)
    fine = Simulator(system, [experiment], box=box, tolerance=1e-9)
    pairs = [(usual.simulate(own)[0], fine.simulate(own)[0]) for own in p]
    errors = [np.max(np.abs(found - right)) / np.ptp(right) for found, right in pairs]
    assert np.median(errors) < tolerance
    assert max(errors) < 10 * tolerance
