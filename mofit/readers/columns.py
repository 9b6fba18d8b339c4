"""What every reader returns, and how much of it a file may claim to hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.errors import InputError

Array = NDArray[np.float64]

#: columns by name, shape (n,) each, and the unit of those that have one, as the file spells it
Columns = tuple[dict[str, Array], dict[str, str]]

#: bytes that deflate can make of one; a file that claims more is damaged
DEFLATE = 1032
#: most bytes that one file may unpack to
MOST_BYTES = 4 << 30


def check_claim(path: Path, claimed: int) -> None:
    """Refuse a file that claims to hold more than can be in it, before anything is allocated.

    Raises
    ------
    InputError
        If ``claimed`` (bytes) is more than `DEFLATE` times the file, or than `MOST_BYTES`.
    """
    if not 0 <= claimed <= min(DEFLATE * path.stat().st_size, MOST_BYTES):
        what = f"claims to hold {claimed:.3g} bytes in {path.stat().st_size} bytes of file"
        raise InputError.of(f"file '{path.name}'", what, "The file is damaged or cut off: copy or export it again")
