"""A banded friction damper: identified on sine strokes, an earthquake predicted."""

from __future__ import annotations

from functools import partial

import casadi as ca

from mofit.models import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter
from records_cases.case import Case, imported

#: speed below which |v| is round, m/s
SLOW = 1e-4


class DahlDamper(Model):
    """F = F_y (1 + a z) z + c x + d v + F_0 with delta z' = v - |v| z: friction builds up over the length delta.

    Dahl, "Solid friction damping of mechanical vibrations", AIAA Journal 14 (1976), with exponent 1. The force of the
    two directions differs by the factor (1 + a) / (1 - a).
    """

    name = "dahl_damper"
    title = "Dahl damper"
    parameters = (
        Parameter("F_y", "N", 1e2, 1e5, 1e4, "log", "friction"),
        Parameter("a", "1", -0.5, 0.5, 0.0, description="difference of the two directions"),
        Parameter("delta", "m", 1e-5, 1e-1, 1e-3, "log", "length over which friction builds up"),
        Parameter("c", "N/m", -1e5, 1e5, 0.0, description="stiffness in parallel"),
        Parameter("d", "N s/m", 0.0, 1e5, 1e3, description="damping in parallel"),
        Parameter("F_0", "N", -5e3, 5e3, 0.0, description="constant force"),
    )
    states = (Channel("share", "1", "share of the friction that has built up"),)
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)
    baseline = "kelvin_voigt_damper"

    def equations(self, s: Symbols) -> Equations:
        """One state."""
        v = s.velocity
        friction = s.quantity("hysteretic_force", s.F_y * (1 + s.a * s.share) * s.share)
        linear = s.quantity("spring_force", s.c * s.displacement) + s.quantity("damper_force", s.d * v)
        speed = ca.sqrt(v**2 + SLOW**2)
        return Equations(
            outputs={"force": friction + linear + s.F_0},
            derivatives={"share": (v - speed * s.share) / s.delta},
        )


CASES = (
    Case(
        "friction", "Friction damper", DahlDamper, partial(imported, name="friction_damper"),
        lambda test: test.startswith("sine"), ("earthquake",), ("kN", 1e-3),
        "at most 6 % NRMSD on the earthquake, with a band that covers (Kelvin–Voigt: 8.3 %, another Dahl model: 4.9 %)",
    ),
)  # fmt: skip
