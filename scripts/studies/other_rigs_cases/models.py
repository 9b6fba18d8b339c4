"""The files that the users of joint and structure wrote: their equations, with ranges around the drawing's values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from other_rigs_cases.rig import Units

JOINT = '''"""Motor, gear and link of a joint."""

from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Joint(Model):
    """Torque of the motor in, its speed out; the link hangs on the gear's stiffness."""

    name = "joint"
    title = "robot joint"
    parameters = (
{parameters}
    )
    states = (Channel("twist", "rad"), Channel("velocity", "rad/s"), Channel("link_speed", "rad/s"))
    inputs = (Channel("motor_torque", "N m"),)
    outputs = (Channel("motor_speed", "rad/s"),)

    def equations(self, s):
        """Two inertias."""
        twist = s.quantity("deflection", s.twist)
        gear = s.quantity("spring_force", s.k * twist) + s.d * (s.velocity - s.link_speed)
        bearing = s.quantity("damper_force", s.b * s.velocity)
        rates = {{
            "twist": s.velocity - s.link_speed,
            "velocity": (s.motor_torque - bearing - gear) / s.J,
            "link_speed": gear / s.J_l,
        }}
        return Equations(outputs={{"motor_speed": s.velocity}}, derivatives=rates)
'''

STRUCTURE = '''"""Two masses on springs."""

from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Structure(Model):
    """Force on the first mass in, its acceleration out; the second mass hangs on the first."""

    name = "structure"
    title = "structure of two modes"
    parameters = (
{parameters}
    )
    states = (
        Channel("displacement_1", "m"),
        Channel("velocity", "m/s"),
        Channel("displacement_2", "m"),
        Channel("velocity_2", "m/s"),
    )
    inputs = (Channel("force", "N"),)
    outputs = (Channel("acceleration", "m/s^2"),)

    def equations(self, s):
        """Newton's law, twice."""
        x = s.quantity("deflection", s.displacement_1)
        ground = s.quantity("spring_force", s.k_1 * x) + s.quantity("damper_force", s.d_1 * s.velocity)
        between = s.k_2 * (s.displacement_1 - s.displacement_2) + s.d_2 * (s.velocity - s.velocity_2)
        acceleration = (s.force - ground - between) / s.m_1
        rates = {{
            "displacement_1": s.velocity,
            "velocity": acceleration,
            "displacement_2": s.velocity_2,
            "velocity_2": between / s.m_2,
        }}
        return Equations(outputs={{"acceleration": acceleration}}, derivatives=rates)
'''
#: how far a user's guess is from the value, and how far the range reaches from the guess, as factors
GUESS, REACH = 1.3, 8.0


def joint_source(values: Mapping[str, float], units: Units, rng: np.random.Generator) -> str:
    """Model file of a joint."""
    damping = units.input / units.output
    size = {
        "J": damping * units.time,
        "J_l": damping * units.time,
        "k": damping / units.time,
        "b": damping,
        "d": damping,
    }
    named = {"J": "kg m^2", "J_l": "kg m^2", "k": "N m", "b": "N m s", "d": "N m s"}
    return JOINT.format(parameters=_parameters(values, size, named, rng))


def structure_source(values: Mapping[str, float], units: Units, rng: np.random.Generator) -> str:
    """Model file of a structure."""
    mass = units.input / units.output
    powers = {"m": (mass, "kg"), "d": (mass / units.time, "N s/m"), "k": (mass / units.time**2, "N/m")}
    size = {name: powers[name[0]][0] for name in values}
    return STRUCTURE.format(parameters=_parameters(values, size, {n: powers[n[0]][1] for n in values}, rng))


def _parameters(
    values: Mapping[str, float], size: Mapping[str, float], units: Mapping[str, str], rng: np.random.Generator
) -> str:
    lines = []
    for name, unit in units.items():
        guess = values[name] * size[name] * GUESS ** rng.uniform(-1, 1)
        low, high = f"{guess / REACH:.4g}", f"{guess * REACH:.4g}"
        lines.append(f'        Parameter("{name}", "{unit}", {low}, {high}, {guess:.4g}, "log"),')
    return "\n".join(lines)
