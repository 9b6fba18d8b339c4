"""What a test tells: against closed forms of a Maxwell branch, and against plain linear algebra."""

import numpy as np
import pytest

from mofit.campaign import Procedure
from mofit.identifiability.criteria import scales
from mofit.identifiability.noise import ChannelNoise
from mofit.identifiability.procedures import planned_drives
from mofit.identifiability.separate import neutral_values, separation
from mofit.identifiability.statistics import precision, statistics
from mofit.kernel import Simulator
from mofit.model import Applied, Channel, Effect, Equations, Model, build_system, with_effects
from mofit.parameters import Parameter, ParameterSpace

C, D, SD = 2e4, 8e3, 3.0


class Branch(Model):
    name = "branch"
    parameters = (Parameter("c", "N/m", 1e3, 6e4, C, "log"), Parameter("d", "N s/m", 500.0, 6e4, D, "log"))
    states = (Channel("inner", "m"),)
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        force = s.quantity("spring_force", s.c * (s.displacement - s.inner))
        return Equations(outputs={"force": force}, rates={"inner": s.c * (s.displacement - s.inner) / s.d})


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
    return Procedure(f"{frequency:g}-{seconds:g}", "sine", time, {"displacement": values}, frequency=frequency)


NOISE = {"force": ChannelNoise(sd=SD)}


def asked(procedures, noise=NOISE, **options):
    space = ParameterSpace(Branch.parameters)
    values = space.nominal[None]
    return statistics(Branch(), procedures, values, scales(space, values), noise, **options)


def test_white_noise_gives_the_fisher_information_of_the_branch():
    r"""Complex stiffness :math:`i \omega c T / (1 + i \omega T)`: its slopes are known."""
    frequency = 0.5
    found = asked([sine(frequency)])
    omega, T = 2 * np.pi * frequency, D / C
    by_c = C * ((1j * omega * T) / (1 + 1j * omega * T) - 1j * omega * T / (1 + 1j * omega * T) ** 2)
    by_d = C * 1j * omega * T / (1 + 1j * omega * T) ** 2
    slopes = 0.01 * np.array([by_c, by_d])
    judged = 18.0 * 100  # a period of 2 s settles
    expected = 0.5 * judged / SD**2 * (slopes[:, None] * slopes.conj()[None, :]).real
    assert found.information[0, 0] == pytest.approx(expected, rel=5e-3, abs=5e-3 * expected.max())
    assert precision(found.values[0])[0] == pytest.approx(found.information[0, 0], rel=1e-6)
    peak = 0.01 * C * omega * T / np.hypot(1, omega * T)
    assert found.peaks[0, 0] == pytest.approx(peak, rel=1e-3)


def test_the_damping_shows_most_where_the_loss_factor_peaks():
    frequencies = np.geomspace(0.05, 5, 21)
    # 400 s, so that every one has many periods
    found = asked([sine(f, 400.0, rate=50.0) for f in frequencies], periods=6)
    best = frequencies[np.argmax(found.information[:, 0, 1, 1])]
    assert best == pytest.approx(C / D / (2 * np.pi), rel=0.15)


def test_few_periods_stand_for_many():
    tests = [sine(0.5, 60.0), sine(1.3, 60.0), sine(0.07, 60.0)]
    coloured = {"force": ChannelNoise(sd=SD, coloured_sd=2 * SD, coefficient=0.95)}
    whole = asked(tests, coloured)
    short = asked(tests, coloured, periods=8)
    exact, quick = precision(whole.values)[:, 0], precision(short.values)[:, 0]
    size = np.sqrt(np.diagonal(exact, axis1=1, axis2=2))
    np.testing.assert_allclose(quick / (size[:, :, None] * size[:, None, :]),
                               exact / (size[:, :, None] * size[:, None, :]), atol=0.08)  # fmt: skip
    np.testing.assert_array_equal(short.values[2], whole.values[2])


def test_alike_tests_of_other_lengths_are_simulated_once(monkeypatch):
    import mofit.identifiability.statistics as module

    seen = []
    original = module.planned_drives

    def spy(model, procedures, *rest, **options):
        seen.append(len(procedures))
        return original(model, procedures, *rest, **options)

    monkeypatch.setattr(module, "planned_drives", spy)
    found = asked([sine(0.5, 40.0), sine(0.5, 80.0)], periods=8)
    assert seen == [1]
    assert found.information[1] == pytest.approx(found.information[0] * 78 / 38)


def test_estimates_lose_by_colour_what_whitening_would_save():
    """A chirp through coloured noise: least squares scatter more than the bound, never less."""
    time = np.arange(0, 40, 0.01)
    values = 0.01 * np.sin(2 * np.pi * 0.1 * 40 / np.log(50) * np.expm1(time / 40 * np.log(50)))
    chirp = Procedure("chirp", "chirp", time, {"displacement": values})
    coloured = {"force": ChannelNoise(sd=0.3 * SD, coloured_sd=3 * SD, coefficient=0.99)}
    found = asked([chirp], coloured)
    estimate, bound = np.linalg.inv(precision(found.values[0])[0]), np.linalg.inv(found.information[0, 0])
    assert np.all(np.linalg.eigvalsh(estimate - bound) > -1e-6 * np.linalg.norm(bound))
    assert estimate[1, 1] > 1.1 * bound[1, 1]


def test_separation_is_what_a_projection_leaves():
    procedures = [sine(0.5), sine(2.0)]
    effects = [Cubic(), Progressive()]
    prior = np.diag([1 / 200.0**2, 1 / 400.0**2])
    found = separation(Branch(), effects, procedures, {}, NOISE, precision=prior)
    model = with_effects(Branch(), *effects)
    point = neutral_values(Branch(), effects, {})
    values = np.array([[point[parameter.name] for parameter in model.parameters]])
    for number, procedure in enumerate(procedures):
        (drive,) = planned_drives(model, [procedure], values[0])
        _, slopes = Simulator(build_system(model), [drive], tolerance=1e-8).sensitivities(values)[0]
        S = slopes[0, drive.weights[:, 0] > 0, 0] / SD
        J = np.concatenate([S[:, :2], np.zeros((2, 2))])
        J[-2:] = np.sqrt(prior)
        sides = [np.append(S[:, 2] * 1e7, [0, 0]), np.append(S[:, 3] * 1e5, [0, 0])]
        for k in range(2):
            for other in range(2):
                basis = J if k == other else np.column_stack([J, sides[other]])
                left = sides[k] - basis @ np.linalg.lstsq(basis, sides[k], rcond=None)[0]
                assert found[number, k, other] == pytest.approx(left @ left, rel=1e-3)
    # a rival can only take away
    assert np.all(found[:, 0, 1] <= found[:, 0, 0] * (1 + 1e-9))
    # twice the size, four times the noncentrality
    double = separation(Branch(), effects, procedures, {}, NOISE, precision=prior, size={"k": 2e7})
    assert double[:, 0, 1] == pytest.approx(4 * found[:, 0, 1])
