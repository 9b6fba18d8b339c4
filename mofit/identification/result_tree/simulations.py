"""What a user's simulator was asked, in the root of the tree."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import xarray as xr

from mofit.identification.result import IdentificationResult


def with_simulations(tree: xr.DataTree, outcome: IdentificationResult) -> xr.DataTree:
    """The tree with what was asked until now, and how good the emulators are; itself for a model that has equations."""
    evaluations = outcome.problem.evaluations
    if evaluations is None:
        return tree
    checks = {mode.name: mode.emulator for mode in outcome.modes if mode.emulator is not None}
    emulators = {
        name: {**asdict(check), "error": check.error if np.isfinite(check.error) else None}
        for name, check in checks.items()
    }
    found = {
        "count": evaluations.count,
        "limit": evaluations.limit if np.isfinite(evaluations.limit) else None,
        "failed": evaluations.failed,
        "refused": evaluations.refused,
        "emulators": emulators,
    }
    tree.attrs["simulations"] = json.dumps(found)
    return tree
