"""A Dask cluster, reached by the address of its scheduler."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.errors import InputError

if TYPE_CHECKING:
    from distributed import Client


def connected(option: str, address: str, patience: float) -> Client:
    """A client of the scheduler; messages name the ``option`` that gave its address.

    Raises
    ------
    InputError
        If the extra is not installed, or no scheduler answers within ``patience`` seconds.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError.of(option, "needs Dask", "Install mofit's extra: pip install 'mofit[dask]'") from None
    try:
        return Client(address, timeout=patience)
    except (OSError, ValueError, TimeoutError) as error:
        message = f"no scheduler answers ({error})"
        raise InputError.of(f"{option} {address}", message, "Check the address") from None
