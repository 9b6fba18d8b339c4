"""Models that name no spring relax too: a cell whose model is a resistance."""

import numpy as np
import pytest
from relaxing_cell import BRANCH, SERIES, TAU, Resistor, cell

from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings
from mofit.models import find_effect, with_effects
from mofit.problem import build_problem


def test_the_effect_is_an_rc_branch():
    campaign = cell(noise=0.0)
    problem = build_problem(with_effects(Resistor(), find_effect("relaxation")), campaign)
    # the branch is a share of the steady resistance
    truth = {"R_0": SERIES + BRANCH, "kappa": BRANCH / (SERIES + BRANCH), "tau_r": TAU}
    for test, measured in enumerate(campaign.measurements):
        values = measured.outputs["voltage"]
        point = problem.space.to_unit([{**truth, "U_0": values[0]}[name] for name in problem.space.names])
        simulated = problem.simulate(point[None])[test][0, :, 0]
        assert simulated == pytest.approx(values, abs=1e-9)


def test_a_cell_without_its_branch():
    found = diagnose(cell(), Resistor(), (), Settings(seed=0, jobs=1))
    assert [one.name for one in found.conclusion.families if one.probability > 0.5] == ["relaxation"]
    (effect,) = found.conclusion.effects
    assert effect.name == "relaxation"
    assert effect.parameters["tau_r"] == pytest.approx(TAU, rel=0.05)
    # 3.3 standard deviations: one seed in a thousand lies beyond
    assert abs(effect.size - BRANCH / (SERIES + BRANCH)) < effect.size_high - effect.size_low
    assert np.all(np.array(list(found.nrmsd_after.values())) < 1.2 * np.array(list(found.noise_floor.values())))


@pytest.mark.parametrize(("seed", "slow"), [(1, (0.002, 12.0)), (0, (0.001, 10.0))])
def test_what_one_branch_misses_of_two_is_no_other_cause(seed, slow):
    found = diagnose(cell(seed=seed, slow=slow), Resistor(), (), Settings(seed=0, jobs=1))
    assert found.conclusion.verdict == "effect"
    assert [one.name for one in found.conclusion.effects] == ["relaxation"]


def test_what_fits_better_beside_the_cause_is_not_dropped_in_silence():
    found = diagnose(cell(seed=1, slow=(0.002, 12.0)), Resistor(), (), Settings(seed=0, jobs=1))
    (beside,) = [one for one in found.attribution.accounts if "with relaxation the best" in one.reason]
    assert "relaxation alone explains the gap" in beside.reason


def test_a_cell_that_is_a_resistance_has_no_gap():
    found = diagnose(cell(seed=1, branch=0.0), Resistor(), (), Settings(seed=0, jobs=1))
    assert found.conclusion.verdict == "none"
