"""Sine tests made from dynamic moduli."""

import numpy as np
import pytest

from mofit.data.dma import sine_tests
from mofit.diagnosis.baseline import fit_baseline, set_up
from mofit.diagnosis.residual_tests import residual_tests
from mofit.identification.settings import Settings
from mofit.models import find_model

FREQUENCY = np.array([0.2, 1.0, 5.0, 25.0])
SPRING, BRANCH, TIME = 2e4, 5e4, 0.05


def moduli():
    """Of a spring beside one Maxwell branch."""
    w = 2j * np.pi * FREQUENCY * TIME
    stiffness = SPRING + BRANCH * w / (1 + w)
    return stiffness.real, stiffness.imag


def test_the_steady_force_has_the_moduli():
    storage, loss = moduli()
    campaign = sine_tests(FREQUENCY, storage, loss, 0.01 * storage)
    for f, k1, k2, measurement in zip(FREQUENCY, storage, loss, campaign.measurements, strict=True):
        steady = measurement.time >= measurement.experiment.transient - 1e-9
        phase = 2 * np.pi * f * measurement.time[steady]
        design = np.column_stack([np.sin(phase), np.cos(phase)])
        found = np.linalg.lstsq(design, measurement.channel("force")[steady], rcond=None)[0]
        assert found / 1e-3 == pytest.approx([k1, k2], rel=1e-9)
        assert measurement.channel("displacement")[steady] == pytest.approx(1e-3 * np.sin(phase), abs=1e-12)


def test_noise_gives_a_modulus_its_standard_deviation():
    storage, loss = moduli()
    (record,) = sine_tests(FREQUENCY[:1], storage[:1], loss[:1], np.array([500.0])).measurements
    clean = sine_tests(FREQUENCY[:1], storage[:1], loss[:1], np.array([0.0])).measurements[0]
    noise = (record.channel("force") - clean.channel("force"))[record.time >= record.experiment.transient - 1e-9]
    # of an amplitude of white noise over n samples: sd sqrt(2 / n)
    assert np.std(noise) * np.sqrt(2 / len(noise)) == pytest.approx(500.0 * 1e-3, rel=0.15)


def test_one_branch_explains_its_own_moduli():
    """The start of the records makes no gap, from an eighth of the relaxation time's frequency to eight times that."""
    storage, loss = moduli()
    settings = Settings(jobs=1, fixed={"d": 0.0, "p": 0.0, "F_0": 0.0}, bounds={"c": (0.0, 1e5)})
    campaign = sine_tests(FREQUENCY, storage, loss, 0.002 * storage)
    fitted = fit_baseline(*set_up(find_model("maxwell_damper"), campaign, settings), 0)
    assert residual_tests(fitted).p_value > 0.05
    assert fitted.values["c"] == pytest.approx(SPRING, rel=0.01)
    assert fitted.values["d_M"] / fitted.values["c_M"] == pytest.approx(TIME, rel=0.02)
