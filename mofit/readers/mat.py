"""MAT files up to version 7, through scipy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit.errors import InputError

Array = NDArray[np.float64]


def mat_columns(path: Path) -> dict[str, Array]:
    """Numeric vectors and scalars by variable name; fields of a struct as ``struct.field``.

    Raises
    ------
    InputError
        If the file is damaged or of version 7.3.
    """
    # imported here because few campaigns come from MAT files
    from scipy.io import loadmat

    where = f"file '{path.name}'"
    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError as error:
        cure = "Save it again in MATLAB with the option -v7"
        raise InputError.of(where, "a MAT file of version 7.3 is not read", cure) from error
    except Exception as error:
        raise InputError.of(where, f"not a readable MAT file ({error})", "Copy it again") from error
    columns: dict[str, Array] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, columns)
    if not columns:
        raise InputError.of(where, "holds no numeric vector", "Save the signals as vectors")
    return columns


def _collect(name: str, value: Any, columns: dict[str, Array]) -> None:
    for field in getattr(value, "_fieldnames", ()):
        _collect(f"{name}.{field}", getattr(value, field), columns)
    array = np.asarray(value)
    if array.ndim <= 1 and array.dtype.kind in "fiub":
        columns[name] = np.atleast_1d(array).astype(float)
