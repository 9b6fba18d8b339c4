"""What is minimised: NRMSD per test for the search, a likelihood for refinement and sampling."""

from mofit.objectives.curvature import Adjustment, Score, adjust, join_scores
from mofit.objectives.likelihood import (
    Noise,
    TestSums,
    common_gap,
    effective_samples,
    likelihood_terms,
    negative_log_likelihood,
    test_log_likelihood,
)
from mofit.objectives.nrmsd import nrmsd
from mofit.objectives.prior import GaussianPrior

__all__ = [
    "Adjustment",
    "GaussianPrior",
    "Noise",
    "Score",
    "TestSums",
    "adjust",
    "common_gap",
    "effective_samples",
    "join_scores",
    "likelihood_terms",
    "negative_log_likelihood",
    "nrmsd",
    "test_log_likelihood",
]
