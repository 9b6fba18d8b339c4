"""Estimates of the combinations of conditions scatter by as much as their covariances say."""

import numpy as np
from scipy.stats import chi2
from straight_line import UNITS, StraightLine

from mofit.data import Campaign, Experiment, Measurement
from mofit.identification.conditions import study_conditions
from mofit.identification.settings import Settings


def test_short_records_scatter_about_a_constant_by_their_covariances():
    """With 60 samples the noise is not known well: by the curvature at the minimum they would be too sure by 12 %."""
    rng, time, tests = np.random.default_rng(0), 0.01 * np.arange(60), []
    for k in range(60):
        x = np.sin(40 * time**2 + k)
        y = 2 * x + 1 + 0.05 * rng.normal(size=len(time))
        test = Experiment(f"t{k}", "free", time, {"displacement": x}, {"temperature": 280.0 + k})
        tests.append(Measurement(test, {"force": y}, UNITS))
    campaign = Campaign("springs", "simulated", {}, tuple(tests))
    settings = Settings(over=("temperature",), laws={"k": "constant", "b": "constant"}, sample=False, jobs=1)
    fit = study_conditions(campaign, StraightLine(), settings).fit
    assert fit.freedom == 118
    assert 0.02 < chi2.sf(fit.chi_square, fit.freedom) < 0.98
    assert abs(fit.values["k"] - 2) < 0.01
