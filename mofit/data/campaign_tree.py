"""A campaign as the tree that its file holds, and what speaks against writing it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from mofit.data.campaign import Campaign, Measurement
from mofit.data.names import shown
from mofit.data.validation import experiment_issues
from mofit.errors import Issue
from mofit.quantities import known_unit, title_of

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "mofit.campaign/1"
#: numbers of a test that are attributes of its group
NUMBERS = ("frequency", "amplitude", "start_time", "transient")


def campaign_issues(campaign: Campaign) -> list[Issue]:
    """Everything for which the file of this campaign would be refused when it is read; warnings too."""
    issues = [
        Issue(f"root, attribute '{shown(str(key))}'", "holds half a character (a surrogate)", "Store proper text")
        for key, value in campaign.attributes.items()
        if str(value) != str(value).encode(errors="replace").decode()
    ]
    if not campaign.measurements:
        issues.append(Issue("root", "no test groups", "Add one group per test, with 'time' and its channels"))
    return issues + [issue for measurement in campaign.measurements for issue in measurement_issues(measurement)]


def measurement_issues(measurement: Measurement) -> list[Issue]:
    """The same for one test."""
    experiment = measurement.experiment
    where = f"group '{shown(experiment.name)}'"
    channels = {"input": experiment.inputs, "output": measurement.outputs}
    names = [name for group in channels.values() for name in group]
    issues = [
        Issue(
            f"{where}, variable '{shown(name)}', attribute 'units'",
            "missing",
            f"Add it, e.g. '{known_unit(name) or '1'}'",
        )
        for name in names
        if name not in measurement.units
    ]
    issues += [
        Issue(f"{where}, {what} '{shown(name)}'", f"is {value}", "Give a finite number")
        for what, group in (
            ("variable", experiment.conditions),
            ("attribute", {key: getattr(experiment, key) for key in NUMBERS}),
        )
        for name, value in group.items()
        if value is not None and not np.isfinite(value)
    ]
    return issues + experiment_issues(where, experiment.kind, experiment.time, channels, experiment.frequency)


def campaign_tree(campaign: Campaign) -> xr.DataTree:
    """The content of the campaign's file."""
    import xarray as xr  # late, see `read_tree`

    extra = {k: v if isinstance(v, str | int | float) else str(v) for k, v in campaign.attributes.items()}
    attributes = {**extra, "schema": SCHEMA, "title": campaign.title, "source": campaign.source}
    groups = {"/": xr.Dataset(_scalars(campaign.conditions, campaign.units), attrs=attributes)}
    for measurement in campaign.measurements:
        experiment = measurement.experiment
        variables: dict[str, Any] = {}
        for role, channels in (("input", experiment.inputs), ("output", measurement.outputs)):
            for name, values in channels.items():
                about = {"units": measurement.units[name], "role": role, "long_name": title_of(name)}
                variables[name] = ("time", values, about)
        own = {name: v for name, v in experiment.conditions.items() if campaign.conditions.get(name) != v}
        numbers = {key: getattr(experiment, key) for key in NUMBERS}
        groups[f"/{experiment.name}"] = xr.Dataset(
            {**variables, **_scalars(own, campaign.units)},
            coords={"time": ("time", experiment.time, {"units": "s", "long_name": "time"})},
            attrs={"procedure": experiment.kind, "interpolation": experiment.interpolation}
            | {key: value for key, value in numbers.items() if value is not None}
            | ({"gaps": measurement.gaps} if measurement.gaps else {})
            | ({"history": measurement.history} if measurement.history else {}),
        )
    return xr.DataTree.from_dict(groups)


def _scalars(conditions: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Any]:
    return {
        name: ((), float(value), {"units": units.get(name) or known_unit(name) or "1", "long_name": title_of(name)})
        for name, value in conditions.items()
    }
