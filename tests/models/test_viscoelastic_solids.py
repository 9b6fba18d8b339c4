import numpy as np
import pytest

from mofit.data.dma import sine_tests
from mofit.models import default_model, find_model
from mofit.problem import build_problem

VALUES = {"E_inf": 2e8, "dE": 9e9, "tau": 3.0, "alpha": 0.37, "beta": 0.13, "tau_d": 4e-5}


def modulus(omega, E_inf, dE, tau, alpha, beta, tau_d):
    return (E_inf + dE * (1 - (1 + (1j * omega * tau) ** alpha) ** -beta)) * np.exp(1j * omega * tau_d)


def campaign(values, frequency=(0.1, 1.0, 10.0, 100.0), deviation=1.0):
    own = modulus(2 * np.pi * np.array(frequency), **values)
    return sine_tests(
        np.array(frequency), own.real, own.imag, np.full(len(frequency), deviation), channels=("strain", "stress")
    )


@pytest.mark.parametrize("change", [{}, {"alpha": 1.0, "beta": 1.0}, {"tau": 1e-9, "tau_d": 0.0}])
def test_the_stress_of_a_sine_is_that_of_the_complex_modulus(change):
    values = VALUES | change
    measured = campaign(values)
    problem = build_problem(find_model("havriliak_negami_solid"), measured)
    point = problem.space.to_unit([values[name] for name in problem.space.names])
    simulated = problem.simulate(point[None])
    for own, test in zip(simulated, measured.measurements, strict=True):
        steady = slice(2 * 96, 6 * 96 - 6)  # the spline of the strain is less sure of its rate at the end
        stress = test.channel("stress")[steady]
        assert own[0, steady, 0] == pytest.approx(stress, abs=2e-4 * np.abs(stress).max())


def test_a_campaign_of_strain_and_stress_takes_it():
    assert default_model(["strain", "stress"]).name == "havriliak_negami_solid"
