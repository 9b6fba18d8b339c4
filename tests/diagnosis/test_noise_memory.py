"""Records and calibration stages under 1/f noise: what they tell of it together, and how certain levels are then."""

from dataclasses import replace

import numpy as np
import pytest
from long_memory import long_memory
from straight_line import NOISE, StraightLine, sine_test

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.whitened_data import whiten
from mofit.identification.calibration import calibrate, summed_memory
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.parameters import ParameterSpace
from mofit.problem import build_problem

CONDITIONS = {"vertical_force": 3600.0, "longitudinal_velocity": 16.7, "dynamic_rolling_radius": 0.3}
SPRING = {"c_y": 1.2e5, "p_y": -7.0}


def sines(noises: np.ndarray) -> Campaign:
    """Sines through a straight line with noise (tests, samples)."""
    clean = sine_test(noise=0.0)
    tests = [
        replace(clean, experiment=replace(clean.experiment, name=f"sine_{k}"),
                outputs={"force": clean.outputs["force"] + NOISE * noise})
        for k, noise in enumerate(noises)
    ]  # fmt: skip
    return Campaign("sines", "simulated", {}, tuple(tests))


def levels(noises: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whitened constants of the noise of every record: by what it tells alone, and by what all tell."""
    observed = whiten(build_problem(StraightLine(), sines(noises)))
    alone, together = [], []
    for (_, _, w), noise in zip(observed.records, noises, strict=True):
        column = NOISE * noise[:, None]
        alone.append(replace(w, process=w.process.beside(0.0)).rows(column)[0, 0])
        together.append(w.rows(column)[0, 0])
    return np.array(alone), np.array(together)


def test_levels_of_records_are_as_certain_as_said() -> None:
    rng = np.random.default_rng(4)
    campaigns = [levels(np.stack([long_memory(rng, 1000) for _ in range(5)])) for _ in range(8)]
    alone, together = (np.concatenate(several) for several in zip(*campaigns, strict=True))
    assert np.max(np.abs(together)) < 3.5 < np.max(np.abs(alone))
    assert 0.3 < np.mean(together**2) < 1.4  # the noise began some records before: its level is no larger


def test_levels_under_white_noise_stay_as_certain() -> None:
    alone, together = levels(np.random.default_rng(5).standard_normal((12, 1000)))
    np.testing.assert_allclose(together, alone, rtol=0.15)
    assert np.mean(together**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 12))


def tyre(noise: float, seed: int) -> Campaign:
    """Three tests of a standing tyre, and one sine of a rolling one to identify, with 1/f noise [N]."""
    rng = np.random.default_rng(seed)
    time = np.arange(400) * 0.1
    stroke = np.interp(np.arange(400), 400 * np.array([0, 0.25, 0.75, 1.0]), 0.02 * np.array([0.0, 1.0, -1.0, 0.0]))
    spring = SPRING["c_y"] * (1 + SPRING["p_y"] * np.abs(stroke)) * stroke
    units = {"lateral_displacement": "m", "lateral_force": "N"}
    tests = [
        Measurement(
            Experiment(f"spring_{k}", "quasi_static", time, {"lateral_displacement": stroke}, {}, amplitude=0.02),
            {"lateral_force": spring + noise * long_memory(rng, 400)},
            units,
        )
        for k in range(3)
    ]
    time = np.arange(1000) * 0.01
    angle = 0.05 * np.sin(2 * np.pi * time)
    force = 3e3 * np.sin(2 * np.pi * time - 0.5) + noise * long_memory(rng, 1000)
    rolling = Experiment("rolling", "sine", time, {"slip_angle": angle}, {}, 1.0, 0.05)
    tests.append(Measurement(rolling, {"lateral_force": force}, {"slip_angle": "rad", "lateral_force": "N"}))
    return Campaign("tyre", "simulated", CONDITIONS, tuple(tests))


def test_estimates_of_a_stage_are_as_certain_as_said() -> None:
    """Distances of the estimates from the truth, in standard deviations; chi-square with two degrees of freedom."""
    model, squares = find_model("maxwell_tyre"), []
    space = ParameterSpace(model.parameters)
    for seed in range(6):
        (found,), _ = calibrate(model, tyre(10.0, seed), space, seed=0, jobs=1)
        own = found.problem.space
        error = found.minimum - own.to_unit([SPRING[name] for name in own.names])
        squares.append(error @ found.hessian @ error)
    assert np.max(squares) < 14  # one of a thousand is larger
    assert 0.4 < np.median(squares) < 3.5


def test_stages_and_records_share_what_they_tell() -> None:
    setup = set_up_problem(find_model("maxwell_tyre"), tyre(10.0, 1), Settings(jobs=1))
    problem = setup.posterior.main
    observed = whiten(problem, setup.calibrations)
    (stage,), (_, _, w) = observed.calibrations, observed.records[0]
    together = summed_memory([stage])["lateral_force"] + w.process.memory
    np.testing.assert_allclose(stage.problem.noise.memory + stage.memory, np.tile(together, (3, 1)))
    np.testing.assert_array_equal(w.process.spectrum, w.process.beside(together - w.process.memory).spectrum)
    # the problem's prior is that of the stage, and whitening once more changes nothing
    np.testing.assert_allclose(observed.problem.prior.precision, stage.prior(problem.space).precision)
    again = whiten(observed.problem, observed.calibrations)
    np.testing.assert_allclose(again.calibrations[0].hessian, stage.hessian)
    np.testing.assert_array_equal(again.measured, observed.measured)


def test_records_that_do_not_repeat_tell_the_memory_of_those_that_do() -> None:
    """One sine repeats, four do not, whose noise is known: its constant is as certain as if all did."""
    rng = np.random.default_rng(9)
    problem = build_problem(StraightLine(), sines(np.stack([long_memory(rng, 1000) for _ in range(5)])))
    every = whiten(problem)
    rest = [replace(one, period=None, periods=0) for one in problem.signals[1:]]
    known = {(test, output): w.process for test, output, w in every.records[1:]}
    mixed = whiten(replace(problem, signals=(problem.signals[0], *rest)), known=known)
    first, *others = (w for _, _, w in mixed.records)
    assert first.periods
    assert not any(w.periods for w in others)
    np.testing.assert_allclose(first.process.spectrum, every.records[0][2].process.spectrum)
    alone = first.process.beside(0.0)
    assert first.process.spectrum[0] > 1.5 * alone.spectrum[0]
    for w, (test, output) in zip(others, known, strict=True):
        np.testing.assert_array_equal(w.process.spectrum, known[test, output].spectrum)
