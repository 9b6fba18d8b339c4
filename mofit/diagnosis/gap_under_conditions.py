"""Under which conditions the gap lies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mofit.data import Campaign
from mofit.diagnosis.residual_map import ResidualMap
from mofit.quantities import known_unit


@dataclass(frozen=True)
class GapUnder:
    """The gap of all tests under one value of a condition.

    Parameters
    ----------
    condition, value, unit
        In SI units.
    tests
        Number of tests.
    gap
        Root mean square beyond the noise, in the unit of the output.
    """

    condition: str
    value: float
    unit: str
    tests: int
    gap: float


def gaps_under_conditions(located: ResidualMap, campaign: Campaign, conditions: Sequence[str]) -> tuple[GapUnder, ...]:
    """The gap under every value of every condition, in the order of the values."""
    tests = [one for one in campaign.measurements if one.name in located.squares]
    squares = np.array([located.squares[one.name] for one in tests])
    found = []
    for condition in conditions:
        at = np.array([one.experiment.conditions[condition] for one in tests])
        unit = known_unit(condition) or campaign.units.get(condition, "1")
        for value in np.unique(at):
            here = at == value
            gap = float(np.sqrt(max(squares[here].mean(), 0.0)))
            found.append(GapUnder(condition, float(value), unit, int(here.sum()), gap))
    return tuple(found)
