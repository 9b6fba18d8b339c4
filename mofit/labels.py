"""Names that mofit knows: channels, conditions and kinds of procedure, with SI unit and meaning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Role = Literal["input", "output"]

#: how a system can be excited; ``free`` is any other signal
KINDS = ("step", "quasi_static", "sine", "chirp", "multisine", "free")

#: kinds whose signal repeats by design
PERIODIC_KINDS = ("sine", "multisine")

#: how an input runs between its samples
HOLDS = ("cubic", "linear")


@dataclass(frozen=True)
class Label:
    """Meaning of a name: SI unit, a few words for axes, and for channels the usual role."""

    unit: str
    title: str
    role: Role | None = None


CHANNELS: dict[str, Label] = {
    "slip_angle": Label("rad", "slip angle", "input"),
    "lateral_displacement": Label("m", "lateral displacement", "input"),
    "lateral_force": Label("N", "lateral force", "output"),
    "self_aligning_torque": Label("N m", "self-aligning torque", "output"),
    "displacement": Label("m", "displacement", "input"),
    "force": Label("N", "force", "output"),
    "angle": Label("rad", "angle", "input"),
    "torque": Label("N m", "torque", "output"),
    "strain": Label("1", "strain", "input"),
    "stress": Label("Pa", "stress", "output"),
    "input_voltage": Label("V", "input voltage", "input"),
    "output_voltage": Label("V", "output voltage", "output"),
}

CONDITIONS: dict[str, Label] = {
    "vertical_force": Label("N", "vertical force"),
    "longitudinal_velocity": Label("m/s", "longitudinal velocity"),
    "inflation_pressure": Label("Pa", "inflation pressure"),
    "dynamic_rolling_radius": Label("m", "dynamic rolling radius"),
    "camber_angle": Label("rad", "camber angle"),
    "wheel_phase": Label("rad", "angle of the wheel at the first sample"),
    "drum_radius": Label("m", "radius of the drum"),
    "drum_phase": Label("rad", "angle of the drum at the first sample"),
    "temperature": Label("K", "temperature"),
    "current": Label("A", "current"),
    "mass": Label("kg", "mass"),
    "slip_normalisation": Label("1", "slip normalisation factor"),
    "fictitious_velocity": Label("m/s", "velocity that keeps the slip finite at standstill"),
    "averaging_time": Label("s", "length of the moving average that the record went through"),
}

#: conditions that belong to a channel: without them its tests cannot be compared or modelled
EXPECTED_CONDITIONS: dict[str, tuple[str, ...]] = {
    "slip_angle": ("vertical_force", "longitudinal_velocity", "dynamic_rolling_radius"),
    "lateral_displacement": ("vertical_force",),
}


def known_unit(name: str) -> str | None:
    """SI unit of a known channel or condition; None for any other name."""
    label = CHANNELS.get(name) or CONDITIONS.get(name)
    return label.unit if label else None


def title_of(name: str, meaning: str = "") -> str:
    """A few words for axes and tables; for an unknown name its ``meaning``, or else the name with spaces."""
    label = CHANNELS.get(name) or CONDITIONS.get(name)
    return label.title if label else meaning or name.replace("_", " ")
