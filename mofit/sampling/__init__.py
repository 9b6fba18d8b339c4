"""Sampling: the posterior around each minimum, with independent ensembles of emcee."""

from mofit.sampling.bridge_sampling import Evidence, bridge_log_evidence
from mofit.sampling.chains import Chains, Draws
from mofit.sampling.convergence import autocorrelation_time, effective_size, r_hat
from mofit.sampling.ensemble import restricted
from mofit.sampling.independence_proposal import StudentTMixture
from mofit.sampling.laplace import laplace_covariance, laplace_log_evidence, mode_region, mode_weights
from mofit.sampling.posterior_summary import contraction, mixture, verdict
from mofit.sampling.sampler import sample_mode
from mofit.sampling.settings import SampleSettings

__all__ = [
    "Chains",
    "Draws",
    "Evidence",
    "SampleSettings",
    "StudentTMixture",
    "autocorrelation_time",
    "bridge_log_evidence",
    "contraction",
    "effective_size",
    "laplace_covariance",
    "laplace_log_evidence",
    "mixture",
    "mode_region",
    "mode_weights",
    "r_hat",
    "restricted",
    "sample_mode",
    "verdict",
]
