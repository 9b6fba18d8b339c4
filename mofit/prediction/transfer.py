r"""What a run knows of noise and model error, in a form that holds for other records.

The noise of an output is one number: its standard deviation in units, or as a share of the output's range. Which of the
two transfers to a new record is what differs less between the identified tests; with one test, or where both differ
alike, it is the standard deviation in units, as of a sensor with noise of its own. The number is the root mean square
over the tests. In no test it is more than the residual: what repeats differently from the excitation looks like noise.

The model error is the run's gap: the NRMSD that the model misses in the identified tests beyond their noise. It is
relative to the range, so that it grows with the output.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.models import Channel
from mofit.results import objectives, per_objective

#: Times the scatter of the standard deviations in units that their scatter as shares must stay below to be taken.
_CLEARLY = 0.5


@dataclass(frozen=True)
class OutputNoise:
    """Noise of an output as a number that transfers."""

    kind: Literal["units", "share"]
    """Whether the value is in the output's unit, or a share of its range."""
    value: float

    def sd(self, extent: float) -> float:
        """Standard deviation in a record whose output has this range, in the output's unit."""
        return self.value if self.kind == "units" else self.value * extent


@dataclass(frozen=True)
class Transferred:
    """Noise of every output, and the NRMSD that the model misses."""

    noise: tuple[OutputNoise, ...]
    gap: float


def transferred(tree: xr.DataTree, outputs: tuple[Channel, ...]) -> Transferred:
    """Noise and model error of a run for other records."""
    found = objectives(tree)
    sd, extent = (per_objective(tree, tree.dataset[name]) for name in ("noise_sd", "range"))
    residual = per_objective(tree, tree["modes/m1"].dataset["nrmsd"]) * extent
    sd = np.fmin(sd, residual)
    names = [one.name_of_output or outputs[0].name for one in found]
    noise = []
    for channel in outputs:
        own = [k for k, name in enumerate(names) if name == channel.name]
        noise.append(_noise(sd[own], extent[own]))
    gap = float(tree.dataset["gap"]) if "gap" in tree.dataset else 0.0
    return Transferred(tuple(noise), gap if np.isfinite(gap) else 0.0)


def _noise(sd: FloatArray, extent: FloatArray) -> OutputNoise:
    known = np.isfinite(sd) & (extent > 0)
    if not known.any():  # an output that no test had
        return OutputNoise("units", 0.0)
    sd, share = sd[known], sd[known] / extent[known]
    positive = sd > 0
    spread = [float(np.std(np.log(values[positive]))) if positive.any() else 0.0 for values in (sd, share)]
    taken: Literal["units", "share"] = "share" if spread[1] < _CLEARLY * spread[0] else "units"
    return OutputNoise(taken, float(np.sqrt(np.mean((share if taken == "share" else sd) ** 2))))
