"""Sampling: the posterior around each minimum, with independent ensembles of emcee."""

from mofit.sample.bridge import Evidence, bridge_log_evidence
from mofit.sample.chains import Chains
from mofit.sample.convergence import autocorrelation_time, effective_size, r_hat
from mofit.sample.draws import Draws
from mofit.sample.evidence import laplace_log_evidence, mode_weights
from mofit.sample.gaussian import laplace_covariance
from mofit.sample.mixture import Mixture, cell, mixture, restricted
from mofit.sample.sample import sample_mode
from mofit.sample.settings import SampleSettings

__all__ = [
    "Chains",
    "Draws",
    "Evidence",
    "Mixture",
    "SampleSettings",
    "autocorrelation_time",
    "bridge_log_evidence",
    "cell",
    "effective_size",
    "laplace_covariance",
    "laplace_log_evidence",
    "mixture",
    "mode_weights",
    "r_hat",
    "restricted",
    "sample_mode",
]
