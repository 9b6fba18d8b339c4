"""The campaign file ``mofit.campaign/1``: netCDF-4, one group per test (see docs/campaigns.md)."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign, Experiment, Measurement
from mofit.data.campaign_tree import NUMBERS, SCHEMA, campaign_issues, campaign_tree
from mofit.data.names import channel_name_issues, name_issues, shown, title_issues
from mofit.data.validation import channel_issues, experiment_issues
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.quantities import CHANNELS, EXCITATION_KINDS, INTERPOLATIONS, PERIODIC_EXCITATIONS, known_unit
from mofit.runtime.files import read_tree, write_tree
from mofit.units import UnitError, si_unit, to_si

if TYPE_CHECKING:
    import xarray as xr

BUNDLED = "paper_campaign.nc"
_HERE = Path(__file__).resolve().parent
#: A wheel carries the bundled file beside this module; in a checkout it is in ``data/`` beside the package.
PLACES = (_HERE, _HERE.parents[1] / "data")
_NOT_FREE_TEXT = ("schema", "title", "source")


def bundled_campaign(places: Sequence[Path] = PLACES) -> Path:
    """Path of the bundled (simulated) campaign: the first place that has it.

    Raises
    ------
    InputError
        If no place has it.
    """
    for folder in places:
        if (folder / BUNDLED).is_file():
            return folder / BUNDLED
    message = f"this installation has no {BUNDLED}"
    raise InputError.of("bundled campaign", message, "Name a campaign FILE, or install anew")


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign file, everything in SI units.

    Raises
    ------
    InputError
        With all errors of the file together.
    """
    campaign, issues = load(path)
    raise_errors(issues)
    assert campaign is not None
    return campaign


def load(path: str | Path) -> tuple[Campaign | None, list[Issue]]:
    """Read as much as can be read: the campaign of all sound tests (None if there is none) and every issue."""
    tree, issues = _open(Path(path))
    if tree is None:
        return None, issues
    source = str(tree.attrs.get("source", ""))
    conditions, units = _conditions("root", tree.to_dataset(), issues)
    measurements = []
    for name, group in tree.children.items():
        own, own_units = _conditions(f"group '{name}'", group.to_dataset(inherit=False), issues)
        measurement, found = _measurement(name, group, {**conditions, **own})
        units |= own_units
        issues += found
        if measurement is not None:
            measurements.append(measurement)
    if not measurements or source not in ("measured", "simulated"):
        return None, issues
    attributes = {
        str(key): value.tolist() if isinstance(value, np.generic | np.ndarray) else value
        for key, value in tree.attrs.items()
        if key not in _NOT_FREE_TEXT
    }
    title = str(tree.attrs.get("title", Path(path).stem))
    return Campaign(title, source, conditions, tuple(measurements), attributes, units), issues


