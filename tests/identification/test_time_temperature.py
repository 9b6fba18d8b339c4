"""A solid at several temperatures, none of which determines its spectrum alone: its shift factors are recovered."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign
from mofit.data.dma import sine_tests
from mofit.identification.conditions import study_conditions
from mofit.identification.settings import Settings
from mofit.models import find_model

VALUES = {"E_inf": 2e8, "dE": 9e9, "alpha": 0.4, "beta": 0.2}
C1, C2, REFERENCE = 15.0, 60.0, 350.0
FREQUENCIES, TEMPERATURES = np.geomspace(0.1, 100, 4), np.arange(330.0, 391.0, 15.0)
LAWS = {"tau": "wlf,arrhenius,free", "others": "shared"}


def wlf(temperature):
    return -2 - C1 * (temperature - REFERENCE) / (C2 + temperature - REFERENCE)


def arrhenius(temperature):
    return -2 + 20e3 * (1 / temperature - 1 / REFERENCE)


def solid(log_tau) -> Campaign:
    """Moduli with 1 % of noise."""
    rng, found, omega = np.random.default_rng(0), [], 2 * np.pi * FREQUENCIES
    for temperature in TEMPERATURES:
        power = (1j * omega * 10 ** log_tau(temperature)) ** VALUES["alpha"]
        modulus = VALUES["E_inf"] + VALUES["dE"] * (1 - (1 + power) ** -VALUES["beta"])
        sd = 0.01 * np.abs(modulus)
        storage, loss = modulus.real + sd * rng.normal(size=4), modulus.imag + sd * rng.normal(size=4)
        names = [f"{temperature:g}K_{one:.3g}Hz" for one in FREQUENCIES]
        own = sine_tests(FREQUENCIES, storage, loss, sd, channels=("strain", "stress"), names=names, seed=len(found))
        found += [
            replace(one, experiment=replace(one.experiment, conditions={"temperature": temperature}))
            for one in own.measurements
        ]
    return Campaign("solid", "simulated", {}, tuple(found))


def settings() -> Settings:
    return Settings(
        over=("temperature",), laws=LAWS, fixed={"tau_d": 0.0}, sample=False, jobs=1, evaluations=400, seed=0
    )


@pytest.mark.slow
@pytest.mark.parametrize(("law", "form"), [(wlf, "wlf"), (arrhenius, "arrhenius")])
def test_the_evidence_finds_the_law_of_the_shift_factor(law, form):
    study = study_conditions(solid(law), find_model("havriliak_negami_solid"), settings())
    assert study.fit.forms["tau", "temperature"] == form
    k = [one.name for one in study.cells.parameters].index("tau")
    assert np.log10(study.cells.values[:, k]) == pytest.approx(law(study.cells.at[:, 0]), abs=0.5)
    assert study.fit.chi_square < 15  # of the five temperatures
    centre, half = 360.0, 30.0
    if form == "wlf":  # with the constants at the middle of the range
        at_centre = C2 + centre - REFERENCE
        assert study.fit.values["tau_temperature_2"] == pytest.approx(half / at_centre, rel=0.1)
        slope = -half * np.log(10) * C1 * C2 / at_centre**2
        assert study.fit.values["tau_temperature"] == pytest.approx(slope, rel=0.1)
    else:
        assert study.fit.values["tau_temperature"] == pytest.approx(20e3 * np.log(10), rel=0.05)
