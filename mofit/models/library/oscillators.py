"""Second-order oscillators driven by a force."""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca
import numpy as np

from mofit.models.model import Channel, Equations, Model, Symbols
from mofit.parameters import Parameter, powers

#: how a frequency grows with the sampling interval
RATE = powers(sample_interval=-1)


class Oscillator(Model):
    r"""Mass, damper and spring, :math:`m \ddot x + d \dot x + k x = F`, by stiffness, frequency and damping ratio.

    .. math::
        \ddot x = \omega_0^2 \, \frac{F - k x}{k} - 2 \zeta \omega_0 \dot x, \qquad
        \omega_0 = 2 \pi f_0 = \sqrt{k / m}, \quad \zeta = \frac{d}{2 \sqrt{k m}}

    Force [N] in, displacement [m] out with the offset :math:`x_0` of its transducer; positive together. States:
    position [m] and velocity [m/s], at rest at the start. Frequency and damping ratio are read off a response
    almost independently, which mass and damping are not.
    """

    name = "oscillator"
    title = "linear oscillator"
    parameters: tuple[Parameter, ...] = (
        Parameter("k", "N/m", 1e-2, 1e4, 10.0, "log", "stiffness", scales=powers(force=1, displacement=-1)),
        Parameter("f_0", "Hz", 0.1, 1e3, 10.0, "log", "natural frequency without damping", scales=RATE),
        Parameter("zeta", "1", 1e-3, 2.0, 0.05, "log", "damping ratio"),
        Parameter(
            "x_0",
            "m",
            -0.1,
            0.1,
            0.0,
            description="offset of the displacement transducer",
            scales=powers(displacement=1),
        ),
    )
    states = (Channel("position", "m", "displacement of the mass"), Channel("velocity", "m/s", "velocity of the mass"))
    inputs = (Channel("force", "N", "driving force"),)
    outputs = (Channel("displacement", "m", "measured displacement of the mass"),)
    typical = MappingProxyType({"force": 1.0, "displacement": 0.1, "sample_interval": 5e-4})

    def spring_force(self, s: Symbols, x: ca.SX) -> ca.SX:
        """Force of the spring [N] at deflection ``x`` [m]."""
        return s.k * x

    def equations(self, s: Symbols) -> Equations:
        """Newton's law."""
        omega = 2 * np.pi * s.f_0
        spring = s.quantity("spring_force", self.spring_force(s, s.quantity("deflection", s.position)))
        damper = s.quantity("damper_force", 2 * s.zeta * s.k / omega * s.velocity)
        return Equations(
            outputs={"displacement": s.position + s.x_0},
            derivatives={"position": s.velocity, "velocity": omega**2 / s.k * (s.force - spring - damper)},
        )


class DuffingOscillator(Oscillator):
    r"""Oscillator with a quadratic and a cubic spring: :math:`k x + k_2 x^2 + k_3 x^3` in place of :math:`k x`.

    The standard non-linear oscillator, hence a model of its own rather than effects put together; its baseline is
    the linear oscillator.
    """

    name = "duffing_oscillator"
    title = "Duffing oscillator"
    parameters = (
        *Oscillator.parameters,
        Parameter(
            "k_2", "N/m^2", -1e3, 1e3, 0.0, description="quadratic stiffness", scales=powers(force=1, displacement=-2)
        ),
        Parameter(
            "k_3",
            "N/m^3",
            -2e3,
            1e4,
            0.0,
            description="cubic stiffness; positive: hardening",
            scales=powers(force=1, displacement=-3),
        ),
    )
    baseline = "oscillator"

    def spring_force(self, s: Symbols, x: ca.SX) -> ca.SX:
        """Force of the spring [N] at deflection ``x`` [m]."""
        return s.k * x + s.k_2 * x**2 + s.k_3 * x**3