def is_campaign_file(path: Path) -> bool:
    """Whether a file says that it is a campaign, of whatever version."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            schema = file.attrs.get("schema", b"")
            return (schema if isinstance(schema, bytes) else str(schema).encode()).startswith(b"mofit.campaign/")
    except OSError:
        return False


def write_campaign(campaign: Campaign, path: str | Path) -> None:
    """Write a campaign file, atomically.

    The same campaign gives the same bytes.

    Raises
    ------
    InputError
        If the folder is not there or cannot be written to, or with every error for which the file would be refused when
        it is read: names and titles that it cannot hold, samples that are not finite, constant channels.
    """
    path = Path(path)
    if not os.access(path.parent, os.W_OK):
        raise InputError.of(f"file '{path}'", "its folder is not there or not writable", "Name another folder")
    raise_errors(campaign_issues(campaign))
    write_tree(campaign_tree(campaign), path, level=4)


def _open(path: Path) -> tuple[xr.DataTree | None, list[Issue]]:
    """The tree in memory, and what is wrong with the file as a whole."""
    try:
        tree = read_tree(path, "Write or copy it again; convert other formats with 'mofit import'", indexes=False)
    except InputError as error:
        return None, list(error.issues)
    issues = []
    schema = tree.attrs.get("schema")
    if schema is None:
        issues.append(Issue("root, attribute 'schema'", "missing", f"Set it to '{SCHEMA}'"))
    elif schema != SCHEMA:
        hint = f"This version reads '{SCHEMA}'; write the file in that schema"
        return None, [Issue("root, attribute 'schema'", f"unknown schema '{schema}'", hint)]
    if not tree.attrs.get("title"):
        issues.append(Issue("root, attribute 'title'", "missing", "Describe in a few words what was tested", "warning"))
    issues += title_issues("root, attribute 'title'", str(tree.attrs.get("title", "")))
    source = tree.attrs.get("source")
    if source not in ("measured", "simulated"):
        what = "missing" if source is None else f"is '{source}'"
        issues.append(Issue("root, attribute 'source'", what, "Set it to 'measured' or 'simulated'"))
    if renamed := [name for name, group in tree.children.items() if "hold" in group.attrs]:
        where = f"group{'s' if len(renamed) > 1 else ''} {', '.join(map(repr, renamed))}, attribute 'hold'"
        issues.append(Issue(where, "no longer read", "Rename it to 'interpolation', or write the file again"))
    if not tree.children:
        issues.append(Issue("root", "no test groups", "Add one group per test, with 'time' and its channels"))
    return tree, issues


def _measurement(
    name: str, group: xr.DataTree, conditions: Mapping[str, float]
) -> tuple[Measurement | None, list[Issue]]:
    where = f"group '{shown(name)}'"
    data = group.to_dataset(inherit=False)
    issues = name_issues(where, "test", [name])
    issues += [
        Issue(where, f"the group '{child}' inside it is not read", "Put every test in a group of its own", "warning")
        for child in group.children
    ]
    if "time" not in data.variables:
        return None, [*issues, Issue(where, "no variable 'time'", "Add the time of every sample in s")]
    numbers = {key: _number(where, key, group.attrs, issues) for key in NUMBERS}
    gaps = _number(where, "gaps", group.attrs, issues)
    kind = _choice(where, "procedure", group.attrs.get("procedure"), EXCITATION_KINDS, issues)
    interpolation = _choice(where, "interpolation", group.attrs.get("interpolation", ""), ("", *INTERPOLATIONS), issues)
    if kind in PERIODIC_EXCITATIONS and "frequency" not in group.attrs:
        message = f"missing on a {kind} test"
        issues.append(Issue(f"{where}, attribute 'frequency'", message, "Add the labelled frequency in Hz", "warning"))
    time, _ = _in_si(where, data["time"], issues) or (None, "s")
    channel_problems: list[Issue] = []
    channels, units = _channels(where, data, channel_problems)
    issues += channel_name_issues(where, [*channels["input"], *channels["output"]], conditions)
    issues += channel_problems
    if time is None:
        issues += channel_issues(where, kind, channels)
    else:
        # a channel with an issue of its own is not also missing
        found = {role: group for role, group in channels.items() if group or not channel_problems}
        issues += experiment_issues(where, kind, time, found, numbers["frequency"])
    if any(issue.severity == "error" for issue in issues) or time is None:
        return None, issues
    experiment = Experiment(name, kind, time, channels["input"], conditions, **numbers, interpolation=interpolation)
    history = str(group.attrs.get("history", ""))
    return Measurement(experiment, channels["output"], units, int(gaps or 0), history), issues


def _channels(
    where: str, data: xr.Dataset, issues: list[Issue]
) -> tuple[dict[str, dict[str, FloatArray]], dict[str, str]]:
    """Input and output channels by role, and the SI unit of each."""
    channels: dict[str, dict[str, FloatArray]] = {"input": {}, "output": {}}
    units = {}
    for variable in data.data_vars.values():
        name = str(variable.name)
        place = f"{where}, variable '{name}'"
        if not variable.dims:
            continue
        if variable.dims != ("time",):
            message = f"lies over {variable.dims}, not over 'time' alone"
            issues.append(Issue(place, message, "Give one value per time stamp"))
            continue
        usual = CHANNELS[name].role if name in CHANNELS else None
        role = variable.attrs.get("role", usual)
        if role in channels:
            if found := _in_si(where, variable, issues):
                channels[role][name], units[name] = found
        elif role is None:
            hint = f"Set role = 'input' or 'output'. {did_you_mean(name, CHANNELS)}"
            issues.append(Issue(place, "has no attribute 'role' and is not a channel that mofit knows", hint))
        else:
            issues.append(Issue(place, f"role '{role}'", "Set role = 'input' or 'output'"))
    return channels, units


def _conditions(where: str, data: xr.Dataset, issues: list[Issue]) -> tuple[dict[str, float], dict[str, str]]:
    """Scalar variables in SI units, and these units."""
    conditions, units = {}, {}
    for variable in data.data_vars.values():
        name = str(variable.name)
        place = f"{where}, variable '{name}'"
        if variable.dims:
            if where == "root":
                issues.append(Issue(place, "a channel outside any test group", "Move it into the group of its test"))
        elif found := _in_si(where, variable, issues):
            if np.isfinite(found[0]):
                conditions[name], units[name] = float(found[0]), found[1]
            else:
                issues.append(Issue(place, f"is {float(found[0])}", "Give a finite number"))
    return conditions, units


def _in_si(where: str, variable: xr.DataArray, issues: list[Issue]) -> tuple[FloatArray, str] | None:
    """Values in the SI unit of a known quantity, or else in that of the variable's unit, and this unit."""
    name, given = str(variable.name), variable.attrs.get("units")
    place = f"{where}, variable '{name}'"
    known = "s" if name == "time" else known_unit(name)
    if given is None:
        issues.append(Issue(f"{place}, attribute 'units'", "missing", f"Add it, e.g. units = '{known or '1'}'"))
        return None
    hint = "Spell the unit like 'N', 'mm', 'km/h', 'N s/m'; '1' for none"
    if known:
        hint = f"Give '{name}' in '{known}' or a unit that converts to it"
    try:
        unit = known or si_unit(str(given))
        return to_si(np.asarray(variable.values, dtype=float), str(given), unit), unit
    except UnitError as error:
        issues.append(Issue(place, str(error), hint))
    except (TypeError, ValueError):
        issues.append(Issue(place, f"holds {variable.dtype}, not numbers", "Store numbers"))
    return None


def _choice(where: str, key: str, value: Any, known: tuple[str, ...], issues: list[Issue]) -> str:
    if value not in known:
        what = "missing" if value is None else f"unknown value '{value}'"
        hint = did_you_mean(str(value or ""), [name for name in known if name])
        issues.append(Issue(f"{where}, attribute '{key}'", what, hint))
    return str(value)


def _number(where: str, key: str, attributes: Mapping[Any, Any], issues: list[Issue]) -> float | None:
    if key not in attributes:
        return None
    try:
        value = float(attributes[key])
        if np.isfinite(value):
            return value
    except (TypeError, ValueError):
        pass
    what = f"'{attributes[key]}' is no finite number"
    issues.append(Issue(f"{where}, attribute '{key}'", what, "Give a number in SI units"))
    return None
