"""Signal analysis of records: period, transient, noise, derivative."""

from mofit.data.signals.analysis import REPEATED, SignalAnalysis, analyse, find_transient, steady_samples
from mofit.data.signals.noise_process import NoiseProcess, effective_samples, noise_process, repeats
from mofit.data.signals.periodicity import periodic_fit
from mofit.data.signals.smoothing import smooth_derivative, smooth_derivatives
from mofit.data.signals.thin_svd import thin_svd

__all__ = [
    "REPEATED",
    "NoiseProcess",
    "SignalAnalysis",
    "analyse",
    "effective_samples",
    "find_transient",
    "noise_process",
    "periodic_fit",
    "repeats",
    "smooth_derivative",
    "smooth_derivatives",
    "steady_samples",
    "thin_svd",
]
