"""The campaign file ``mofit.campaign/1``: netCDF-4, one group per test (see docs/campaigns.md)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mofit.campaign import Array, Campaign, Measurement, Procedure
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.labels import CHANNELS, HOLDS, KINDS, PERIODIC_KINDS, known_unit, title_of
from mofit.netcdf import read_tree
from mofit.units import UnitError, si_unit, to_si
from mofit.validity import channel_faults, role_faults, time_faults, whole_period_faults

SCHEMA = "mofit.campaign/1"
_NUMBERS = ("frequency", "amplitude", "start_time", "transient")
_NOT_FREE_TEXT = ("schema", "title", "source")


def read_campaign(path: str | Path) -> Campaign:
    """Read a campaign file, everything in SI units.

    Raises
    ------
    InputError
        With all errors of the file together.
    """
    campaign, faults = load(path)
    raise_errors(faults)
    assert campaign is not None
    return campaign


def load(path: str | Path) -> tuple[Campaign | None, list[Fault]]:
    """Read as much as can be read: the campaign of all sound tests (None if there is none) and every fault."""
    tree, faults = _open(Path(path))
    if tree is None:
        return None, faults
    source = str(tree.attrs.get("source", ""))
    conditions, units = _conditions("root", tree.to_dataset(), faults)
    measurements = []
    for name, group in tree.children.items():
        own, own_units = _conditions(f"group '{name}'", group.to_dataset(inherit=False), faults)
        measurement, found = _measurement(name, group, {**conditions, **own})
        units |= own_units
        faults += found
        if measurement is not None:
            measurements.append(measurement)
    if not measurements or source not in ("measured", "simulated"):
        return None, faults
    attributes = {str(key): _plain(value) for key, value in tree.attrs.items() if key not in _NOT_FREE_TEXT}
    title = str(tree.attrs.get("title", Path(path).stem))
    return Campaign(title, source, conditions, tuple(measurements), attributes, units), faults


def write_campaign(campaign: Campaign, path: str | Path) -> None:
    """Write a campaign file whole or not at all: under a temporary name beside it, then renamed.

    The same campaign gives the same bytes.

    Raises
    ------
    InputError
        If the folder is not there or cannot be written to.
    """
    path = Path(path)
    if not os.access(path.parent, os.W_OK):
        raise InputError.of(f"file '{path}'", "its folder is not there or not writable", "Name another folder")
    tree = _tree(campaign)
    packed = {"zlib": True, "complevel": 4, "shuffle": True}
    encoding = {f"/{name}": dict.fromkeys(group.variables, packed) for name, group in tree.children.items()}
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        tree.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _open(path: Path) -> tuple[xr.DataTree | None, list[Fault]]:
    """The tree in memory, and what is wrong with the file as a whole."""
    where = f"file '{path.name}'"
    if not path.is_file():
        return None, [Fault(where, f"there is no file '{path}'", "Check the path")]
    if path.stat().st_size == 0:
        return None, [Fault(where, "the file has zero length", "Write or copy it again")]
    try:
        tree = read_tree(path, decode_times=False)
    except Exception as error:  # noqa: BLE001  a damaged file raises anything, from OSError to RuntimeError
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        what = f"not a readable netCDF-4 file: truncated, damaged or of another kind ({reason})"
        return None, [Fault(where, what, "Write or copy it again; convert other formats with 'mofit import'")]
    faults = []
    schema = tree.attrs.get("schema")
    if schema is None:
        faults.append(Fault("root, attribute 'schema'", "missing", f"Set it to '{SCHEMA}'"))
    elif schema != SCHEMA:
        cure = f"This version reads '{SCHEMA}'; write the file in that schema"
        return None, [Fault("root, attribute 'schema'", f"unknown schema '{schema}'", cure)]
    if not tree.attrs.get("title"):
        faults.append(Fault("root, attribute 'title'", "missing", "Say in a few words what was tested", "warning"))
    source = tree.attrs.get("source")
    if source not in ("measured", "simulated"):
        what = "missing" if source is None else f"is '{source}'"
        faults.append(Fault("root, attribute 'source'", what, "Say 'measured' or 'simulated'"))
    if not tree.children:
        faults.append(Fault("root", "no test groups", "Add one group per test, with 'time' and its channels"))
    return tree, faults


def _measurement(
    name: str, group: xr.DataTree, conditions: Mapping[str, float]
) -> tuple[Measurement | None, list[Fault]]:
    where = f"group '{name}'"
    data = group.to_dataset(inherit=False)
    faults = [
        Fault(where, f"the group '{child}' inside it is not read", "Put every test in a group of its own", "warning")
        for child in group.children
    ]
    if "time" not in data.variables:
        return None, [*faults, Fault(where, "no variable 'time'", "Add the time of every sample in s")]
    numbers = {key: _number(where, key, group.attrs, faults) for key in _NUMBERS}
    gaps = _number(where, "gaps", group.attrs, faults)
    kind = _choice(where, "procedure", group.attrs.get("procedure"), KINDS, faults)
    hold = _choice(where, "hold", group.attrs.get("hold", ""), ("", *HOLDS), faults)
    if kind in PERIODIC_KINDS and "frequency" not in group.attrs:
        what = f"missing on a {kind} test"
        faults.append(Fault(f"{where}, attribute 'frequency'", what, "Add the labelled frequency in Hz", "warning"))
    time = _values(where, data["time"], "s", faults)
    channel_problems: list[Fault] = []
    channels, units = _channels(where, data, channel_problems)
    # a channel with a fault of its own is not also missing
    faults += channel_problems or role_faults(where, channels["input"], channels["output"])
    if time is not None:
        bad_time = time_faults(where, time)
        faults += bad_time
        if not bad_time:
            faults += whole_period_faults(where, kind, time, numbers["frequency"])
    faults += channel_faults(where, kind, channels["input"], channels["output"])
    if any(fault.severity == "error" for fault in faults) or time is None:
        return None, faults
    procedure = Procedure(name, kind, time, channels["input"], conditions, **numbers, hold=hold)
    return Measurement(procedure, channels["output"], units, int(gaps or 0)), faults


def _channels(where: str, data: xr.Dataset, faults: list[Fault]) -> tuple[dict[str, dict[str, Array]], dict[str, str]]:
    """Input and output channels by role, and the SI unit of each."""
    channels: dict[str, dict[str, Array]] = {"input": {}, "output": {}}
    units = {}
    for variable in data.data_vars.values():
        name = str(variable.name)
        place = f"{where}, variable '{name}'"
        if not variable.dims:
            continue
        if variable.dims != ("time",):
            what = f"lies over {variable.dims}, not over 'time' alone"
            faults.append(Fault(place, what, "Give one value per time stamp"))
            continue
        usual = CHANNELS[name].role if name in CHANNELS else None
        role = variable.attrs.get("role", usual)
        if role not in channels:
            what = "has no attribute 'role' and is not a channel that mofit knows" if role is None else f"role '{role}'"
            guess = f". {did_you_mean(name, CHANNELS)}" if role is None else ""
            faults.append(Fault(place, what, f"Set role = 'input' or 'output'{guess}"))
            continue
        unit = _unit_of(place, name, variable, faults)
        values = _values(where, variable, unit, faults) if unit else None
        if unit and values is not None:
            channels[role][name], units[name] = values, unit
    return channels, units


def _conditions(where: str, data: xr.Dataset, faults: list[Fault]) -> tuple[dict[str, float], dict[str, str]]:
    """Scalar variables in SI units, and these units."""
    conditions, units = {}, {}
    for variable in data.data_vars.values():
        name = str(variable.name)
        place = f"{where}, variable '{name}'"
        if variable.dims:
            if where == "root":
                faults.append(Fault(place, "a channel outside any test group", "Move it into the group of its test"))
            continue
        unit = _unit_of(place, name, variable, faults)
        values = _values(where, variable, unit, faults) if unit else None
        if unit is None or values is None:
            continue
        if not np.isfinite(values):
            faults.append(Fault(place, f"is {float(values)}", "Give a finite number"))
            continue
        conditions[name], units[name] = float(values), unit
    return conditions, units


def _unit_of(place: str, name: str, variable: xr.DataArray, faults: list[Fault]) -> str | None:
    """SI unit that a variable is to be read in; a missing or impossible one is a fault."""
    unit, known = variable.attrs.get("units"), known_unit(name)
    if unit is None:
        cure = f"Add it, e.g. units = '{known or '1'}'"
        faults.append(Fault(f"{place}, attribute 'units'", "missing", cure))
        return None
    try:
        return known or si_unit(str(unit))
    except UnitError as error:
        faults.append(Fault(place, str(error), "Spell the unit like 'N', 'mm', 'km/h', 'N s/m'; '1' for none"))
        return None


def _values(where: str, variable: xr.DataArray, unit: str, faults: list[Fault]) -> Array | None:
    place = f"{where}, variable '{variable.name}'"
    given = variable.attrs.get("units")
    if given is None:  # only time comes here without one
        faults.append(Fault(f"{place}, attribute 'units'", "missing", f"Add units = '{unit}'"))
        return None
    try:
        return to_si(np.asarray(variable.values, dtype=float), str(given), unit)
    except UnitError as error:
        faults.append(Fault(place, str(error), f"Give '{variable.name}' in '{unit}' or a unit that converts to it"))
    except (TypeError, ValueError):
        faults.append(Fault(place, f"holds {variable.dtype}, not numbers", "Store numbers"))
    return None


def _choice(where: str, key: str, value: Any, known: tuple[str, ...], faults: list[Fault]) -> str:
    if value not in known:
        what = "missing" if value is None else f"unknown value '{value}'"
        cure = did_you_mean(str(value or ""), [name for name in known if name])
        faults.append(Fault(f"{where}, attribute '{key}'", what, cure))
    return str(value)


def _number(where: str, key: str, attributes: Mapping[Any, Any], faults: list[Fault]) -> float | None:
    if key not in attributes:
        return None
    try:
        value = float(attributes[key])
        if np.isfinite(value):
            return value
    except (TypeError, ValueError):
        pass
    what = f"'{attributes[key]}' is no finite number"
    faults.append(Fault(f"{where}, attribute '{key}'", what, "Give a number in SI units"))
    return None


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value.tolist() if isinstance(value, np.ndarray) else value


def _tree(campaign: Campaign) -> xr.DataTree:
    extra = {k: v if isinstance(v, str | int | float) else str(v) for k, v in campaign.attributes.items()}
    attributes = {**extra, "schema": SCHEMA, "title": campaign.title, "source": campaign.source}
    groups = {"/": xr.Dataset(_scalars(campaign.conditions, campaign.units), attrs=attributes)}
    for measurement in campaign.measurements:
        procedure = measurement.procedure
        variables: dict[str, Any] = {}
        for role, channels in (("input", procedure.inputs), ("output", measurement.outputs)):
            for name, values in channels.items():
                about = {"units": measurement.units[name], "role": role, "long_name": title_of(name)}
                variables[name] = ("time", values, about)
        own = {name: v for name, v in procedure.conditions.items() if campaign.conditions.get(name) != v}
        numbers = {key: getattr(procedure, key) for key in _NUMBERS}
        groups[f"/{procedure.name}"] = xr.Dataset(
            {**variables, **_scalars(own, campaign.units)},
            coords={"time": ("time", procedure.time, {"units": "s", "long_name": "time"})},
            attrs={"procedure": procedure.kind, "hold": procedure.hold}
            | {key: value for key, value in numbers.items() if value is not None}
            | ({"gaps": measurement.gaps} if measurement.gaps else {}),
        )
    return xr.DataTree.from_dict(groups)


def _scalars(conditions: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Any]:
    return {
        name: ((), float(value), {"units": units.get(name) or known_unit(name) or "1", "long_name": title_of(name)})
        for name, value in conditions.items()
    }
