"""Information of tests: against closed forms of a Maxwell branch, and against plain linear algebra."""

import numpy as np
import pytest

from mofit.data import Experiment
from mofit.experimental_design.criteria import box_precision, discrimination, scales, with_neutral
from mofit.experimental_design.information import candidate_information, estimator_precision
from mofit.experimental_design.noise_model import ChannelNoise
from mofit.experimental_design.planned_tests import planned_data
from mofit.models import Applied, Channel, Effect, Equations, Model, build_system, with_effects
from mofit.parameters import Parameter, ParameterSpace
from mofit.simulation import Simulator

C, D, SD = 2e4, 8e3, 3.0


class Branch(Model):
    name = "branch"
    parameters = (Parameter("c", "N/m", 1e3, 6e4, C, "log"), Parameter("d", "N s/m", 500.0, 6e4, D, "log"))
    states = (Channel("inner", "m"),)
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        force = s.quantity("spring_force", s.c * (s.displacement - s.inner))
        return Equations(outputs={"force": force}, derivatives={"inner": s.c * (s.displacement - s.inner) / s.d})


class Cubic(Effect):
    name, on = "cubic", ("spring_force",)
    parameters = (Parameter("k", "N/m^3", -1e9, 1e9, 1e7, neutral=0.0),)

    def apply(self, s, value):
        return Applied(value + s.k * s.displacement**3)


class Progressive(Effect):
    name, on = "progressive", ("spring_force",)
    parameters = (Parameter("h", "N/m^2", -1e9, 1e9, 1e5, neutral=0.0),)

    def apply(self, s, value):
        return Applied(value + s.h * s.displacement**2)


def sine(frequency, seconds=20.0, amplitude=0.01, rate=100.0):
    time = np.arange(round(seconds * rate)) / rate
    values = amplitude * np.sin(2 * np.pi * frequency * time)
    return Experiment(f"{frequency:g}-{seconds:g}", "sine", time, {"displacement": values}, frequency=frequency)


NOISE = {"force": ChannelNoise(sd=SD)}


def information_of(experiments, noise=NOISE, effects=(), **options):
    model = with_effects(Branch(), *effects)
    space = ParameterSpace(model.parameters)
    values = with_neutral(space, space.nominal, effects)[None]
    return candidate_information(model, experiments, values, scales(space, values), noise, tolerance=1e-6, **options)


def test_white_noise_gives_the_fisher_information_of_the_branch():
    r"""Complex stiffness :math:`i \omega c T / (1 + i \omega T)`: its derivatives are known."""
    frequency = 0.5
    found = information_of([sine(frequency)])
    omega, T = 2 * np.pi * frequency, D / C
    by_c = C * ((1j * omega * T) / (1 + 1j * omega * T) - 1j * omega * T / (1 + 1j * omega * T) ** 2)
    by_d = C * 1j * omega * T / (1 + 1j * omega * T) ** 2
    jacobian = 0.01 * np.array([by_c, by_d])
    used = 18.0 * 100  # a period of 2 s settles
    expected = 0.5 * used / SD**2 * (jacobian[:, None] * jacobian.conj()[None, :]).real
    assert found.fisher[0, 0] == pytest.approx(expected, rel=5e-3, abs=5e-3 * expected.max())
    assert estimator_precision(found.estimator[0])[0] == pytest.approx(found.fisher[0, 0], rel=1e-6)
    peak = 0.01 * C * omega * T / np.hypot(1, omega * T)
    assert found.peaks[0, 0] == pytest.approx(peak, rel=1e-3)


def test_the_damping_shows_most_where_the_loss_factor_peaks():
    frequencies = np.geomspace(0.05, 5, 21)
    # 400 s, so that every one has many periods
    found = information_of([sine(f, 400.0, rate=50.0) for f in frequencies], periods=6)
    best = frequencies[np.argmax(found.fisher[:, 0, 1, 1])]
    assert best == pytest.approx(C / D / (2 * np.pi), rel=0.15)


def test_few_periods_stand_for_many():
    tests = [sine(0.5, 60.0), sine(1.3, 60.0), sine(0.07, 60.0)]
    coloured = {"force": ChannelNoise(sd=SD, coloured_sd=2 * SD, coefficient=0.95)}
    whole = information_of(tests, coloured)
    short = information_of(tests, coloured, periods=8)
    exact, quick = estimator_precision(whole.estimator)[:, 0], estimator_precision(short.estimator)[:, 0]
    size = np.sqrt(np.diagonal(exact, axis1=1, axis2=2))
    np.testing.assert_allclose(quick / (size[:, :, None] * size[:, None, :]),
                               exact / (size[:, :, None] * size[:, None, :]), atol=0.08)  # fmt: skip
    np.testing.assert_array_equal(short.estimator[2], whole.estimator[2])


def test_information_grows_with_the_periods_of_alike_tests():
    found = information_of([sine(0.5, 40.0), sine(0.5, 80.0)], periods=8)
    np.testing.assert_allclose(found.fisher[1], found.fisher[0] * 78 / 38, rtol=1e-12)


def test_estimates_lose_by_colour_what_whitening_would_save():
    """A chirp through coloured noise: least squares scatter more than the bound, never less."""
    time = np.arange(0, 40, 0.01)
    values = 0.01 * np.sin(2 * np.pi * 0.1 * 40 / np.log(50) * np.expm1(time / 40 * np.log(50)))
    chirp = Experiment("chirp", "chirp", time, {"displacement": values})
    coloured = {"force": ChannelNoise(sd=0.3 * SD, coloured_sd=3 * SD, coefficient=0.99)}
    found = information_of([chirp], coloured)
    estimate, bound = np.linalg.inv(estimator_precision(found.estimator[0])[0]), np.linalg.inv(found.fisher[0, 0])
    assert np.all(np.linalg.eigvalsh(estimate - bound) > -1e-6 * np.linalg.norm(bound))
    assert estimate[1, 1] > 1.1 * bound[1, 1]


def test_noncentrality_is_what_a_projection_leaves():
    effects = [Cubic(), Progressive()]
    model = with_effects(Branch(), *effects)
    space = ParameterSpace(model.parameters)
    values = with_neutral(space, space.nominal, effects)[None]
    assert values[0].tolist() == [C, D, 0.0, 0.0]
    tests = [sine(0.5), sine(2.0)]
    found = discrimination(space, values, effects).noncentrality(information_of(tests, effects=effects).fisher)[:, 0]
    prior = np.diag(np.sqrt(np.diag(box_precision(space, values)[0])) / scales(space, values)[0])[:2, :2]
    for number, test in enumerate(tests):
        (data,) = planned_data(model, [test], values[0])
        _, jacobian = Simulator(build_system(model), [data], tolerance=1e-8).sensitivities(values)[0]
        S = jacobian[0, data.weights[:, 0] > 0, 0] / SD
        J = np.concatenate([S[:, :2], prior])
        sides = [np.append(S[:, 2] * 1e7, [0, 0]), np.append(S[:, 3] * 1e5, [0, 0])]
        for k in range(2):
            basis = np.column_stack([J, sides[1 - k]])
            left = sides[k] - basis @ np.linalg.lstsq(basis, sides[k], rcond=None)[0]
            assert found[number, k] == pytest.approx(left @ left, rel=1e-3)
    # a competing effect can only explain more
    alone = discrimination(ParameterSpace(with_effects(Branch(), Cubic()).parameters), values[:, :3], [Cubic()])
    assert np.all(
        found[:, 0] <= alone.noncentrality(information_of(tests, effects=[Cubic()]).fisher)[:, 0, 0] * (1 + 1e-9)
    )
