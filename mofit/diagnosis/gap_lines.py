"""Which lines of the spectrum count when the gap of several classes is added up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES
from mofit.diagnosis.whitened_data import WhitenedData


def beyond_noise(observed: WhitenedData, squares: FloatArray) -> NDArray[np.bool_]:
    """Rows (m,) of the classes that hold more than the noise in all tests together.

    ``squares`` (m,) are those of the residual less the noise. Where the noise is known too high on some lines (a slow
    one beside a coloured noise), less than nothing is left there; it hides no gap on the lines of another class.
    """
    totals = np.bincount(observed.spectral_class, squares, len(SPECTRAL_CLASSES))
    return observed.explainable & (totals > 0)[observed.spectral_class]
