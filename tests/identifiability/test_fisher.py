"""Fisher information against closed forms, finite differences and simulated noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import toeplitz

from mofit.campaign import Procedure
from mofit.errors import InputError
from mofit.identifiability.fisher import covariance, sensitivities, test_information
from mofit.identifiability.noise import ChannelNoise, independent_share, power, together
from mofit.identifiability.procedures import planned_drives
from mofit.library import find_model
from mofit.model import Channel, Equations, Model, build_system
from mofit.objectives import effective_samples
from mofit.parameters import Parameter


class Line(Model):
    """F = a x + b."""

    name = "line"
    parameters = (Parameter("a", "N/m", 0.0, 10.0, 2.0), Parameter("b", "N", -5.0, 5.0, 1.0))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": s.a * s.displacement + s.b})


def sine(frequency: float, periods: float, rate: float = 50.0, name: str = "sine") -> Procedure:
    time = np.arange(round(periods / frequency * rate)) / rate
    x = np.sin(2 * np.pi * frequency * time)
    return Procedure(name, "sine", time, {"displacement": x}, {}, frequency, 1.0)


VALUES = np.array([[2.0, 1.0]])


def test_white_noise_gives_the_normal_matrix() -> None:
    test = sine(1.0, 11)  # the first of eleven periods is not judged
    found = test_information(Line(), [test], VALUES, {"force": ChannelNoise(sd=0.2)}, ("a", "b"))
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1)
    assert found.shape == (1, 1, 2, 2)
    np.testing.assert_allclose(found[0, 0], design.T @ design / 0.2**2, rtol=1e-9, atol=1e-6)


def test_noise_that_grows_with_the_signal_gives_the_weighted_normal_matrix() -> None:
    test = sine(1.0, 11)
    found = test_information(Line(), [test], VALUES, {"force": ChannelNoise(sd=0.1, level=0.2)}, ("a", "b"))
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1) / (0.1 + 0.2 * np.abs(2 * x + 1))[:, None]
    np.testing.assert_allclose(found[0, 0], design.T @ design, rtol=1e-9, atol=1e-9)


def test_coloured_noise_gives_the_generalised_least_squares_matrix() -> None:
    test = sine(1.0, 21)
    noise = ChannelNoise(sd=0.1, coloured_sd=0.2, coefficient=0.8)
    found = test_information(Line(), [test], VALUES, {"force": noise}, ("a", "b"))
    x = test.inputs["displacement"][50:]
    design = np.stack([x, np.ones_like(x)], axis=1)
    covariance_of_noise = toeplitz(0.2**2 * 0.8 ** np.arange(len(x))) + 0.1**2 * np.eye(len(x))
    exact = design.T @ np.linalg.solve(covariance_of_noise, design)
    np.testing.assert_allclose(found[0, 0], exact, rtol=0.01, atol=0.01 * exact.max())


def test_names_choose_and_order_parameters_and_points_are_batched() -> None:
    tests = [sine(1.0, 5, name="one"), sine(2.0, 9, name="two")]
    points = np.array([[2.0, 1.0], [3.0, -1.0], [4.0, 0.5]])
    noise = {"force": ChannelNoise(sd=0.1, level=0.1)}
    both = test_information(Line(), tests, points, noise, ("b", "a"))
    assert both.shape == (3, 2, 2, 2)
    alone = test_information(Line(), tests[1:], points[1:2], noise, ("a", "b"))
    np.testing.assert_allclose(both[1, 1][::-1, ::-1], alone[0, 0], rtol=1e-12)


def test_sensitivities_of_the_tyre_agree_with_finite_differences() -> None:
    model = find_model("maxwell_tyre")
    time = np.arange(300) / 100
    angle = np.deg2rad(2) * np.sin(2 * np.pi * time)
    conditions = {"longitudinal_velocity": 16.7, "vertical_force": 3600.0, "dynamic_rolling_radius": 0.305}
    test = Procedure("sine", "sine", time, {"slip_angle": angle}, conditions, 1.0, np.deg2rad(2))
    values = np.array([[parameter.nominal for parameter in model.parameters]])
    drives = planned_drives(model, [test], values[0])
    names = ("d_y", "c_M", "d_M", "p_y")
    noises = [[ChannelNoise(sd=5.0)]]
    system = build_system(model)
    (found,) = sensitivities(system, drives, values, noises, names)
    for place, name in enumerate(names):
        column = system.parameters.index(name)
        step = 1e-4 * abs(values[0, column])
        shifted = np.repeat(values, 2, axis=0)
        shifted[:, column] += (-step, step)
        (pair,) = sensitivities(system, drives, shifted, noises, names)
        slope = (pair.outputs[0][1] - pair.outputs[0][0]) / (2 * step)
        np.testing.assert_allclose(found.slopes[0][0][:, place], slope, atol=2e-3 * np.abs(slope).max())


def test_lines_sum_up_to_the_information() -> None:
    drives = planned_drives(Line(), [sine(1.0, 8)], VALUES[0])
    noise = ChannelNoise(sd=0.1, coloured_sd=0.1)
    (found,) = sensitivities(build_system(Line()), drives, VALUES, [[noise]], ("a", "b"))
    frequency, lines = found.lines()
    np.testing.assert_allclose((lines.conj().T @ lines).real, found.information[0], rtol=1e-12)
    assert frequency[np.argmax(np.abs(lines[:, 0]))] == pytest.approx(1.0)
    assert np.argmax(np.abs(lines[:, 1])) == 0


def test_a_missing_channel_is_named() -> None:
    test = Procedure("sine", "sine", np.arange(100) / 10, {"stroke": np.arange(100.0)}, {}, 1.0, 1.0)
    with pytest.raises(InputError, match="displacement"):
        test_information(Line(), [test], VALUES, {}, ("a",))


def test_noise_counts_as_the_identification_counts_it() -> None:
    noise = ChannelNoise(sd=1.0, coloured_sd=2.0, coefficient=0.9)
    whole = together(noise(np.zeros(4000), np.ones(4000, dtype=bool)))
    assert power(whole) == pytest.approx(5.0, rel=1e-3)
    rng = np.random.default_rng(1)
    counted = []
    for _ in range(30):
        bins = np.sqrt(whole.spectrum * 4000 / 2) * (rng.normal(size=2001) + 1j * rng.normal(size=2001))
        counted.append(effective_samples(np.fft.irfft(bins, 4000)) / 4000)
    assert independent_share(whole) == pytest.approx(np.mean(counted), rel=0.05)
    assert independent_share(together(ChannelNoise(sd=1.0)(np.zeros(4000), np.ones(4000, dtype=bool)))) == 1.0


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
@settings(max_examples=30, deadline=None)
def test_covariance_is_the_inverse_in_any_units(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size + 3, size))
    units = 10.0 ** rng.uniform(-6, 6, size)
    matrix = root.T @ root
    found = covariance(matrix * units[:, None] * units)
    np.testing.assert_allclose(found * units[:, None] * units, np.linalg.inv(matrix), rtol=1e-6, atol=1e-9)


def test_flat_directions_are_infinite_and_leave_the_rest_alone() -> None:
    pair = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 4.0]])  # only the sum of the first two is known
    found = covariance(np.stack([pair, np.diag([1.0, 0.0, 1e-9]), np.full((3, 3), np.nan)]))
    np.testing.assert_array_equal(np.diag(found[0]), [np.inf, np.inf, 0.25])
    np.testing.assert_allclose(np.diag(found[1]), [1.0, np.inf, 1e9])
    assert np.isnan(found[2]).all()
    closed = covariance(pair, np.diag([0.0, 1e-2, 0.0]))
    np.testing.assert_allclose(np.diag(closed), [101.0, 100.0, 0.25])
