"""Four sines of the paper's programme simulated with its Table 5 and 1 % noise: the truth comes back."""

from pathlib import Path

import numpy as np
import pytest
from labels import unlabelled

from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.results import open_result, summary
from mofit.simulation.virtual_rig.rig import simulate

PLAN = Path(__file__).parents[2] / "data" / "plans" / "table5.toml"
TESTS = ("sine_0_50Hz", "sine_1_00Hz", "sine_2_00Hz", "sine_4_00Hz")
TABLE_5 = {"d_y": 281.0, "c_M": 19910.0, "d_M": 7535.0}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    model, out = find_model("maxwell_tyre"), tmp_path_factory.mktemp("t5") / "run"
    folder, _ = identify(simulate(PLAN), model, Settings(seed=3, jobs=1), tests=TESTS, out=out)
    return folder, open_result(folder)


@pytest.fixture(scope="module")
def found(run):
    folder, tree = run
    return summary(tree, folder)


def test_everything_stored_has_a_unit_and_a_name(run):
    tree = run[1]
    assert {"calibration", "baseline", "per_frequency"} <= set(tree.children)
    assert unlabelled(tree) == []


def test_truth_within_three_standard_deviations(found):
    assert found["converged"]
    for name, truth in TABLE_5.items():
        parameter = found["modes"][0]["parameters"][name]
        assert abs(parameter["mean"] - truth) < 3 * parameter["sd"]
        assert parameter["verdict"] == "identified"


def test_error_is_the_noise_floor(found):
    """On average within 2 %; a single test's floor is itself known to about 1 %."""
    ratios = [value / found["noise_floor"][test] for test, value in found["modes"][0]["nrmsd"].items()]
    assert np.mean(ratios) == pytest.approx(1, abs=0.02)
    assert ratios == pytest.approx(np.ones(len(ratios)), abs=0.05)


def test_baseline_and_single_tests_stand_beside(found):
    best = found["modes"][0]["nrmsd"]
    assert found["baseline"]["model"] == "kelvin_voigt_tyre"
    assert all(found["baseline"]["nrmsd"][test] > best[test] for test in best if test >= "sine_1")
    assert {row["test"] for row in found["per_frequency"]} == set(best)
