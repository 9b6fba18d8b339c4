"""Orders of wheel and drum at angles that nobody wrote down: named, with their amplitude."""

from functools import cache

import numpy as np
import pytest
from damper_rig import SIMULATORS
from tyre_without_encoder import KNOWN, tyre_campaign

from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.result import Diagnosis, summary
from mofit.identification.settings import Settings
from mofit.models import find_model

CANDIDATES = ("wheel_order", "drum_runout", "contact_patch_lag", "delay", "dry_friction", "force_offset", "test_offset")


@cache
def diagnosed(*, seed: int = 1, scopes: tuple[tuple[str, str], ...] = (), **hidden: float) -> Diagnosis:
    settings = Settings(jobs=1, fixed=KNOWN, scopes=dict(scopes))
    campaign, model = tyre_campaign(seed=seed, **hidden), find_model("maxwell_tyre")
    return diagnose(campaign, model, CANDIDATES, settings, simulators=SIMULATORS)


@pytest.mark.parametrize("seed", [1, 2])
def test_without_an_effect_there_is_none(seed: int) -> None:
    assert diagnosed(seed=seed).conclusion.verdict == "none"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name", "amplitude", "others"),
    [("wheel", "wheel_order", 20.0, "A_w"), ("drum", "drum_runout", 0.015, "m_d")],
)
def test_an_order_is_named_with_its_amplitude(kind: str, name: str, amplitude: float, others: str) -> None:
    found = diagnosed(**{kind: amplitude})
    assert found.conclusion.verdict == "effect"
    (effect,) = found.conclusion.effects
    assert effect.name == name
    assert effect.size_low < amplitude < effect.size_high
    assert effect.size_high - effect.size_low < 0.4 * amplitude
    assert effect.parameters[others] == effect.size
    assert len(effect.parameters) == 2 + len(found.observed.problem.tests)
    assert effect.of_rig
    assert "of the rig" in found.conclusion.sentence


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [0.0, 20.0])
def test_an_order_is_no_noise_of_a_chirp(amplitude: float) -> None:
    """Although past inputs do not predict it."""
    found = diagnosed(wheel=amplitude, sweep=2.0)
    assert [effect.name for effect in found.conclusion.effects] == (["wheel_order"] if amplitude else [])
    for effect in found.conclusion.effects:
        assert effect.size_low < amplitude < effect.size_high


def test_the_angle_of_each_test_is_found() -> None:
    rng = np.random.default_rng(1)
    (effect,) = diagnosed(wheel=20.0).conclusion.effects
    angles = [value for name, value in effect.parameters.items() if name.startswith("theta_w")]
    first = rng.uniform(0, 2 * np.pi, 2)[0]  # the first that the rig draws
    assert abs(np.angle(np.exp(1j * (angles[0] - first)))) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("error", [-0.004, 0.01])
def test_a_radius_that_is_not_exact_does_not_matter(error: float) -> None:
    found = diagnosed(wheel=20.0, radius_error=error)
    assert found.conclusion.verdict == "effect"
    (effect,) = found.conclusion.effects
    assert effect.size_low < 20.0 < effect.size_high
    assert effect.parameters["e_w"] == pytest.approx(error, abs=5e-4)


def test_the_amplitude_holds_on_held_out_tests_and_the_angle_is_their_own() -> None:
    found = diagnosed(wheel=20.0)
    assert found.shrinkage is not None
    assert found.shrinkage.predicted == pytest.approx(1.0, abs=0.05)
    assert found.shrinkage.of("test").share > 0.85
    assert found.shrinkage.of("test").low < found.shrinkage.of("test").observed
    assert any("theta_w" in warning and "held-out test itself" in warning for warning in summary(found)["warnings"])


@pytest.mark.slow
def test_what_the_rig_adds_and_what_the_model_lacks_are_told_apart() -> None:
    found = diagnosed(wheel=25.0, lag=0.05)
    assert found.conclusion.verdict == "several"
    assert {effect.name for effect in found.conclusion.effects if effect.of_rig} == {"wheel_order"}
    assert found.attribution.best.families == {"lag or delay", "non-uniformity of rotating parts"}
    assert "The rig adds force variation of the wheel" in found.conclusion.sentence


def test_offsets_of_the_tests_are_the_rigs() -> None:
    found = diagnosed(offsets=30.0)
    assert [effect.name for effect in found.conclusion.effects] == ["test_offset"]
    assert found.conclusion.families[0].name == "sensor error"
