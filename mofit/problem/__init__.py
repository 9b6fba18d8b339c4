"""What is minimised and sampled: the tests of a campaign as objectives, likelihood and posterior."""

from mofit.problem.adjusted import AdjustedPosterior, adjusted_posterior
from mofit.problem.build import build_problem
from mofit.problem.curvature_adjustment import Adjustment, Score, adjust
from mofit.problem.failure import explained, model_failures
from mofit.problem.likelihood import Noise, test_log_likelihood
from mofit.problem.posterior import CampaignPosterior, JointProblem, Posterior
from mofit.problem.prior import FLAT, GaussianPrior, join_priors
from mofit.problem.problem import TOLERANCE, Problem

__all__ = [
    "FLAT",
    "TOLERANCE",
    "AdjustedPosterior",
    "Adjustment",
    "CampaignPosterior",
    "GaussianPrior",
    "JointProblem",
    "Noise",
    "Posterior",
    "Problem",
    "Score",
    "adjust",
    "adjusted_posterior",
    "build_problem",
    "explained",
    "join_priors",
    "model_failures",
    "test_log_likelihood",
]
