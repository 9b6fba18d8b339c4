"""Types that many modules name."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Numbers of any shape; the docstring says which.
FloatArray: TypeAlias = NDArray[np.float64]
