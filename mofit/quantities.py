"""The registry of known physical quantities: channels and conditions, how a test excites a system, how inputs run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Role = Literal["input", "output"]

#: how a test excites the system; ``chirp`` is any sweep, ``free`` any other signal, or none: a free decay
EXCITATION_KINDS = ("step", "ramp", "quasi_static", "sine", "chirp", "multisine", "free")

#: kinds whose signal repeats by design
PERIODIC_EXCITATIONS = ("sine", "multisine")

#: kinds whose input changes once and then stays; it has kinks, so it runs straight between its samples
SINGLE_EXCITATIONS = ("step", "ramp")

#: kinds that need no input channel
UNDRIVEN_EXCITATIONS = ("free",)

#: how an input runs between its samples; held is what a digital controller puts out
HOLD = "hold"
INTERPOLATIONS = ("cubic", "linear", HOLD)


@dataclass(frozen=True)
class PhysicalQuantity:
    """SI unit, a few words for axes and tables, and for a channel its usual role."""

    unit: str
    title: str
    role: Role | None = None


CHANNELS: dict[str, PhysicalQuantity] = {
    "slip_angle": PhysicalQuantity("rad", "slip angle", "input"),
    "turn_slip": PhysicalQuantity("1/m", "turn slip", "input"),
    "lateral_displacement": PhysicalQuantity("m", "lateral displacement", "input"),
    "lateral_force": PhysicalQuantity("N", "lateral force", "output"),
    "slip_ratio": PhysicalQuantity("1", "slip ratio", "input"),
    "longitudinal_displacement": PhysicalQuantity("m", "longitudinal displacement", "input"),
    "longitudinal_force": PhysicalQuantity("N", "longitudinal force", "output"),
    "self_aligning_torque": PhysicalQuantity("N m", "self-aligning torque", "output"),
    "displacement": PhysicalQuantity("m", "displacement", "input"),
    "force": PhysicalQuantity("N", "force", "output"),
    "angle": PhysicalQuantity("rad", "angle", "input"),
    "torque": PhysicalQuantity("N m", "torque", "output"),
    "strain": PhysicalQuantity("1", "strain", "input"),
    "stress": PhysicalQuantity("Pa", "stress", "output"),
    "input_voltage": PhysicalQuantity("V", "input voltage", "input"),
    "output_voltage": PhysicalQuantity("V", "output voltage", "output"),
}

CONDITIONS: dict[str, PhysicalQuantity] = {
    "vertical_force": PhysicalQuantity("N", "vertical force"),
    "longitudinal_velocity": PhysicalQuantity("m/s", "longitudinal velocity"),
    "inflation_pressure": PhysicalQuantity("Pa", "inflation pressure"),
    "nominal_vertical_force": PhysicalQuantity("N", "nominal vertical force"),
    "nominal_inflation_pressure": PhysicalQuantity("Pa", "nominal inflation pressure"),
    "dynamic_rolling_radius": PhysicalQuantity("m", "dynamic rolling radius"),
    "camber_angle": PhysicalQuantity("rad", "camber angle"),
    "wheel_phase": PhysicalQuantity("rad", "angle of the wheel at the first sample"),
    "drum_radius": PhysicalQuantity("m", "radius of the drum"),
    "drum_phase": PhysicalQuantity("rad", "angle of the drum at the first sample"),
    "rotational_speed": PhysicalQuantity("rad/s", "rotational speed"),
    "shaft_angle": PhysicalQuantity("rad", "angle of the shaft at the first sample"),
    "temperature": PhysicalQuantity("K", "temperature"),
    "current": PhysicalQuantity("A", "current"),
    "mass": PhysicalQuantity("kg", "mass"),
    "slip_normalisation": PhysicalQuantity("1", "slip normalisation factor"),
    "fictitious_velocity": PhysicalQuantity("m/s", "velocity that keeps the slip finite at standstill"),
    "averaging_time": PhysicalQuantity("s", "length of the moving average that the record went through"),
}

#: conditions that belong to a channel: without them its tests cannot be compared or modelled
EXPECTED_CONDITIONS: dict[str, tuple[str, ...]] = {
    "slip_angle": ("vertical_force", "longitudinal_velocity", "dynamic_rolling_radius"),
    "slip_ratio": ("vertical_force", "longitudinal_velocity", "dynamic_rolling_radius"),
    "lateral_displacement": ("vertical_force",),
    "longitudinal_displacement": ("vertical_force",),
}


def known_unit(name: str) -> str | None:
    """SI unit of a known channel or condition; None for any other name."""
    quantity = CHANNELS.get(name) or CONDITIONS.get(name)
    return quantity.unit if quantity else None


def title_of(name: str, meaning: str = "") -> str:
    """A few words for axes and tables; for an unknown name its ``meaning``, or else the name with spaces."""
    quantity = CHANNELS.get(name) or CONDITIONS.get(name)
    return quantity.title if quantity else meaning or name.replace("_", " ")
