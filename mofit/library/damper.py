"""Dampers driven by a displacement: Kelvin–Voigt and Maxwell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import Channel, Equations, Model
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

DAMPER_INPUTS = (
    Channel("displacement", "m", "stroke; positive in extension or compression, as the force"),
    Channel("velocity", "m/s", "rate of the stroke", derivative_of="displacement"),
)
DAMPER_OUTPUTS = (Channel("force", "N", "force on the moved end, positive with the displacement"),)

STIFFNESS = Parameter("c", "N/m", 0.0, 1e4, 500.0, description="stiffness at small stroke")
# not relative to c as the tyre's p_y is: where c is 0 a relative one means nothing, and the posterior has a ridge
PROGRESSION = Parameter("p", "N/m^2", -1e6, 1e6, 0.0, description="change of stiffness with stroke")
DAMPING = Parameter("d", "N s/m", 1.0, 1e6, 1e3, "log", "damping")
OFFSET = Parameter("F_0", "N", -500.0, 500.0, 0.0, description="constant force (gas pressure, transducer offset)")


def parallel_force(s: Symbols, x: ca.SX) -> ca.SX:
    r"""Spring and damper in parallel and an offset: :math:`(c + p |x|) x + d \dot x + F_0` [N].

    Announces ``spring_force`` and ``damper_force``.
    """
    spring = s.quantity("spring_force", (s.c + s.p * ca.fabs(x)) * x)
    return spring + s.quantity("damper_force", s.d * s.velocity) + s.F_0


class KelvinVoigtDamper(Model):
    r"""Spring and damper in parallel, :math:`F = (c + p |x|) x + d \dot x + F_0`.

    Displacement :math:`x` [m] in (its rate by a smoothing spline), force [N] out; positive together.
    """

    name = "kelvin_voigt_damper"
    title = "Kelvin–Voigt damper"
    parameters = (STIFFNESS, PROGRESSION, DAMPING, OFFSET)
    inputs = DAMPER_INPUTS
    outputs = DAMPER_OUTPUTS

    def equations(self, s: Symbols) -> Equations:
        """No state: the force follows displacement and velocity at once."""
        return Equations(outputs={"force": parallel_force(s, s.quantity("deflection", s.displacement))})


class MaxwellDamper(Model):
    r"""Kelvin–Voigt damper with one Maxwell branch in parallel.

    .. math::
        F = (c + p |x|) x + d \dot x + c_M (x - x_M) + F_0, \qquad d_M \dot x_M = c_M (x - x_M)

    Displacement :math:`x` [m] in, force [N] out; positive together. State: internal displacement :math:`x_M` [m] of
    the branch, relaxed at the start. The law of `MaxwellTyre` with a given deflection.
    """

    name = "maxwell_damper"
    title = "Maxwell damper"
    parameters = (
        STIFFNESS,
        PROGRESSION,
        Parameter("d", "N s/m", 0.0, 1e5, 1e3, description="damping in parallel"),
        Parameter("c_M", "N/m", 1e2, 1e7, 1e5, "log", "stiffness of the Maxwell branch"),
        Parameter("d_M", "N s/m", 1.0, 1e6, 1e3, "log", "damping of the Maxwell branch"),
        OFFSET,
    )
    states = (Channel("branch_displacement", "m", "internal displacement of the Maxwell branch"),)
    inputs = DAMPER_INPUTS
    outputs = DAMPER_OUTPUTS
    baseline = "kelvin_voigt_damper"

    def equations(self, s: Symbols) -> Equations:
        """One state: the branch."""
        x = s.quantity("deflection", s.displacement)
        stretch = x - s.branch_displacement
        branch = s.quantity("maxwell_force", s.c_M * stretch)
        return Equations(
            outputs={"force": parallel_force(s, x) + branch},
            rates={"branch_displacement": s.c_M / s.d_M * stretch},
            initial={"branch_displacement": x},
        )
