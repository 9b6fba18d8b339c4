"""Second-order oscillators driven by a force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols


class Oscillator(Model):
    r"""Mass, damper and spring, :math:`m \ddot x + d \dot x + k x = F`.

    Force [N] in, displacement [m] out; positive together. States: displacement [m] and velocity [m/s], at rest at
    the start.
    """

    name = "oscillator"
    title = "linear oscillator"
    parameters = (
        Parameter("m", "kg", 1e-6, 1e4, 1.0, "log", "mass"),
        Parameter("d", "N s/m", 1e-6, 1e6, 1.0, "log", "damping"),
        Parameter("k", "N/m", 1e-3, 1e8, 1e2, "log", "stiffness"),
    )
    states = (Channel("position", "m", "displacement of the mass"), Channel("velocity", "m/s", "velocity of the mass"))
    inputs = (Channel("force", "N", "driving force"),)
    outputs = (Channel("displacement", "m", "displacement of the mass"),)

    def spring_force(self, s: Symbols, x: ca.SX) -> ca.SX:
        """Force of the spring [N] at displacement ``x`` [m]."""
        return s.k * x

    def equations(self, s: Symbols) -> Equations:
        """Newton's law."""
        x = s.quantity("deflection", s.position)
        spring = s.quantity("spring_force", self.spring_force(s, x))
        damper = s.quantity("damper_force", s.d * s.velocity)
        return Equations(
            outputs={"displacement": s.position},
            rates={"position": s.velocity, "velocity": (s.force - spring - damper) / s.m},
        )


class DuffingOscillator(Oscillator):
    r"""Oscillator with a cubic and a quadratic spring, :math:`m \ddot x + d \dot x + k x + k_2 x^2 + k_3 x^3 = F`.

    The standard non-linear oscillator, so a model of its own; it equals `Oscillator` with the effects
    ``cubic_stiffness`` and a quadratic term. Its baseline is the linear oscillator.
    """

    name = "duffing_oscillator"
    title = "Duffing oscillator"
    parameters = (
        *Oscillator.parameters,
        Parameter("k_2", "N/m2", -1e4, 1e4, 0.0, description="quadratic stiffness"),
        Parameter("k_3", "N/m3", -1e5, 1e5, 0.0, description="cubic stiffness; positive: hardening"),
    )
    baseline = "oscillator"

    def spring_force(self, s: Symbols, x: ca.SX) -> ca.SX:
        """Force of the spring [N] at displacement ``x`` [m]."""
        return s.k * x + s.k_2 * x**2 + s.k_3 * x**3
