"""A few periods tell of what repeats what all of them tell, and a fit that begins with them ends where another does."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import damper_fit
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.data.signals import SignalAnalysis
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.few_periods import at_steps_for, cut, few_periods, repeats
from mofit.diagnosis.fitting import averaged_over_periods, fit, of_few_periods
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.limited_refinement import best_minimum
from mofit.diagnosis.remembered import Remembered
from mofit.diagnosis.whitening import whitening
from mofit.models import Applied, Channel, Effect, find_effect
from mofit.optimize import RefineSettings
from mofit.parameters import Parameter

STEP = 0.01


def with_effect(name: str, *values: float) -> tuple[Hypothesis, np.ndarray]:
    """The damper with an effect, and a point."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    found = observed.stages.discrepancies(find_effect(name))
    return hypothesis(observed, found[:1]), np.concatenate([fitted.minimum.point, values])


@settings(max_examples=25, deadline=None)
@given(
    st.integers(4, 20),
    st.sampled_from([20, 25, 32, 33 + 1 / 3, 28.5]),
    st.integers(0, 60),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
)
def test_rows_of_what_repeats_are_those_of_a_few_periods(periods, samples, start, amplitudes) -> None:
    # a sampling rate at which only several periods fill whole samples
    periods = 6 * (periods // 6 + 1) if samples != int(samples) else periods
    count = start + round(periods * samples)
    angle = 2 * np.pi * np.arange(count) / samples
    signal = sum(a * np.cos((k + 1) * angle + k) for k, a in enumerate(amplitudes))
    noisy = signal + np.random.default_rng(periods).standard_normal(count)
    record = SignalAnalysis(samples * STEP, 0, 0.0, 0.0, {}, "", {})
    whole = whitening(noisy, np.arange(count) >= start, STEP, record, 1.0)
    few = whole.of_few_periods()
    assert few.count <= max(whole.count / 2, 6 * samples)
    assert few.start + few.count - start == max(int(whole.count / 8), few.count)
    all_rows, own = whole.rows(signal[:, None])[:, 0], few.rows(signal[:, None])[:, 0]
    size = 1e-6 + np.linalg.norm(all_rows)
    assert np.linalg.norm(own) == pytest.approx(np.linalg.norm(all_rows), abs=1e-6 * size)
    lines, brief = whole.white_lines(all_rows)[:: whole.periods][:4], few.white_lines(own)[:: few.periods][:4]
    later = np.exp(2j * np.pi * np.arange(4) * (few.start - start) / samples)
    np.testing.assert_allclose(brief, lines * later, atol=1e-6 * size)
    # up to rounding of periods to samples
    np.testing.assert_allclose(few.repeated(whole, own), all_rows, atol=2e-3 * size)


def test_rows_of_a_few_periods_are_found_among_those_of_all() -> None:
    count = 400
    record = SignalAnalysis(20 * STEP, 0, 0.0, 0.0, {}, "", {})
    angle = 2 * np.pi * np.arange(count) / 20
    noisy = np.cos(angle) + np.random.default_rng(0).standard_normal(count)
    whole = whitening(noisy, np.ones(count, dtype=bool), STEP, record, 1.0)
    few = whole.of_few_periods()
    place = few.rows_among(whole)
    assert len(place) == few.count
    np.testing.assert_array_equal(whole.line_of_row[place] * few.periods, few.line_of_row * whole.periods)
    # a sine and a cosine are told apart
    assert len(set(place)) == len(place)


def test_a_record_that_does_not_repeat_stays_whole(rng: np.random.Generator) -> None:
    values = rng.standard_normal(400)
    record = SignalAnalysis(None, 0, 0.0, 0.0, {}, "", {})
    whole = whitening(values, np.ones(400, dtype=bool), STEP, record, 1.0)
    assert whole.of_few_periods() is whole
    assert whole.repeats(np.cumsum(values)[:, None])


def test_inputs_that_drift_do_not_repeat() -> None:
    time = STEP * np.arange(400)
    sine = np.sin(2 * np.pi * time)
    whole = whitening(sine, np.ones(400, dtype=bool), STEP, SignalAnalysis(1.0, 0, 0.0, 0.0, {}, "", {}), 1.0)
    assert whole.repeats(np.stack([sine, np.ones(400)], axis=1))
    assert not whole.repeats(np.stack([sine, time], axis=1))


def test_the_squares_are_those_of_all_periods() -> None:
    model, point = with_effect("dry_friction", 0.05, 0.6)
    few = few_periods(model)
    assert few is not None
    samples = [sum(one.samples for one in each.simulator.experiments) for each in (few.hypothesis, model)]
    assert samples[0] < 0.5 * samples[1]
    whole = Remembered(model).evaluate(point[None])[0][0]
    assert Remembered(few.hypothesis).evaluate(point[None])[0][0] + few.left_out == pytest.approx(whole, rel=0.01)
    assert at_steps_for(model, point[None]).steps == model.at_steps_for(point[None]).steps


def test_beside_a_fit_few_periods_tell_of_another_model_what_all_tell() -> None:
    fitted = damper_fit()
    brief = of_few_periods(fitted)
    assert brief is not fitted
    model, point = with_effect("dry_friction", 0.02, 0.6)
    few = few_periods(model)
    assert few is not None
    beside = replace(few.hypothesis, observed=brief.hypothesis.observed)
    less = Remembered(model).evaluate(point[None])[0][0] - fitted.minimum.value
    assert abs(less) > 50
    assert Remembered(beside).evaluate(point[None])[0][0] - brief.minimum.value == pytest.approx(less, rel=0.01)
    # what it leaves is what repeats of that of the whole tests, in the samples that smoothing reads, too
    observed, short, rows = (
        fitted.hypothesis.observed,
        brief.hypothesis.observed,
        len(brief.hypothesis.observed.measured),
    )
    simulated = brief.hypothesis.outputs(brief.minimum.point[None])
    for i, (test, output, w) in enumerate(short.records):
        whole = observed.records[i][2]
        left = whole.waveform(fitted.residual[: len(observed.measured)][observed.record == i])
        place = w.start - whole.start
        expected = w.rows(np.pad(left[place : place + w.count], (w.start, 0))[:, None])[:, 0]
        np.testing.assert_allclose(brief.residual[:rows][short.record == i], expected, atol=1e-6)
        stroke = observed.problem.measurements[test].channel("displacement")[w.start : w.start + w.count]
        turned = np.exp(1j * short.phase[i]) / np.exp(1j * np.angle(np.fft.rfft(stroke)[w.periods]))
        assert turned == pytest.approx(1.0, abs=0.05)
        used = simulated[test][0][0, w.start : w.start + w.count, output]
        np.testing.assert_allclose(
            short.used_samples(i) - used, left[place : place + w.count], atol=1e-6 * np.ptp(used)
        )


def test_inputs_of_effects_end_with_their_tests() -> None:
    """Also where the first test is whole: it is the same object then, in whole and in cut ones."""
    observed, drift = damper_fit().hypothesis.observed, [find_effect("drift")]
    whole = [one.recorded for one in experiments_of(observed.problem, drift)]
    first, *others = observed.problem.experiments
    few = replace(observed.problem, experiments=(first, *(one.first(50) for one in others)))
    short = [one.recorded for one in experiments_of(few, drift)]
    assert short == [whole[0], *(50 for _ in others)]
    assert min(whole) > 50


def test_an_effect_that_does_not_repeat_is_fitted_to_all() -> None:
    model, _ = with_effect("drift", 0.5)
    assert few_periods(model) is None
    assert cut(model.observed, model.simulator) is None


def test_a_fit_that_changes_leaves_of_a_few_periods_what_it_leaves_of_all_on_average() -> None:
    fitted = fit(*with_effect("drift", 0.5))
    assert of_few_periods(fitted) is fitted
    brief, observed = averaged_over_periods(fitted), fitted.hypothesis.observed
    assert len(brief.residual) < 0.5 * len(fitted.residual)
    short = brief.hypothesis.observed
    for i, (*_, w) in enumerate(short.records):
        whole = observed.records[i][2]
        left = whole.waveform(fitted.residual[: len(observed.measured)][observed.record == i])
        place = w.start - whole.start
        expected = w.rows(np.pad(left[place : place + w.count], (w.start, 0))[:, None])[:, 0]
        np.testing.assert_allclose(brief.residual[: len(short.measured)][short.record == i], expected, atol=1e-6)
    # one that repeats is the same either way
    again, known = averaged_over_periods(damper_fit()), of_few_periods(damper_fit())
    np.testing.assert_allclose(again.residual, known.residual)


@pytest.mark.parametrize(("effect", "values"), [("dry_friction", (0.05, 0.6)), ("quadratic_damping", (0.5,))])
def test_the_minimum_is_that_of_all_periods(effect: str, values: tuple[float, ...]) -> None:
    model, point = with_effect(effect, *values)
    model = model.at_steps_for(point[None])
    starts = np.stack([point, np.clip(point + 0.05, 0, 1)])
    found = fit(model, starts)
    expected = best_minimum(Remembered(model).evaluate, starts, RefineSettings())
    assert found.minimum.value == pytest.approx(expected.value, abs=5e-3)
    sd = found.sd()
    assert np.all(np.abs(found.minimum.point - expected.point) <= 0.1 * sd + 1e-6)


def test_what_is_far_from_the_limit_is_told_by_a_few_periods() -> None:
    """The residual and its derivatives are about those of all periods, and none of these is simulated."""
    fitted = damper_fit()
    model, point = with_effect("quadratic_damping", 0.5)
    model = model.at_steps_for(point[None])
    starts = np.stack([point, np.clip(point + 0.05, 0, 1)])
    found = fit(model, starts, 0.0, fitted, repeats=True)
    here = model.linear(found.minimum.point[None])
    assert not np.array_equal(found.residual, here.residual[0])
    assert found.minimum.value == pytest.approx(0.5 * float(np.sum(here.residual**2)), rel=0.01)
    change = here.jacobian[0] - found.jacobian
    assert np.linalg.norm(change) < 0.05 * np.linalg.norm(here.jacobian)
    # without knowing that it repeats, all periods are asked
    np.testing.assert_array_equal(fit(model, starts, 0.0, fitted).jacobian, here.jacobian[0])


def test_an_effect_that_builds_up_does_not_repeat() -> None:
    """A stroke that repeats, alone and times the way so far."""
    observed = damper_fit().hypothesis.observed
    strokes = [experiment.inputs[experiment.lead :] for experiment in observed.problem.experiments]
    steady, growing = (
        observed.whitened([stroke[None, :, None] * size for stroke, size in zip(strokes, sizes, strict=True)])[0]
        for sizes in ([1.0] * len(strokes), [np.linspace(0, 1, len(stroke))[:, None, None] for stroke in strokes])
    )
    assert repeats(observed, steady)
    assert not repeats(observed, growing)


class WarmDamping(Effect):
    """A force that grows with the squared motion so far: nothing that it reads drifts, and yet it does not repeat."""

    name = "warm_damping"
    title = "damping that grows with the motion so far"
    on = ("damper_force", "force")
    parameters = (Parameter("warmth", "1/(m^2 s)", 0.0, 100.0, 1.0, neutral=0.0),)
    states = (Channel("way", "m^2 s"),)

    def apply(self, s, value):
        return Applied((1 + s.warmth * s.way) * value, {"way": s.displacement**2})


def test_what_does_not_repeat_is_fitted_to_all_periods() -> None:
    observed = damper_fit().hypothesis.observed
    model = hypothesis(observed, observed.stages.discrepancies(WarmDamping())[:1])
    starts = np.append(damper_fit().minimum.point, 0.3)[None] + np.array([[0.0], [0.01]])
    found, expected = fit(model, starts), best_minimum(Remembered(model).evaluate, starts, RefineSettings())
    assert found.minimum.value == pytest.approx(expected.value, abs=5e-3)
