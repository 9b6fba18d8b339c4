"""Friction, hysteresis, and damping that is not linear."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Addition, Effect
from mofit.models.model import Applied, Channel, Symbols
from mofit.parameters import Parameter, powers

#: how forces grow with the data, on a tyre with its load, and lengths with those of a damper
FORCE, STROKE = (("force or vertical_force", 1.0),), powers(displacement=1)


def beside_damper(s: Symbols, value: ca.SX, force: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Deflection rate or damper force with a ``force`` [N] beside the damper, and the resulting rate [m/s].

    Where the rate follows from a balance of forces (tyres), the force lowers it by the mobility.
    """
    mobility = s.quantities.get("deflection_mobility")
    if mobility is None:
        return value + force, s.velocity
    rate = value - mobility * force
    return rate, rate


class DryFriction(Effect):
    r"""A force :math:`F_d z` [N] beside the damper, :math:`\delta_d \dot z = \dot y - |\dot y| z`.

    Dahl, "A solid friction model", 1968. Fingerprint: odd harmonics from the third, whatever the frequency, fading
    with amplitude.
    """

    name = "dry_friction"
    title = "dry friction (Dahl)"
    family = "friction"
    on = ("deflection_rate", "damper_force")
    parameters = (
        Parameter("F_d", "N", 0.0, 1e3, 30.0, description="friction force", neutral=0.0, scales=FORCE),
        Parameter(
            "delta_d",
            "m",
            1e-5,
            5e-2,
            2e-3,
            "log",
            "length over which it builds up",
            grid=(5e-5, 5e-4, 2e-3, 8e-3),
            scales=STROKE,
        ),
    )
    states = (Channel("friction", "1", "share of the friction force, z"),)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the friction."""
        changed, rate = beside_damper(s, value, s.F_d * s.friction)
        return Applied(changed, {"friction": (rate - ca.fabs(rate) * s.friction) / s.delta_d})


class BoucWen(Effect):
    r"""A hysteretic force :math:`F_w z` [N] beside the damper.

    .. math::
        \delta_w \dot z = \dot y - \tfrac12 (|\dot y| z + \dot y |z|)

    Wen, J. Eng. Mech. Div. 102 (1976), with exponent 1: unlike Dahl's friction it unloads along a straight line. Few
    data distinguish the two, so a diagnosis tries it only when named.
    """

    name = "bouc_wen"
    title = "hysteresis (Bouc–Wen)"
    family = "friction"
    on = ("deflection_rate", "damper_force")
    parameters = (
        Parameter("F_w", "N", 0.0, 1e3, 30.0, description="yield force of the hysteresis", neutral=0.0, scales=FORCE),
        Parameter("delta_w", "m", 1e-5, 5e-2, 2e-3, "log", "its yield length", grid=(5e-4, 2e-3, 8e-3), scales=STROKE),
    )
    states = (Channel("hysteresis", "1", "share of the yield force, z"),)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the hysteresis."""
        z = s.hysteresis
        changed, rate = beside_damper(s, value, s.F_w * z)
        return Applied(changed, {"hysteresis": (rate - (ca.fabs(rate) * z + rate * ca.fabs(z)) / 2) / s.delta_w})


class CoulombFriction(Addition):
    r"""A force :math:`F_C \tanh(\dot x / v_C)` [N] beside the damper.

    Dry friction (Dahl) with a short build-up length is the same but for the reversals, so a diagnosis tries it only
    when named. Fingerprint: odd harmonics, whatever amplitude and frequency.
    """

    name = "coulomb_friction"
    title = "Coulomb friction"
    family = "friction"
    on = ("damper_force",)
    needs = ("velocity",)
    parameters = (
        Parameter("F_C", "N", 0.0, 1e3, 30.0, description="friction force", neutral=0.0, scales=FORCE),
        Parameter(
            "v_C",
            "m/s",
            1e-5,
            1.0,
            5e-3,
            "log",
            "speed at which it is there",
            grid=(5e-4, 5e-3, 5e-2),
            scales=powers(velocity=1),
        ),
    )
    candidate = False

    def term(self, s: Symbols) -> ca.SX:
        """Friction force."""
        return s.F_C * ca.tanh(s.velocity / s.v_C)


class QuadraticDamping(Effect):
    r"""A force :math:`d_2 \dot y |\dot y|` [N] beside the damper. Fingerprint: third harmonic, grows with f².

    Where the rate follows from a balance of forces (tyres: :math:`\dot y_0 = \mu R` with the mobility :math:`\mu`),
    it solves :math:`\dot y + \mu d_2 \dot y |\dot y| = \dot y_0`, that is
    :math:`\dot y = 2 \dot y_0 / (1 + \sqrt{1 + 4 \mu d_2 |\dot y_0|})`.
    """

    name = "quadratic_damping"
    title = "quadratic damping"
    family = "non-linear damping"
    on = ("deflection_rate", "damper_force")
    parameters = (
        Parameter(
            "d_2",
            "N s^2/m^2",
            0.0,
            1e5,
            300.0,
            description="quadratic damping",
            neutral=0.0,
            scales=powers(force=1, velocity=-2),
        ),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Rate or damper force with the quadratic force."""
        mobility = s.quantities.get("deflection_mobility")
        if mobility is None:
            return Applied(value + s.d_2 * s.velocity * ca.fabs(s.velocity))
        return Applied(2 * value / (1 + ca.sqrt(1 + 4 * mobility * s.d_2 * ca.fabs(value))))
