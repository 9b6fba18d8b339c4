"""The adjusted likelihood: on linear problems its width is known exactly."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.data.signals import noise_process
from mofit.problem.curvature_adjustment import Score, adjust, join_scores

COUNT, PERIOD = 1200, 100


def score_of(design, covariance, residual):
    """One test of a linear model with unit weights."""
    return Score(
        slope=-(design.T @ residual)[None],
        normal=(design.T @ design)[None],
        noise=(design.T @ covariance @ design)[None],
        gap=np.zeros((1, design.shape[1], design.shape[1])),
        freedom=np.array([1e9]),
        gap_freedom=1.0,
    )


def design_of(columns=4, count=200):
    phase = 2 * np.pi * np.arange(count) / 50
    return np.stack([np.sin(phase), np.cos(phase), np.sin(3 * phase), np.ones(count)], axis=1)[:, :columns]


def autoregressive(count, coefficient):
    return coefficient ** np.abs(np.arange(count)[:, None] - np.arange(count))


@pytest.mark.parametrize(("freedom", "quantile"), [(2.0, 2.919986), (5.0, 2.015048), (1e9, 1.644854)])
def test_the_normal_of_a_noise_known_from_few_lines_is_as_wide_as_its_t_distribution(freedom, quantile):
    design = design_of()
    known = score_of(design, np.eye(200), np.zeros(200))
    normal = replace(known, freedom=np.array([freedom])).for_a_normal()
    wide, narrow = (adjust(one, np.full(4, 0.5), with_gap=False).precision for one in (normal, known))
    np.testing.assert_allclose(wide, narrow * (1.644854 / quantile) ** 2, rtol=1e-5, atol=1e-9)


def test_width_is_that_of_the_estimate(rng):
    design, covariance = design_of(), autoregressive(200, 0.8)
    centre = np.full(4, 0.5)
    adjustment = adjust(score_of(design, covariance, np.zeros(200)), centre, with_gap=False)
    inverse = np.linalg.inv(design.T @ design)
    expected = inverse @ design.T @ covariance @ design @ inverse
    np.testing.assert_allclose(np.linalg.inv(adjustment.precision), expected, rtol=1e-8, atol=1e-12)
    u = centre + 0.1 * rng.normal(size=(20, 4))

    def squares(points):
        return np.sum(((points - centre) @ design.T) ** 2, axis=1)

    value = adjustment.value(squares(adjustment.mapped(u)), u)
    quadratic = 0.5 * np.einsum("ni,ij,nj->n", u - centre, np.linalg.inv(expected), u - centre)
    np.testing.assert_allclose(value, quadratic, rtol=1e-5)


def test_no_direction_is_stretched():
    design, covariance = design_of(), autoregressive(200, 0.8)
    adjustment = adjust(score_of(design, covariance, np.zeros(200)), np.full(4, 0.5), with_gap=False)
    assert np.linalg.norm(adjustment.map, 2) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(5))
def test_map_moves_the_posterior_least(seed):
    """Symmetric and positive definite, which the optimal transport between Gaussians alone is."""
    rng = np.random.default_rng(seed)
    design = rng.normal(size=(200, 3)) @ np.diag([1.0, 1e-2, 1e-4]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    score = score_of(design, autoregressive(200, 0.8), np.zeros(200))
    adjustment = adjust(score, np.full(3, 0.5), with_gap=False)
    np.testing.assert_allclose(adjustment.map, adjustment.map.T, atol=1e-6)
    assert np.linalg.eigvalsh(adjustment.map)[0] > 0
    curvature = adjustment.scale * adjustment.map @ score.normal[0] @ adjustment.map
    np.testing.assert_allclose(curvature, adjustment.precision, atol=1e-7 * np.abs(curvature).max())


def test_centre_that_a_prior_has_moved(rng):
    """At a point beside the minimum of the squares, the adjusted likelihood still has that minimum."""
    design, covariance = design_of(3), autoregressive(200, 0.6)
    best, centre = np.array([0.5, 0.4, 0.6]), np.array([0.53, 0.38, 0.61])
    adjustment = adjust(score_of(design, covariance, design @ (best - centre)), centre, with_gap=False)

    def value(point):
        squares = np.sum(((adjustment.mapped(point[None]) - best) @ design.T) ** 2, axis=1)
        start = np.sum((design @ (centre - best)) ** 2)
        return adjustment.value(squares - start, point[None])[0]

    slope = [(value(best + step) - value(best - step)) / 2e-5 for step in 1e-5 * np.eye(3)]
    np.testing.assert_allclose(slope, 0, atol=1e-4 * np.abs(adjustment.precision).max())


def test_few_degrees_of_freedom_give_heavy_tails():
    design = design_of(1)
    score = score_of(design, np.eye(200), np.zeros(200))
    few = Score(**{**score.__dict__, "freedom": np.array([4.0])})
    far = np.array([[0.5 + 5 / np.sqrt(100)]])
    values = []
    for one in (score, few):
        adjustment = adjust(one, np.array([0.5]), with_gap=False)
        values.append(adjustment.value(100 * (adjustment.mapped(far)[:, 0] - 0.5) ** 2, far)[0])
    assert values[0] == pytest.approx(12.5, rel=1e-4)
    assert values[1] == pytest.approx(2.5 * np.log1p(25 / 4), rel=1e-4)


def test_scores_of_companions_share_parameters():
    own = score_of(design_of(2), np.eye(200), np.zeros(200))
    spread = own.embedded(np.array([2, 0]), np.array([2.0, 1.0]), 3)
    assert spread.normal[0, 2, 2] == pytest.approx(4 * own.normal[0, 0, 0])
    assert spread.normal[0, 0, 0] == pytest.approx(own.normal[0, 1, 1])
    assert np.all(spread.normal[0, 1] == 0)
    assert join_scores([spread, spread]).normal.shape == (2, 3, 3)


def disturbance(kind, rng, signal):
    white = rng.normal(size=COUNT + 100)
    if kind == "autoregressive":
        return lfilter([0.6], [1, -0.8], white)[100:]
    if kind == "level":
        return white[100:] * np.abs(signal) * np.sqrt(2)
    return white[100:]


@pytest.mark.parametrize(
    "kind", ["white", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("autoregressive", "level"))]
)
def test_scatter_of_the_slope_is_found_from_one_record(kind, rng):
    """Its estimate, averaged over records, is the covariance that many records show."""
    time = 0.01 * np.arange(COUNT)
    phase = 2 * np.pi * np.arange(COUNT) / PERIOD
    signal = np.sin(phase)
    design = np.stack([np.sin(phase), np.cos(phase), np.sin(3 * phase)], axis=1)
    slopes, estimates = [], []
    for _ in range(300):
        noise = disturbance(kind, rng, signal)
        slopes.append(design.T @ noise)
        estimates.append(noise_process(noise + 0.5 * signal, signal, time, 1.0).score_covariance(design))
    seen = np.mean(np.square(slopes), axis=0)
    found = np.mean([np.diag(estimate) for estimate in estimates], axis=0)
    np.testing.assert_allclose(found / seen, 1.0, atol=0.3)  # the share of squares is known to 8 %
    assert np.mean(found / seen) == pytest.approx(1.0, abs=0.15)


def test_spectrum_of_an_autoregressive_process(rng):
    noise = lfilter([1.0], [1, -0.8], rng.normal(size=20_100))[100:]
    process = noise_process(noise, np.zeros_like(noise), 0.01 * np.arange(20_000), None)
    frequency = np.linspace(0, 0.5, len(process.spectrum))
    expected = 1 / np.abs(1 - 0.8 * np.exp(-2j * np.pi * frequency)) ** 2
    inner = slice(200, -200)
    np.testing.assert_allclose(process.spectrum[inner] / expected[inner], 1.0, atol=0.25)
