"""CasADi SX to SIMD machine code: batches of parameter sets through the tests of a campaign."""

from mofit.kernel.drive import Drive
from mofit.kernel.simulator import Simulator

__all__ = ["Drive", "Simulator"]
