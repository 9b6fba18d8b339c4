"""What a user's simulator was asked for a result, and how good the emulators are that were sampled in its place."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def simulations(tree: xr.DataTree) -> dict[str, Any] | None:
    """Simulations of a user's simulator: ``count``, ``limit``, ``failed``, ``refused``, and ``emulators`` by mode.

    Of each emulator the error of the log posterior in nats at fresh draws, and what it took. None of a model that has
    equations.
    """
    return dict(json.loads(tree.attrs["simulations"])) if "simulations" in tree.attrs else None


def simulations_line(found: Mapping[str, Any]) -> str:
    """The same in a sentence or two."""
    limit = f" of {found['limit']:.0f}" if found["limit"] is not None else ""
    failed = f", {found['failed']} failed" if found["failed"] else ""
    line = f"{found['count']}{limit} simulations{failed}."
    for mode, one in found["emulators"].items():
        if one["error"] is None:
            line += f" The emulator of {mode} could not be checked."
        else:
            line += f" The emulator of {mode}, trained at {one['trained']} parameter sets, errs by {one['error']:.2g} "
            line += "nats (log posterior at fresh draws)."
    return line
