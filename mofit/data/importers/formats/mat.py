"""MAT files: up to version 7 through scipy, version 7.3 (HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.registry import LIMITS, Columns, ImportFormat

_HDF5 = b"\x89HDF\r\n\x1a\n"
#: places of HDF5's signature: MATLAB writes 512 bytes of its own before it
_OFFSETS = (0, 512, 1024, 2048)


def mat_columns(path: Path) -> Columns:
    """Numeric vectors and scalars by variable name; fields of a struct as ``struct.field``.

    Text, matrices, cells, complex and empty variables are passed over. MAT files hold no units.

    Raises
    ------
    Exception
        Whatever scipy or h5py raise on a damaged file.
    InputError
        If a variable claims to be larger than the file can hold.
    """
    with path.open("rb") as file:
        start = file.read(_OFFSETS[-1] + len(_HDF5))
    columns: dict[str, FloatArray] = {}
    if any(start[offset : offset + len(_HDF5)] == _HDF5 for offset in _OFFSETS):
        import h5py

        with h5py.File(path, "r") as file:
            for name, item in file.items():
                _collect_hdf5(path, _text(name), item, columns)
        return columns, {}
    # imported here because few campaigns come from MAT files
    from scipy.io import loadmat, whosmat

    for _, shape, _ in whosmat(path):
        LIMITS.check(path, int(np.prod([float(n) for n in shape])))
    for name, value in loadmat(path, squeeze_me=True, struct_as_record=False).items():
        if not name.startswith("__"):
            _collect(name, value, columns)
    return columns, {}


def _collect(name: str, value: Any, columns: dict[str, FloatArray]) -> None:
    for field in getattr(value, "_fieldnames", ()):
        _collect(f"{name}.{field}", getattr(value, field), columns)
    array = np.asarray(value)
    if array.ndim <= 1 and array.size and array.dtype.kind in "fiub":
        columns[name] = np.atleast_1d(array).astype(float)


def _collect_hdf5(path: Path, name: str, item: Any, columns: dict[str, FloatArray], depth: int = 0) -> None:
    """Structs are groups; ``#refs#`` and the like hold what cells refer to."""
    if name.startswith("#") or depth > 8:
        return
    if hasattr(item, "items"):
        for field, inner in item.items():
            _collect_hdf5(path, f"{name}.{_text(field)}", inner, columns, depth + 1)
        return
    kind = item.attrs.get("MATLAB_class", b"double")
    if kind in (b"char", b"cell") or item.attrs.get("MATLAB_empty", 0) or item.dtype.kind not in "fiub":
        return
    if max(item.shape, default=1) != item.size or not item.size:
        return
    if item.size > 1:
        # a vector that was never stored would be read as zeros of any length
        LIMITS.check(path, item.nbytes if item.id.get_storage_size() else -1)
    columns[name] = np.atleast_1d(np.squeeze(item[()])).astype(float)


def _text(name: str | bytes) -> str:
    """A name; h5py gives those that are no UTF-8 as bytes."""
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else name


FORMAT = ImportFormat(
    name="MAT",
    versions="up to version 7, and 7.3",
    endings=(".mat",),
    columns="numeric vectors and scalars; fields of a struct as `struct.field`",
    units="none",
    read=mat_columns,
    contained=True,
)
