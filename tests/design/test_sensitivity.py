"""Fisher information against closed forms, finite differences and simulated noise."""

import numpy as np
import pytest
from scipy.linalg import toeplitz

from mofit.data import Experiment
from mofit.data.signals import effective_samples
from mofit.errors import InputError
from mofit.experimental_design.information import information
from mofit.experimental_design.noise_model import ChannelNoise, combined, independent_share, mean_variance
from mofit.experimental_design.planned_tests import planned_data, planned_tests
from mofit.experimental_design.sensitivity import sensitivities
from mofit.models import Channel, Equations, Model, build_system, find_model
from mofit.parameters import Parameter


class Line(Model):
    """F = a x + b."""

    name = "line"
    parameters = (Parameter("a", "N/m", 0.0, 10.0, 2.0), Parameter("b", "N", -5.0, 5.0, 1.0))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": s.a * s.displacement + s.b})


def sine(frequency: float, periods: float, rate: float = 50.0, name: str = "sine") -> Experiment:
    time = np.arange(round(periods / frequency * rate)) / rate
    x = np.sin(2 * np.pi * frequency * time)
    return Experiment(name, "sine", time, {"displacement": x}, {}, frequency, 1.0)


VALUES = np.array([[2.0, 1.0]])


def fisher(tests, values, noise):
    """Fisher information of tests of the line, (N, T, 2, 2), in SI units."""
    planned = planned_tests(Line(), tests, values[0], {"force": noise})
    return np.swapaxes(information(Line(), planned, values, np.ones_like(values)).fisher, 0, 1)


def test_white_noise_gives_the_normal_matrix() -> None:
    test = sine(1.0, 11)  # the first of eleven periods is not used
    found = fisher([test], VALUES, ChannelNoise(sd=0.2))
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1)
    assert found.shape == (1, 1, 2, 2)
    np.testing.assert_allclose(found[0, 0], design.T @ design / 0.2**2, rtol=1e-9, atol=1e-6)


def test_noise_that_grows_with_the_signal_gives_the_weighted_normal_matrix() -> None:
    test = sine(1.0, 11)
    found = fisher([test], VALUES, ChannelNoise(sd=0.1, level=0.2))
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1) / (0.1 + 0.2 * np.abs(2 * x + 1))[:, None]
    np.testing.assert_allclose(found[0, 0], design.T @ design, rtol=1e-9, atol=1e-9)


def test_coloured_noise_gives_the_generalised_least_squares_matrix() -> None:
    test = sine(1.0, 21)
    noise = ChannelNoise(sd=0.1, coloured_sd=0.2, coefficient=0.8)
    found = fisher([test], VALUES, noise)
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1)
    covariance_of_noise = toeplitz(0.2**2 * 0.8 ** np.arange(len(x))) + 0.1**2 * np.eye(len(x))
    exact = design.T @ np.linalg.solve(covariance_of_noise, design)
    np.testing.assert_allclose(found[0, 0], exact, rtol=0.01, atol=0.01 * exact.max())


def test_tests_and_samples_are_independent() -> None:
    tests = [sine(1.0, 5, name="one"), sine(2.0, 9, name="two")]
    samples = np.array([[2.0, 1.0], [3.0, -1.0], [4.0, 0.5]])
    noise = ChannelNoise(sd=0.1, level=0.1)
    both = fisher(tests, samples, noise)
    assert both.shape == (3, 2, 2, 2)
    np.testing.assert_allclose(both[1, 1], fisher(tests[1:], samples[1:2], noise)[0, 0], rtol=1e-12)


def test_sensitivities_of_the_tyre_agree_with_finite_differences() -> None:
    model = find_model("maxwell_tyre")
    time = np.arange(300) / 100
    angle = np.deg2rad(2) * np.sin(2 * np.pi * time)
    conditions = {"longitudinal_velocity": 16.7, "vertical_force": 3600.0, "dynamic_rolling_radius": 0.305}
    test = Experiment("sine", "sine", time, {"slip_angle": angle}, conditions, 1.0, np.deg2rad(2))
    values = np.array([[parameter.nominal for parameter in model.parameters]])
    experiments = planned_data(model, [test], values[0])
    names = ("d_y", "c_M", "d_M", "p_y")
    noises = [[ChannelNoise(sd=5.0)]]
    system = build_system(model)
    (found,) = sensitivities(system, experiments, values, noises, names)
    for place, name in enumerate(names):
        column = system.parameters.index(name)
        step = 1e-4 * abs(values[0, column])
        shifted = np.repeat(values, 2, axis=0)
        shifted[:, column] += (-step, step)
        (pair,) = sensitivities(system, experiments, shifted, noises, names)
        derivative = (pair.outputs[0][1] - pair.outputs[0][0]) / (2 * step)
        np.testing.assert_allclose(found.jacobians[0][0][:, place], derivative, atol=2e-3 * np.abs(derivative).max())


def test_spectral_lines_sum_up_to_the_information() -> None:
    experiments = planned_data(Line(), [sine(1.0, 8)], VALUES[0])
    noise = ChannelNoise(sd=0.1, coloured_sd=0.1)
    (found,) = sensitivities(build_system(Line()), experiments, VALUES, [[noise]], ("a", "b"))
    frequency, lines = found.spectrum()
    np.testing.assert_allclose((lines.conj().T @ lines).real, found.fisher[0], rtol=1e-12)
    assert frequency[np.argmax(np.abs(lines[:, 0]))] == pytest.approx(1.0)
    assert np.argmax(np.abs(lines[:, 1])) == 0


def test_a_missing_channel_is_named() -> None:
    test = Experiment("sine", "sine", np.arange(100) / 10, {"stroke": np.arange(100.0)}, {}, 1.0, 1.0)
    with pytest.raises(InputError, match="displacement"):
        planned_tests(Line(), [test], VALUES[0], {})


def test_noise_counts_as_the_identification_counts_it() -> None:
    noise = ChannelNoise(sd=1.0, coloured_sd=2.0, coefficient=0.9)
    whole = combined(noise(np.zeros(4000), np.ones(4000, dtype=bool)))
    assert mean_variance(whole) == pytest.approx(5.0, rel=1e-3)
    rng = np.random.default_rng(1)
    counted = []
    for _ in range(30):
        bins = np.sqrt(whole.spectrum * 4000 / 2) * (rng.normal(size=2001) + 1j * rng.normal(size=2001))
        counted.append(effective_samples(np.fft.irfft(bins, 4000)) / 4000)
    assert independent_share(whole) == pytest.approx(np.mean(counted), rel=0.05)
    assert independent_share(combined(ChannelNoise(sd=1.0)(np.zeros(4000), np.ones(4000, dtype=bool)))) == 1.0
