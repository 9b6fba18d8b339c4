"""The linearised motion against closed solutions, SciPy's matrix exponential, and integrated sensitivities."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import strangers
from damper_rig import damper_campaign
from scipy.linalg import expm

from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.inner_signals import inner_signals
from mofit.diagnosis.linear_response import Linearised, Motion, at_samples, phi_functions, recursion
from mofit.diagnosis.term_rows import Linearisation, Reading, term_columns
from mofit.diagnosis.terms import block, memory_terms, static_terms
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model, Symbols, build_system, find_effect, find_model, with_effects
from mofit.parameters import Parameter

STEP, TIME = 0.1, 0.1 * np.arange(40)


class Lag(Model):
    """A signal behind a lag of 0.7 s, twice, and three times what shifts it."""

    name = "lag"
    parameters = (Parameter("shift", "1", -1.0, 1.0, 0.0),)
    states = (Channel("x", "1"),)
    inputs = (Channel("u", "1"),)
    outputs = (Channel("y", "1"),)

    def equations(self, s: Symbols) -> Equations:
        return Equations({"y": 2 * s.x + 3 * s.shift}, {"x": (s.u + s.shift - s.x) / 0.7}, {"x": s.u + s.shift})


def test_a_ramp_through_a_lag_is_exact() -> None:
    motion = Motion(STEP, np.zeros((40, 1)), np.zeros((40, 1)), np.zeros(1), np.zeros(0))
    response = Linearised(build_system(Lag()), ["shift"]).response(motion)
    ramp = 1.0 + TIME
    found = response.of(0, np.stack([ramp, np.ones(40)], axis=1))
    assert found.shape == (40, 1, 2)
    # x of x' = (1 + t - x) / T from x(0) = 1
    x = 1.0 + TIME - 0.7 * (1 - np.exp(-TIME / 0.7))
    np.testing.assert_allclose(found[:, 0, 0], 2 * x + 3 * ramp, rtol=1e-12)
    np.testing.assert_allclose(found[:, 0, 1], 5.0, rtol=1e-12)


@pytest.mark.parametrize("scale", [0.0, 1e-6, 1.0, 50.0])
def test_phi_functions_are_parts_of_a_larger_exponential(scale: float) -> None:
    matrix = scale * np.array([[-0.3, 1.0, 0.0], [-1.0, -0.5, 0.2], [0.0, 0.1, -2.0]])
    one, none = np.eye(3), np.zeros((3, 3))
    whole = expm(np.block([[matrix, one, none], [none, none, one], [none, none, none]]))
    for found, place in zip(phi_functions(np.stack([matrix, -matrix])), range(3), strict=True):
        assert found.shape == (2, 3, 3)
        np.testing.assert_allclose(found[0], whole[:3, 3 * place : 3 * place + 3], rtol=1e-9, atol=1e-11)


def test_a_stiff_rate_dies_at_once() -> None:
    whole, first, second = phi_functions(np.array([[[-1e8]]]))
    np.testing.assert_allclose(whole.ravel(), 0.0, atol=1e-6)
    np.testing.assert_allclose(first.ravel(), 1e-8, rtol=1e-6)
    np.testing.assert_allclose(second.ravel(), 1e-8, rtol=1e-6)


def test_a_model_that_an_effect_extends_already_has_the_signals_of_its_base() -> None:
    base, campaign = find_model("kelvin_voigt_damper"), damper_campaign()
    extended = with_effects(base, find_effect("cubic_stiffness"))
    signals = inner_signals(baseline_in_wide_ranges(extended, campaign, Settings(jobs=1))[0])
    own = inner_signals(baseline_in_wide_ranges(base, campaign, Settings(jobs=1))[0])
    assert [one.name for one in signals.variables()] == [one.name for one in own.variables()]
    assert [one.name for one in signals.targets()] == [one.name for one in own.targets()]


def test_rows_of_terms_are_those_of_the_integrated_effects() -> None:
    campaign = strangers.oscillator(strangers.OSCILLATORS["van der Pol"])
    baseline, _ = baseline_in_wide_ranges(find_model("oscillator"), campaign, Settings(jobs=1))
    signals = inner_signals(baseline)
    variables, (target, *_) = signals.variables(), signals.targets()
    terms = [*static_terms(variables)[::9], *memory_terms(variables, 0.1, 1.0)[3][:4]]
    reading = Reading(target, signals, signals.responses([target.name]), 0, Linearisation.of(baseline))
    (found,) = term_columns([reading], terms)
    integrated = prepare(baseline, block(target, terms)).sensitivities[0][: len(found.rows)]
    error = np.linalg.norm(found.rows - integrated, axis=0) / np.linalg.norm(integrated, axis=0)
    assert len(error) > 10
    assert np.all(error < 0.02)
    assert np.median(error) < 0.005


def test_a_function_is_evaluated_at_every_sample() -> None:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    function = ca.Function("f", [x, p], [ca.horzcat(x, p * x)])
    points = np.arange(6.0).reshape(3, 2)
    (found,) = at_samples(function, points, np.array([2.0]))
    np.testing.assert_array_equal(found, np.stack([points, 2 * points], axis=2))


@pytest.mark.parametrize(("count", "size", "columns"), [(1, 2, 3), (7, 1, 2), (100, 3, 4), (101, 2, 1)])
def test_states_side_by_side_are_those_one_by_one(count: int, size: int, columns: int, rng) -> None:
    advance, pushed = rng.standard_normal((count, size, size)), rng.standard_normal((count, size, columns))
    advance /= np.linalg.norm(advance, 2, axis=(1, 2))[:, None, None]
    start = state = rng.standard_normal((size, columns))
    states = recursion(advance, pushed, start)
    for k in range(count):
        state = advance[k] @ state + pushed[k]
        np.testing.assert_allclose(states[k], state, atol=1e-12)
