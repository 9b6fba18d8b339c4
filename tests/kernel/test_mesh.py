"""Inputs between samples, and where steps lie."""

import numpy as np
import pytest
from kernel_models import RELAXATION, STATIC, sine_drive
from test_accuracy import TYRE, tyre_drive

from mofit.kernel.mesh import Rung, build_mesh, find_switches
from mofit.kernel.steps import RK4, RODAS4

NONE = (np.empty(0), np.empty(0))


def test_linear_hold_runs_straight_between_samples():
    drive = sine_drive(STATIC, 3.0, 30, hold="linear")
    middle = (np.arange(29) + 0.5) * drive.step
    np.testing.assert_allclose(drive.at(middle)[0], 0.5 * (drive.inputs[1:, 0] + drive.inputs[:-1, 0]), atol=1e-15)
    np.testing.assert_allclose(drive.slope(middle)[0], np.diff(drive.inputs[:, 0]) / drive.step, rtol=1e-9, atol=1e-12)


def test_cubic_hold_follows_a_smooth_input_between_samples():
    # 4 Hz at 100 Hz: straight lines would be off by (omega h)^2 / 8 = 0.8 %
    drive = sine_drive(STATIC, 4.0, 100)
    middle = (np.arange(10, 89) + 0.5) * drive.step
    np.testing.assert_allclose(drive.at(middle)[0], np.sin(2 * np.pi * 4.0 * middle), atol=2e-5)


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_few_samples_have_a_curve_too(samples):
    for hold in ("cubic", "linear"):
        drive = sine_drive(STATIC, 1.0, samples, hold=hold)
        np.testing.assert_allclose(drive.at(np.arange(samples) * drive.step)[0], drive.inputs[:, 0], atol=1e-15)


def test_switches_are_found_where_the_slip_changes_sign():
    frequency, samples = 1.37, 200
    before, after = find_switches(TYRE, tyre_drive(frequency, samples))
    crossings = np.arange(1, int(2 * frequency * samples * 0.01) + 1) / (2 * frequency)
    np.testing.assert_allclose(before, crossings, atol=1e-6)
    assert np.all(after >= before)
    assert np.max(after - before) < 1e-12


def test_switches_at_samples_need_no_cut():
    # 1 Hz at 100 Hz crosses zero at samples
    drive = tyre_drive(1.0, 200)
    mesh = build_mesh(drive, Rung(RK4, 1), find_switches(TYRE, drive))
    np.testing.assert_array_equal(mesh.counts, 1)


def test_model_without_branches_has_no_switches():
    assert not len(find_switches(RELAXATION, sine_drive(RELAXATION))[0])


@pytest.mark.parametrize("scheme", [RK4, RODAS4], ids=["RK4", "RODAS4"])
def test_steps_fill_every_interval_and_cross_no_switch(scheme):
    drive = tyre_drive(3.3, 60)
    switches = find_switches(TYRE, drive)
    mesh = build_mesh(drive, Rung(scheme, 3), switches)
    assert len(mesh.start) == np.sum(mesh.counts)
    assert len(mesh.counts) == drive.samples
    np.testing.assert_allclose(mesh.start[1:], mesh.end[:-1], atol=1e-12)
    first = np.concatenate([[0], np.cumsum(mesh.counts)[:-1]])
    np.testing.assert_allclose(mesh.start[first], np.arange(60) * drive.step, atol=1e-12)
    for before, after in zip(*switches, strict=True):
        assert not np.any((mesh.start < before) & (mesh.end > after))


def test_implicit_steps_start_small():
    drive = sine_drive(RELAXATION)
    mesh = build_mesh(drive, Rung(RODAS4, 2), NONE)
    assert mesh.end[0] < 1e-6 * drive.step
    assert np.all(mesh.counts[1:] == 2)
