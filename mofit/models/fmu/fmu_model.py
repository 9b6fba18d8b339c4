"""The model that an FMU is: parameters, channels and conditions from its description and a map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar

from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models.black_box import Simulator
from mofit.models.fmu import REFERENCE
from mofit.models.fmu.description import CO_SIMULATION, FmuDescription, Variable, read_description
from mofit.models.fmu.function import fmu_function
from mofit.models.fmu.mapping import ChannelEntry, FmuMap, FmuMapping, ParameterEntry, Port, read_map
from mofit.models.fmu.units import SiConversion, si_conversion
from mofit.models.model import Channel, Condition
from mofit.parameters import Parameter
from mofit.quantities import known_unit

Entry = TypeVar("Entry", ChannelEntry, ParameterEntry)

#: Parameters that are free where none is named, at most.
_MOST = 12
#: The range of a parameter that has a start value alone: by this factor around it; the search widens it.
_AROUND = 10.0
#: Communication steps per sample of an FMU that holds its inputs during a step, and of one that takes their slopes.
_STEPS, _SLOPING_STEPS = 10, 4


def fmu_model(reference: str) -> Simulator:
    """The model of ``path/to/model.fmu``, with a map and the free parameters if there are any: ``model.fmu:MAP:k,d``.

    Free are by default all real parameters of the FMU that are fixed or tunable; the others keep their start values.

    Raises
    ------
    InputError
        If the FMU or the map cannot be used, with every issue of its names, units and ranges.
    """
    parts = REFERENCE.fullmatch(reference)
    if parts is None:
        raise InputError.of(f"model '{reference}'", "names no FMU", "Give path/to/model.fmu")
    found = read_description(Path(parts["path"]))
    chosen = read_map(Path(parts["map"])) if parts["map"] else FmuMap()
    named = tuple(name.strip() for name in (parts["free"] or "").split(",") if name.strip())
    return _Builder(found, chosen).model(named)


class _Builder:
    """Collects the issues of all names, so that they are told together."""

    def __init__(self, found: FmuDescription, chosen: FmuMap) -> None:
        self.found, self.map = found, chosen
        self.where = f"FMU '{found.path.name}'"
        self.issues: list[Issue] = []

    def model(self, free: Sequence[str]) -> Simulator:
        inputs = self._channels("input", self.map.inputs)
        outputs = self._channels("output", self.map.outputs)
        conditions = [
            (name, entry, self._variable(name, entry.variable, "parameter"))
            for name, entry in _entries(self.map.conditions, ChannelEntry).items()
        ]
        parameters = self._parameters(free)
        groups: dict[str, list[tuple[str, Any, Variable | None]]] = {
            "inputs": inputs,
            "outputs": outputs,
            "conditions": conditions,
            "parameters": parameters,
        }
        ports = {
            kind: tuple(self._port(name, entry, one) for name, entry, one in group if one is not None)
            for kind, group in groups.items()
        }
        made = [self._parameter(name, entry, one) for name, entry, one in parameters if one is not None]
        constants = [(name, self._variable(name, name, "parameter"), value) for name, value in self.map.values.items()]
        interface = self._interface()
        steps = self._steps(interface)
        if not outputs:
            self._issue("it declares no real output", "Name one in the map, under [outputs]")
        raise_errors(self.issues)
        values = tuple((name, one.reference, value) for name, one, value in constants if one is not None)
        mapping = FmuMapping(
            interface,
            ports["inputs"],
            ports["outputs"],
            ports["conditions"],
            ports["parameters"],
            values,
            steps,
            self.found.fixed_step if self.map.steps is None else None,
            self.map.tolerance,
        )
        function = fmu_function(self.found, mapping)
        return Simulator(
            function,
            [one for one in made if one is not None],
            [self._channel(name, entry, one) for name, entry, one in inputs if one is not None],
            [self._channel(name, entry, one) for name, entry, one in outputs if one is not None],
            name=self.found.name,
            conditions=[self._condition(name, entry, one) for name, entry, one in conditions if one is not None],
            fingerprint=function.fingerprint,
        )

    def _issue(self, message: str, hint: str) -> None:
        self.issues.append(Issue(self.where, message, hint))

    def _interface(self) -> str:
        asked = self.map.interface
        if asked is not None and asked not in self.found.interfaces:
            self._issue(f"it offers no {asked}", f"It offers {' and '.join(self.found.interfaces)}")
        return asked or self.found.interfaces[0]

    def _steps(self, interface: str) -> int:
        if interface != CO_SIMULATION or self.map.steps is not None:
            return self.map.steps or 1
        return _STEPS if self.found.holds_inputs else _SLOPING_STEPS

    def _channels(
        self, causality: str, table: Mapping[str, str | ChannelEntry] | None
    ) -> list[tuple[str, ChannelEntry, Variable | None]]:
        if table is None:
            return [(name, ChannelEntry(variable=name), one) for name, one in self.found.those(causality).items()]
        entries = _entries(table, ChannelEntry)
        # any variable that is calculated can be an output
        allowed = ("input",) if causality == "input" else ("output", "local", "calculatedParameter")
        return [(name, entry, self._variable(name, entry.variable, *allowed)) for name, entry in entries.items()]

    def _parameters(self, free: Sequence[str]) -> list[tuple[str, ParameterEntry, Variable | None]]:
        """Those that are free: named ones, else those of the map, else all that the FMU has."""
        mapped = _entries(self.map.parameters, ParameterEntry)
        taken = {*self.map.values, *(entry.variable for entry in _entries(self.map.conditions, ChannelEntry).values())}
        known = {
            name: ParameterEntry(variable=name)
            for name, one in self.found.those("parameter").items()
            if one.variability in ("fixed", "tunable") and name not in taken
        }
        names = free or tuple(mapped) or tuple(known)
        if not free and not mapped and len(known) > _MOST:
            listed = ", ".join(list(known)[:30]) + (" …" if len(known) > 30 else "")
            self._issue(f"it has {len(known)} parameters: {listed}", "Name those to identify, as --free k,d")
            return []
        if not names:
            self._issue("it declares no real parameter", "Export it with parameters that can be set")
        known = {**known, **mapped}
        for name in names:
            if name not in known:
                self._issue(f"it has no parameter '{name}'", did_you_mean(name, known))
        return [(n, known[n], self._variable(n, known[n].variable, "parameter")) for n in names if n in known]

    def _variable(self, name: str, variable: str, *causalities: str) -> Variable | None:
        one = self.found.variables.get(variable)
        if one is None:
            fitting = self.found.those(*causalities)
            self._issue(f"'{name}' is to be its variable '{variable}', which it lacks", did_you_mean(variable, fitting))
        elif one.causality not in causalities:
            fitting = self.found.those(*causalities)
            message = f"'{name}' is to be its {one.causality} variable '{variable}', not a {' or '.join(causalities)}"
            self._issue(message, did_you_mean("", fitting))
            return None
        return one

    def _conversion(self, name: str, entry: ChannelEntry | ParameterEntry, one: Variable) -> SiConversion:
        """To SI; without any unit the FMU is taken to be in SI units."""
        if entry.unit is not None:
            found = si_conversion(entry.unit)
            if found is None:
                self._issue(f"unit '{entry.unit}' of '{name}' is unknown", "Write an SI unit, such as 'N s/m'")
            return found or SiConversion()
        if one.conversion is None and one.unit:
            self._issue(f"unit '{one.unit}' of '{one.name}' is unknown", "Give its unit in the map")
        return one.conversion or SiConversion(known_unit(name) or "1")

    def _port(self, name: str, entry: ChannelEntry | ParameterEntry, one: Variable) -> Port:
        conversion = self._conversion(name, entry, one)
        return Port(name, one.name, one.reference, conversion.factor, conversion.offset)

    def _channel(self, name: str, entry: ChannelEntry, one: Variable) -> Channel:
        return Channel(name, self._conversion(name, entry, one).unit, one.description, entry.derivative_of)

    def _condition(self, name: str, entry: ChannelEntry, one: Variable) -> Condition:
        port, unit = self._port(name, entry, one), self._conversion(name, entry, one).unit
        return Condition(name, unit, None if one.start is None else port.to_si(one.start), one.description)

    def _parameter(self, name: str, entry: ParameterEntry, one: Variable) -> Parameter | None:
        port, unit = self._port(name, entry, one), self._conversion(name, entry, one).unit
        ends = [None if value is None else float(port.to_si(value)) for value in (one.lower, one.upper)]
        low, high = (-math.inf if ends[0] is None else ends[0]), (math.inf if ends[1] is None else ends[1])
        if one.start is None:
            self._issue(f"parameter '{name}' has no start value", "Give it one in the FMU, or leave it out: --free")
            return None
        start = float(port.to_si(one.start))
        box = _box(start, low, high, entry)
        if box is None:
            hint = f"Write [parameters] {name} = {{ variable = '{one.name}', lower = …, upper = … }} in the map"
            self._issue(f"parameter '{name}' starts at {start:g} and has no range", hint)
            return None
        lower, upper, scale = box
        # without a minimum a positive value may have any size, but not another sign
        limits = (max(low, 0.0) if scale == "log" else low, high)
        nominal = min(max(start, lower), upper)
        made = Parameter(name, unit, lower, upper, nominal, scale, one.description, limits=limits)
        self.issues += made.issues()
        return made


def _box(
    start: float, low: float, high: float, entry: ParameterEntry
) -> tuple[float, float, Literal["linear", "log"]] | None:
    """Range and scale of a search: as the map says, else by a factor around the start value, within the limits."""
    bounded = math.isfinite(low) and math.isfinite(high)
    if (start > 0 and low > -math.inf) or (start > 0 and not bounded):
        scale: Literal["linear", "log"] = "log" if low >= 0 or low == -math.inf else "linear"
    else:
        scale = "linear"
    scale = entry.scale or scale
    if entry.lower is not None and entry.upper is not None:
        positive = entry.lower > 0
        return entry.lower, entry.upper, entry.scale or ("log" if positive and scale == "log" else "linear")
    if start == 0 and not bounded:
        return None
    if start == 0:
        lower, upper = low, high
    elif scale == "log":
        lower, upper = max(low, start / _AROUND), min(high, start * _AROUND)
    else:
        lower, upper = max(low, start - _AROUND * abs(start)), min(high, start + _AROUND * abs(start))
    lower = lower if entry.lower is None else entry.lower
    upper = upper if entry.upper is None else entry.upper
    return lower, upper, scale


def _entries(table: Mapping[str, str | Entry], kind: type[Entry]) -> dict[str, Entry]:
    """A table of a map; a text is the name of a variable."""
    return {name: kind(variable=one) if isinstance(one, str) else one for name, one in table.items()}
