"""The files of a system: a model as a user writes it, and a campaign by mofit's public writer."""

from __future__ import annotations

import re
from pathlib import Path
from threading import Lock

from mofit import Campaign, Experiment, Measurement
from mofit.data.campaign_file import write_campaign
from systems.design import System
from systems.family import Loose, Split

#: netCDF's C library serves one thread at a time
_NETCDF = Lock()

MODEL = '''"""{title}."""

import casadi as ca

from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class {classname}(Model):
    """{title}."""

    name = "{name}"
    title = "{title}"
    parameters = (
{parameters}
    )
    states = ({states})
    inputs = ({inputs})
    outputs = ({outputs})

    def equations(self, s):
        """The equations."""
{lines}
        return Equations(
            outputs={{{response}}},
            derivatives={{{rates}}},
            initial={{{start}}},
        )
'''


def class_name(system: System) -> str:
    """Name of the model's class."""
    return "".join(word.capitalize() for word in system.case.family.name.split("_"))


def outputs_of(system: System) -> tuple[tuple[str, str], ...]:
    """Outputs that the test bench measures, with their units."""
    ridge, every = system.case.ridge, system.case.family.outputs
    kept = ridge.outputs if isinstance(ridge, Loose) else ()
    return tuple(pair for pair in every if not kept or pair[0] in kept)


def model_source(system: System) -> str:
    """Source of the model file."""
    family, outputs = system.case.family, outputs_of(system)
    source = {name: family.text[name] for name in (*(name for name, _ in family.states), *(n for n, _ in outputs))}
    used = set(re.findall(r"[A-Za-z_]\w*", " ".join([*source.values(), *family.start.values()])))
    known = [name for name, _ in (*family.states, *family.inputs)]
    lines = [f"{name} = s.{name}" for name in (*system.truth, *known) if name in used]
    if isinstance(ridge := system.case.ridge, Split):
        one, two = ridge.tied
        lines.append(f"{ridge.of} = s.{one} {ridge.sign} s.{two}")
    lines += [f"{k} = {v!r}" for k, v in system.draw.constants.items() if k in used and k not in system.truth]
    (first, *more) = family.inputs
    inputs = [_channel(*first), *(_channel(name, unit, first[0]) for name, unit in more)]
    return MODEL.format(
        classname=class_name(system),
        title=family.title,
        name=family.name,
        parameters="\n".join(f"        {_parameter(system, name)}," for name in system.truth),
        states="".join(f"{_channel(*pair)}, " for pair in family.states),
        inputs="".join(f"{channel}, " for channel in inputs),
        outputs="".join(f"{_channel(*pair)}, " for pair in outputs),
        lines="\n".join(f"        {line}" for line in lines),
        response=", ".join(f'"{name}": {source[name]}' for name, _ in outputs),
        rates=", ".join(f'"{name}": {source[name]}' for name, _ in family.states),
        start=", ".join(f'"{name}": {value}' for name, value in family.start.items()),
    )


def _channel(name: str, unit: str, derivative_of: str = "") -> str:
    of = f', derivative_of="{derivative_of}"' if derivative_of else ""
    return f'Channel("{name}", "{unit}"{of})'


def _parameter(system: System, name: str) -> str:
    low, high = system.boxes[name]
    unit = system.case.family.units.get(name, "1")
    if name in system.draw.boxes:
        return f'Parameter("{name}", "{unit}", {low!r}, {high!r}, {0.5 * (low + high)!r})'
    return f'Parameter("{name}", "{unit}", {low!r}, {high!r}, {(low * high) ** 0.5!r}, "log")'


def campaign_of(system: System) -> Campaign:
    """The campaign."""
    family, outputs = system.case.family, outputs_of(system)
    (name, unit), *_ = family.inputs
    units = {name: unit, **dict(outputs)}
    measurements = []
    for test, record in zip(system.tests, system.records, strict=True):
        about = {"frequency": test.frequency, "amplitude": test.amplitude}
        experiment = Experiment(test.name, test.kind, test.time, {name: test.value(test.time)}, **about)
        measured = {channel: row for (channel, _), row in zip(outputs, record, strict=True)}
        measurements.append(Measurement(experiment, measured, units))
    return Campaign(system.case.family.title, "simulated", {}, tuple(measurements))


def write_files(system: System, folder: Path) -> tuple[Path, str]:
    """Write campaign and model; returns the campaign's path and the model as ``--model`` takes it."""
    folder.mkdir(parents=True, exist_ok=True)
    source, campaign = folder / "model.py", folder / "campaign.nc"
    source.write_text(model_source(system), encoding="utf-8")
    with _NETCDF:
        write_campaign(campaign_of(system), campaign)
    return campaign, f"{source}:{class_name(system)}"
