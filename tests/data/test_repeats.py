"""Records of the same test: recognised, and what differs between them is the noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mofit.data import Campaign, Experiment, Measurement
from mofit.data.repeats import noise_of_repeats, repeated
from mofit.identification.findings import misfit
from mofit.models import find_model
from mofit.problem import build_problem

RATE = 200.0


def stroke(seed: int, count: int = 2000) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=count)
    for _ in range(3):  # smooth, so that its velocity is known
        white = lfilter([0.1], [1.0, -0.9], white)
    return 0.01 * white


def record(name: str, x: np.ndarray, force: np.ndarray, **conditions: float) -> Measurement:
    experiment = Experiment(name, "free", np.arange(len(x)) / RATE, {"displacement": x}, dict(conditions))
    return Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"})


def coloured(rng: np.random.Generator, count: int, sd: float) -> np.ndarray:
    return sd * np.sqrt(1 - 0.8**2) * lfilter([1.0], [1.0, -0.8], rng.normal(size=count))


def test_tests_driven_alike_are_repeats_others_are_not():
    rng, x = np.random.default_rng(0), stroke(1)

    def force(sd: float = 0.01) -> np.ndarray:
        return x + coloured(rng, len(x), sd * np.ptp(x))

    one = record("a", x, force())
    noisy = x + 3e-3 * np.std(x) * rng.normal(size=len(x))
    late, larger = np.roll(x, 1), 1.02 * x
    others = [
        record("b", x, force()), record("c", noisy, force()), record("d", late, force()), record("e", larger, force()),
        record("f", stroke(2), force()), record("g", x, force(), vertical_force=3e3),
        record("h", x[:-1], force()[:-1]),
    ]  # fmt: skip
    assert repeated([one, *others]) == [[0, 1, 2]]
    assert repeated(others[2:]) == []


def test_specimens_and_copies_that_are_driven_alike_are_no_repeats():
    rng, x = np.random.default_rng(0), stroke(1)
    noise = [coloured(rng, len(x), 0.002 * np.ptp(x)) for _ in range(2)]
    slow = 0.01 * np.ptp(x) * np.linspace(-1, 1, len(x)) ** 2
    one = record("a", x, x + noise[0])
    assert repeated([one, record("b", x, x + noise[1])]) == [[0, 1]]
    assert repeated([one, record("stiffer", x, 1.03 * x + noise[1])]) == []
    assert repeated([one, record("drifting", x, x + noise[0] + slow)]) == []
    assert repeated([one, record("copy", x, x + noise[0])]) == []


@pytest.mark.parametrize("count", [2, 3, 8])
def test_noise_of_repeats_is_that_of_the_records_whatever_its_colour_and_their_offsets(count):
    rng, signal = np.random.default_rng(count), 100 * stroke(1, 20000)
    records = [signal + 5.0 * k + coloured(rng, 20000, 0.3) for k in range(count)]
    assert noise_of_repeats(records) == pytest.approx(0.3, rel=0.05)


def campaign(seed: int, gap: float, repeats: int = 2) -> Campaign:
    """A spring of 1e4 N/m and a damper, with coloured noise and a wavy force that is not in the model."""
    rng, x = np.random.default_rng(seed), stroke(1)
    v = np.gradient(x, 1 / RATE)
    clean = 1e4 * x + 50 * v + gap * np.ptp(1e4 * x) * np.sin(8 * x / np.max(np.abs(x)))
    sd = 0.01 * np.ptp(clean)
    tests = tuple(record(f"t{k}", x, clean + coloured(rng, len(x), sd)) for k in range(repeats))
    return Campaign("repeats", "simulated", {}, tests)


def test_repeats_tell_a_gap_from_coloured_noise():
    model = find_model("kelvin_voigt_damper")
    for gap, said in ((0.0, False), (0.1, True)):
        problem = build_problem(model, campaign(3, gap))
        assert {signal.noise_method for signal in problem.signals} == {"repeated records"}
        np.testing.assert_allclose(problem.noise.floor, 0.01, rtol=0.1)
        u = problem.space.to_unit(problem.space.nominal)
        for _ in range(30):  # Gauss-Newton
            _, gradient, hessian = problem.squares_terms(u[None])
            u = np.clip(u - np.linalg.solve(hessian[0], gradient[0]), 0, 1)
        problem = problem.with_noise_at(u)
        found = misfit(problem, problem.objectives(u[None])[0])
        assert ["does not fit" in one.text for one in found] == [True] * said  # else not a word, white or not
        # alone, a record cannot tell: its noise from sample to sample is far smaller than the noise
        alone = build_problem(model, replace(campaign(3, gap), measurements=campaign(3, gap).measurements[:1]))
        assert not alone.signals[0].repeats


def test_a_gap_is_not_averaged_out_by_repeats_and_noise_is():
    model = find_model("kelvin_voigt_damper")
    scores = {}
    for gap in (0.0, 0.5):
        data = campaign(5, gap, repeats=4)
        for tests in (1, 4):
            problem = build_problem(model, replace(data, measurements=data.measurements[:tests]))
            u = problem.space.to_unit(np.array([{"c": 1e4, "d": 50.0}.get(n, 0.0) for n in problem.space.names]))
            noise = problem.score(u).noise.sum(axis=0)
            scores[gap, tests] = np.sqrt(np.diag(noise))
    np.testing.assert_allclose(scores[0.0, 4], 2 * scores[0.0, 1], rtol=0.5)
    np.testing.assert_allclose(scores[0.5, 4], 4 * scores[0.5, 1], rtol=0.35)
