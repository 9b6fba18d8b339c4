"""Tests that an identification does not use, and predicts afterwards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mofit.data import Campaign
from mofit.errors import InputError, raise_errors
from mofit.identification.problem_setup import choose_tests
from mofit.models import Model
from mofit.simulation import lacking

if TYPE_CHECKING:
    import xarray as xr


def of_conditions(campaign: Campaign, hold_out: Sequence[str]) -> tuple[str, ...]:
    """Names of tests held out: each is a test, or ``condition=value`` of one or several conditions, by commas.

    Raises
    ------
    InputError
        If no test has these conditions.
    """
    found: list[str] = []
    for entry in hold_out:
        if entry in campaign.tests or "=" not in entry:
            found.append(entry)
            continue
        wanted = dict(part.partition("=")[::2] for part in entry.split(","))
        try:
            numbers = {name.strip(): float(value) for name, value in wanted.items()}
        except ValueError:
            raise InputError.of(f"--hold-out {entry}", "is no CONDITION=NUMBER", "Give the value in SI units") from None
        own = [
            m.name
            for m in campaign.measurements
            if all(_is(m.experiment.conditions.get(name), value) for name, value in numbers.items())
        ]
        if not own:
            known = "; ".join(f"{name}: {_values(campaign, name)}" for name in numbers)
            raise InputError.of(f"--hold-out {entry}", "no test has these conditions", f"The tests have {known}")
        found += own
    return tuple(dict.fromkeys(found))


def _is(value: float | None, wanted: float) -> bool:
    return value is not None and math.isclose(value, wanted, rel_tol=1e-6)


def _values(campaign: Campaign, name: str) -> str:
    values = sorted({m.experiment.conditions[name] for m in campaign.measurements if name in m.experiment.conditions})
    return ", ".join(f"{value:g}" for value in values) or "none"


def without_held_out(campaign: Campaign, hold_out: Sequence[str]) -> Campaign:
    """The campaign without the tests held out.

    Raises
    ------
    InputError
        With every name that is not a test, or if no test is left.
    """
    if not hold_out:
        return campaign
    campaign.select(hold_out)
    left = [name for name in campaign.tests if name not in hold_out]
    if not left:
        raise _nothing_left()
    return campaign.select(left)


def remaining_tests(model: Model, campaign: Campaign, whole: Campaign, tests: Sequence[str]) -> tuple[str, ...]:
    """Names of the tests of the main identification that are not held out; tests held out suit the model, too.

    Raises
    ------
    InputError
        If none is left, or with what the tests held out lack.
    """
    held_out = [name for name in whole.tests if name not in campaign.tests]
    if not held_out:
        return choose_tests(model, campaign, tests)
    raise_errors(lacking(model, whole.select(held_out)))
    chosen = [name for name in choose_tests(model, whole, tests) if name not in held_out]
    if not chosen:
        raise _nothing_left()
    return tuple(chosen)


def with_predictions(
    tree: xr.DataTree, model: Model, campaign: Campaign, held_out: Sequence[str], fitted: Sequence[str], jobs: int
) -> xr.DataTree:
    """A result with predictions of the tests held out, and in their table those of the fitted ones."""
    if not held_out:
        return tree
    import xarray as xr

    from mofit.prediction import HELD_OUT, predict_records, prediction_groups

    records = campaign.select([*held_out, *fitted])
    predictions = predict_records(tree, model, records, fitted=fitted, role=HELD_OUT, jobs=jobs)
    groups = {path: xr.DataTree(own) for path, own in prediction_groups(tree, model, predictions).items()}
    found = tree.copy()
    for path, own in groups.items():
        found[path] = own
    return found


def _nothing_left() -> InputError:
    return InputError.of("--hold-out", "leaves no test to identify from", "Hold out fewer tests")
