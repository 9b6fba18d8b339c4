"""Inputs between samples, and where steps lie."""

import numpy as np
import pytest
from kernel_models import RELAXATION, STATIC, TYRE, sine_experiment, tyre_experiment

from mofit.simulation.integrators import RK4, RODAS4
from mofit.simulation.step_points import step_points
from mofit.simulation.time_grid import StepLevel, build_time_grid, find_switches

NONE = (np.empty(0), np.empty(0))


def test_linear_interpolation_runs_straight_between_samples():
    experiment = sine_experiment(STATIC, 3.0, 30, interpolation="linear")
    middle = (np.arange(29) + 0.5) * experiment.step
    np.testing.assert_allclose(
        experiment.at(middle)[0], 0.5 * (experiment.inputs[1:, 0] + experiment.inputs[:-1, 0]), atol=1e-15
    )
    np.testing.assert_allclose(
        experiment.derivative(middle)[0], np.diff(experiment.inputs[:, 0]) / experiment.step, rtol=1e-9, atol=1e-12
    )


def test_cubic_interpolation_follows_a_smooth_input_between_samples():
    # 4 Hz at 100 Hz: straight lines would be off by (omega h)^2 / 8 = 0.8 %
    experiment = sine_experiment(STATIC, 4.0, 100)
    middle = (np.arange(10, 89) + 0.5) * experiment.step
    np.testing.assert_allclose(experiment.at(middle)[0], np.sin(2 * np.pi * 4.0 * middle), atol=2e-5)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_few_samples_have_a_curve_too(samples):
    for interpolation in ("cubic", "linear"):
        experiment = sine_experiment(STATIC, 1.0, samples, interpolation=interpolation)
        np.testing.assert_allclose(
            experiment.at(np.arange(samples) * experiment.step)[0], experiment.inputs[:, 0], atol=1e-15
        )


def test_switches_are_found_where_the_slip_changes_sign():
    frequency, samples = 1.37, 200
    before, after = find_switches(TYRE, tyre_experiment(frequency, samples))
    crossings = np.arange(1, int(2 * frequency * samples * 0.01) + 1) / (2 * frequency)
    np.testing.assert_allclose(before, crossings, atol=1e-6)
    assert np.all(after >= before)
    assert np.max(after - before) < 1e-12


def test_switches_at_samples_need_no_cut():
    # 1 Hz at 100 Hz crosses zero at samples
    experiment = tyre_experiment(1.0, 200)
    grid = build_time_grid(experiment, StepLevel(RK4, 1), find_switches(TYRE, experiment))
    np.testing.assert_array_equal(grid.counts, 1)


def test_model_without_branches_has_no_switches():
    assert not len(find_switches(RELAXATION, sine_experiment(RELAXATION))[0])


@pytest.mark.parametrize("scheme", [RK4, RODAS4], ids=["RK4", "RODAS4"])
def test_steps_fill_every_interval_and_cross_no_switch(scheme):
    experiment = tyre_experiment(3.3, 60)
    switches = find_switches(TYRE, experiment)
    grid = build_time_grid(experiment, StepLevel(scheme, 3), switches)
    assert len(grid.start) == np.sum(grid.counts)
    assert len(grid.counts) == experiment.samples
    np.testing.assert_allclose(grid.start[1:], grid.end[:-1], atol=1e-12)
    first = np.concatenate([[0], np.cumsum(grid.counts)[:-1]])
    np.testing.assert_allclose(grid.start[first], np.arange(60) * experiment.step, atol=1e-12)
    for before, after in zip(*switches, strict=True):
        assert not np.any((grid.start < before) & (grid.end > after))


def test_implicit_steps_start_small():
    experiment = sine_experiment(RELAXATION)
    grid = build_time_grid(experiment, StepLevel(RODAS4, 2), NONE)
    assert grid.end[0] < 1e-6 * experiment.step
    assert np.all(grid.counts[1:] == 2)


def test_models_that_switch_alike_share_the_points_of_a_test():
    experiment, level = tyre_experiment(3.3, 60), StepLevel(RK4, 2)
    points = step_points(TYRE, experiment, level)
    assert step_points(TYRE, experiment, level) is points
    assert step_points(TYRE, tyre_experiment(3.3, 60), level) is not points
    some = np.array([0, 5, 7])
    ends = points.start[some] + points.length[some]
    expected = [experiment.at(time) for time in (points.start[some], (points.start[some] + ends) / 2, ends)]
    np.testing.assert_allclose(points.inputs_of(experiment, some), np.concatenate(expected), atol=1e-12)
