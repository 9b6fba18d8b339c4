"""Estimates of the combinations of conditions scatter by as much as their covariances say."""

import numpy as np
import pytest
from scipy.stats import chi2
from straight_line import UNITS, StraightLine

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.conditions import study_conditions
from mofit.identification.settings import Settings


def springs(tests: int, samples: int) -> Campaign:
    """One spring, its tests under temperatures of their own."""
    rng, time, found = np.random.default_rng(0), 0.01 * np.arange(samples), []
    for k in range(tests):
        x = np.sin(40 * time**2 + k)
        y = 2 * x + 1 + 0.05 * rng.normal(size=len(time))
        test = Experiment(f"t{k}", "free", time, {"displacement": x}, {"temperature": 280.0 + k})
        found.append(Measurement(test, {"force": y}, UNITS))
    return Campaign("springs", "simulated", {}, tuple(found))


def test_short_records_scatter_about_a_constant_by_their_covariances():
    """With 60 samples the noise is not known well: by the curvature at the minimum they would be too sure by 12 %."""
    settings = Settings(over=("temperature",), laws={"k": "constant", "b": "constant"}, sample=False, jobs=1)
    fit = study_conditions(springs(60, 60), StraightLine(), settings).fit
    assert fit.freedom == 118
    assert 0.02 < chi2.sf(fit.chi_square, fit.freedom) < 0.98
    assert abs(fit.values["k"] - 2) < 0.01


def test_estimates_beside_a_shared_parameter_are_as_sure_as_those_alone():
    """20 tests know the offset well: each slope is known as if the offset were given."""
    campaign = springs(20, 40)
    given = Settings(over=("temperature",), laws={"k": "constant"}, fixed={"b": 1.0}, sample=False, jobs=1)
    shared = Settings(over=("temperature",), laws={"k": "constant", "b": "shared"}, sample=False, jobs=1)
    alone = study_conditions(campaign, StraightLine(), given).cells
    together = study_conditions(campaign, StraightLine(), shared).cells
    k = [one.name for one in together.parameters].index("k")
    assert np.mean(together.sd[:, k] / alone.sd[:, 0]) == pytest.approx(1, abs=0.03)


def test_an_estimate_at_an_end_of_its_range_is_hardly_known():
    """The offset is 1, outside of what is allowed: a uniform distribution over the range is as wide."""
    bounds = {"b": (1.2, 3.0)}
    settings = Settings(over=("temperature",), laws={"k": "constant"}, bounds=bounds, sample=False, jobs=1)
    cells = study_conditions(springs(4, 60), StraightLine(), settings).cells
    b = [one.name for one in cells.parameters].index("b")
    assert cells.values[:, b] == pytest.approx(1.2)
    assert cells.sd[:, b] == pytest.approx(1.8 / np.sqrt(12), rel=0.03)
