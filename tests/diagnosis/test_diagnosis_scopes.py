"""Parameters with a value per test: estimated along, in the model and in its effects."""

from functools import cache

import numpy as np
import pytest
from damper_rig import SIMULATORS
from damper_with_offsets import damper_with_offsets
from scipy.integrate import solve_ivp

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.result import Diagnosis, summary
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model, with_effects

PER_TEST = (("F_0", "test"),)


@cache
def diagnosed(friction: float = 0.0, scopes: tuple[tuple[str, str], ...] = PER_TEST) -> Diagnosis:
    settings = Settings(jobs=1, scopes=dict(scopes))
    return diagnose(
        damper_with_offsets(friction), find_model("kelvin_voigt_damper"), (), settings, simulators=SIMULATORS
    )


def test_offsets_that_differ_from_test_to_test_are_no_gap_where_they_may() -> None:
    found = diagnosed()
    assert found.conclusion.verdict == "none"
    assert max(found.nrmsd_before.values()) < 1.2 * max(found.noise_floor.values())


def test_without_a_scope_they_are_an_error_of_the_sensor() -> None:
    found = diagnosed(scopes=())
    assert found.conclusion.verdict == "effect"
    assert [effect.name for effect in found.conclusion.effects] == ["test_offset"]
    assert found.conclusion.sentence.endswith("That is of the rig; the model need not change.")


def test_friction_beside_offsets_is_friction() -> None:
    found = diagnosed(friction=30.0)
    assert found.conclusion.verdict == "effect"
    (effect,) = found.conclusion.effects
    assert effect.name == "dry_friction"
    assert effect.size == pytest.approx(30.0, rel=0.03)
    assert found.shrinkage is not None
    assert found.shrinkage.of("test").share > 0.99
    assert found.shrinkage.predicted > 0.98
    assert found.shrinkage.of("test").observed > 0.98


def test_friction_and_offsets_without_a_scope_are_told_apart() -> None:
    found = diagnosed(friction=30.0, scopes=())
    assert found.attribution.best.effects == ("dry_friction", "test_offset")
    assert "The rig adds force offset of each test; the model lacks dry friction" in found.conclusion.sentence


def test_a_clock_that_shifts_from_test_to_test_is_estimated() -> None:
    """Every force channel of the campaign is late by a time of its own."""
    campaign = damper_with_offsets(offsets=0.0)
    settings = Settings(jobs=1, scopes={"tau_d": "test"})
    found = diagnose(
        campaign, find_model("kelvin_voigt_damper"), ("delay", "dry_friction"), settings, simulators=SIMULATORS
    )
    assert found.conclusion.verdict == "none"
    (delay,) = [one for one in found.attribution.score_tests if one.name == "delay"]
    assert delay.sizes.shape[1] == len(campaign.measurements)


def roads(damping: float) -> Campaign:
    """An oscillator of 1 kg under forces of its own in every test, which begins in motion; by scipy."""
    rng, tests = np.random.default_rng(1), []
    for number, start in enumerate(((0.01, 0.0), (0.02, 0.3), (-0.015, 0.2), (0.03, -0.5))):
        time = np.arange(800) / 100.0
        rates, sizes, phases = 2 * np.pi * np.cumsum(rng.uniform(0.5, 4, 6)), rng.uniform(1, 4, 6), rng.uniform(0, 6, 6)

        def force(t, rates=rates, sizes=sizes, phases=phases):
            return np.sin(np.multiply.outer(t, rates) + phases) @ sizes

        def change(t, state, force=force):
            position, velocity = state
            return [velocity, force(t) - 1000 * position - 4 * velocity - damping * abs(velocity) * velocity]

        moved = solve_ivp(change, (0, time[-1]), start, t_eval=time, rtol=1e-9, atol=1e-12).y[0]
        moved += 1e-4 * rng.standard_normal(len(time))
        experiment = Experiment(f"road {number}", "free", time, {"force": force(time)}, {}, interpolation="cubic")
        tests.append(Measurement(experiment, {"displacement": moved}, {"displacement": "m", "force": "N"}))
    return Campaign("roads", "simulated", {}, tuple(tests))


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "named"), [(0.0, []), (8.0, ["quadratic_damping"])])
def test_records_that_begin_in_motion_have_initial_states(damping: float, named: list[str]) -> None:
    starts = (find_effect(f"start:{state}") for state in ("position", "velocity"))
    model = with_effects(find_model("oscillator"), *starts)
    settings = Settings(jobs=1, fixed={"k": 1000.0}, scopes={"x_0": "test"})
    candidates = ("quadratic_damping", "cubic_stiffness", "dry_friction")
    found = diagnose(roads(damping), model, candidates, settings, simulators=SIMULATORS)
    assert [effect.name for effect in found.conclusion.effects] == named
    for effect in found.conclusion.effects:
        assert effect.size_low < damping < effect.size_high


def test_the_jacobian_of_scoped_parameters_is_that_of_the_residual() -> None:
    settings = Settings(jobs=1, scopes={"F_0": "test"})
    fitted, _ = baseline_in_wide_ranges(
        find_model("kelvin_voigt_damper"), damper_with_offsets(), settings, (), SIMULATORS
    )
    observed = fitted.hypothesis.observed
    model = hypothesis(observed, observed.stages.discrepancies(find_effect("test_offset")))
    assert len(model.space) == 3 + 4 + 4
    point = np.concatenate([fitted.minimum.point, np.full(4, 0.5)])
    here = model.linear(point[None])
    for k in range(len(point)):
        near = point.copy()
        near[k] += 1e-6
        change = (model.linear(near[None]).residual[0] - here.residual[0]) / 1e-6
        scale = np.linalg.norm(here.jacobian[0, :, k])
        assert np.linalg.norm(change - here.jacobian[0, :, k]) < 2e-3 * scale + 1e-6


def test_json_lists_what_each_test_has() -> None:
    (effect,) = summary(diagnosed(scopes=()))["effects"]
    assert list(effect["parameters"]) == [f"F_t [{f} Hz]" for f in ("0.5", "1", "2", "4")]
    assert effect["of_rig"]


def test_a_scope_of_an_unknown_parameter_is_refused() -> None:
    with pytest.raises(InputError, match="no such parameter"):
        diagnosed(scopes=(("F_x", "test"),))
