"""MAT files: up to version 7 through scipy, version 7.3 (HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mofit.data.importers.nested import flat_columns
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat

_HDF5 = b"\x89HDF\r\n\x1a\n"
#: places of HDF5's signature: MATLAB writes 512 bytes of its own before it
_OFFSETS = (0, 512, 1024, 2048)
#: levels of structs and cells
_DEEPEST = 8


def mat_columns(path: Path) -> Columns:
    """Numeric vectors, scalars and columns of matrices by variable name.

    Fields of a struct are ``struct.field``; elements of a cell and of a struct array are counted from 1, as the columns
    of a matrix are: ``runs.2.force``. Text, complex and empty variables are passed over. MAT files hold no units.

    Raises
    ------
    Exception
        Whatever scipy or h5py raise on a damaged file.
    InputError
        If a variable claims to be larger than the file can hold.
    """
    with path.open("rb") as file:
        start = file.read(_OFFSETS[-1] + len(_HDF5))
    if any(start[offset : offset + len(_HDF5)] == _HDF5 for offset in _OFFSETS):
        import h5py

        with h5py.File(path, "r") as file:
            return flat_columns(_hdf5_value(path, file, file, 0))
    # imported here because few campaigns come from MAT files
    from scipy.io import loadmat, whosmat

    for _, shape, _ in whosmat(path):
        LIMITS.check(path, int(np.prod([float(n) for n in shape])))
    variables = loadmat(path, squeeze_me=True, struct_as_record=False)
    return flat_columns({name: _value(value) for name, value in variables.items() if not name.startswith("__")})


def _value(value: Any) -> Any:
    """Structs as mappings and cells as lists; they are nested to any depth that scipy has read."""
    if hasattr(value, "_fieldnames"):
        return {field: _value(getattr(value, field)) for field in value._fieldnames}
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_value(inner) for inner in value.ravel(order="F")]
    return value


def _hdf5_value(path: Path, file: Any, item: Any, depth: int) -> Any:
    """The same of an HDF5 item; ``#refs#`` and the like hold what cells refer to."""
    if depth > _DEEPEST:
        return None
    if hasattr(item, "items"):
        fields = {_text(name): inner for name, inner in item.items() if not _text(name).startswith("#")}
        values = {name: _hdf5_value(path, file, inner, depth + 1) for name, inner in fields.items()}
        # the fields of a struct array are lists of its elements' values, and do not say that they are cells
        if fields and all(_refers(inner) and "MATLAB_class" not in inner.attrs for inner in fields.values()):
            return [dict(zip(values, element, strict=True)) for element in zip(*values.values(), strict=True)]
        return values
    if _refers(item):
        found = [_hdf5_value(path, file, file[reference], depth + 1) for reference in np.ravel(item[()])]
        return found[0] if len(found) == 1 else found
    kind = item.attrs.get("MATLAB_class", b"double")
    if kind == b"char" or item.attrs.get("MATLAB_empty", 0) or item.dtype.kind not in "fiub" or not item.size:
        return None
    if item.size > 1:
        # an array that was never stored would be read as zeros of any length
        LIMITS.check(path, item.nbytes if item.id.get_storage_size() else -1)
    # HDF5 has the sides of a matrix in the other order
    return np.squeeze(item[()]).T


def _refers(item: Any) -> bool:
    """Whether an item holds references to others, as cells and the fields of struct arrays do."""
    return (
        getattr(item, "dtype", None) is not None and item.dtype.kind == "O" and item.attrs.get("MATLAB_empty", 0) == 0
    )


def _text(name: str | bytes) -> str:
    """A name; h5py gives those that are no UTF-8 as bytes."""
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else name


FORMAT = ImportFormat(
    name="MAT",
    versions="up to version 7, and 7.3",
    endings=(".mat",),
    columns="numeric vectors, scalars and columns of matrices; `struct.field`, elements of a cell or struct array "
    "counted from 1: `runs.2.force`",
    units="none",
    read=mat_columns,
    contained=True,
)
