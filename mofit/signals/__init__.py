"""What a record says about itself: period, transient, noise, derivatives."""

from mofit.signals.derivative import smooth_derivative
from mofit.signals.noise import overlap_noise, quantum, repeat_noise, residual_noise
from mofit.signals.periods import find_period, sine_period
from mofit.signals.process import NoiseProcess, noise_process
from mofit.signals.record import Record, analyse, settled_samples
from mofit.signals.smoothing import smooth
from mofit.signals.transient import find_settled
from mofit.signals.waveform import periodic_fit

__all__ = [
    "NoiseProcess",
    "Record",
    "analyse",
    "find_period",
    "find_settled",
    "noise_process",
    "overlap_noise",
    "periodic_fit",
    "quantum",
    "repeat_noise",
    "residual_noise",
    "settled_samples",
    "sine_period",
    "smooth",
    "smooth_derivative",
]
