"""Static tyre forces: the TMeasy curve over slip and the spring of the carcass, for either direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import casadi as ca

from mofit.models.model import Channel, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter, powers

#: how forces, stiffnesses and dampings grow with the load; lengths and times of tyres of other sizes are alike
LOAD = powers(vertical_force=1)
#: load for which the ranges of tyres are written, N
TYPICAL_LOAD = MappingProxyType({"vertical_force": 3600.0})
#: and how a tyre rolls there: range of its slip angle, rad, and its speed, m/s
TYPICAL_ROLLING = MappingProxyType({**TYPICAL_LOAD, "slip_angle": 0.1, "longitudinal_velocity": 60 / 3.6})

# Tests up to 4 degrees end well before the maximum and do not inform sliding: fixed ratios, typical of car tyres.
SLIDING_SLIP = 3.0
"""s_S / s_M"""
SLIDING_FORCE = 0.95
"""F_S / F_M"""

TMEASY_PARAMETERS = (
    Parameter("dF0", "N", 1e4, 3e5, 6e4, "log", "initial slope of force over slip", scales=LOAD),
    Parameter("s_M", "1", 0.03, 1.0, 0.13, "log", "slip at the maximum force"),
    Parameter("F_M", "N", 300.0, 2e4, 3000.0, "log", "maximum force", scales=LOAD),
)

SPRING_PARAMETERS = (
    Parameter("c_y", "N/m", 1e4, 1e6, 1.2e5, "log", "lateral stiffness at small deflection", scales=LOAD),
    Parameter("p_y", "1/m", -30.0, 30.0, -7.0, description="change of stiffness with deflection; negative: degressive"),
)

ROLLING_CONDITIONS = (
    Condition("longitudinal_velocity", "m/s", None, "speed of the wheel centre along its heading, v"),
    Condition("slip_normalisation", "1", 1.0, "slip normalisation factor; 1 leaves the slip as it is"),
    Condition("fictitious_velocity", "m/s", 0.01, "keeps the slip finite at standstill, v_N"),
)

SLIP_ANGLE = Channel("slip_angle", "rad", "slip angle")
LATERAL_FORCE = Channel("lateral_force", "N", "lateral force")

#: keeps the largest deflection finite, 1/m
_HARDLY_DEGRESSIVE = 1e-6


def sliding_velocity(s: Symbols, angle: ca.SX) -> ca.SX:
    r"""Lateral sliding velocity of the contact patch [m/s] under a slip angle [rad].

    :math:`v \sin\alpha`, and :math:`v \, l_\varphi \varphi` more in models with turn slip :math:`\varphi` [1/m].
    """
    turned = s.l_phi * s.turn_slip if "turn_slip" in s else 0
    return s.longitudinal_velocity * (ca.sin(angle) + turned)


def lateral_slip(s: Symbols) -> tuple[ca.SX, ca.SX]:
    r"""Normalised lateral slip and transport velocity of a free-rolling wheel.

    .. math::
        v^* = v \cos\alpha \, \hat s + v_N, \qquad s = \frac{-v_y}{v^*}, \quad v_y = -v \sin\alpha

    Eq. (3) of Hackl et al. 2016 with :math:`r_D |\Omega| = v \cos\alpha`; see `sliding_velocity` for turn slip.

    Returns
    -------
    slip
        [1], positive for a positive slip angle; quantity ``lateral_slip``.
    transport_velocity
        [m/s]; quantity ``transport_velocity``.
    """
    angle, speed = s.slip_angle, s.longitudinal_velocity
    transport = s.quantity(
        "transport_velocity", ca.fabs(speed * ca.cos(angle)) * s.slip_normalisation + s.fictitious_velocity
    )
    return s.quantity("lateral_slip", sliding_velocity(s, angle) / transport), transport


class Curve(NamedTuple):
    """TMeasy curve of one direction: initial slope [N], slip at the maximum force [1] and maximum force [N]."""

    dF0: ca.SX
    s_M: ca.SX
    F_M: ca.SX


def slip_stiffness(curve: Curve, slip: ca.SX) -> ca.SX:
    r"""Secant slope :math:`f_G = F / s` of the TMeasy curve [N], finite at zero slip.

    With :math:`\sigma = |s| / s_M` and :math:`\kappa = dF_0 s_M / F_M`

    .. math::
        F = \begin{cases}
            dF_0 \, |s| / (1 + \sigma (\sigma + \kappa - 2))        & |s| \le s_M \\
            F_M - (F_M - F_S) \, \tau^2 (3 - 2 \tau), \quad
                \tau = (|s| - s_M) / (s_S - s_M)                    & s_M < |s| < s_S \\
            F_S                                                     & |s| \ge s_S
        \end{cases}

    The slope is continuous throughout; it is :math:`dF_0` at zero and 0 at :math:`s_M`.
    :math:`s_S = 3 s_M` and :math:`F_S = 0.95 F_M` are fixed ratios.

    References
    ----------
    Rill, "First order tire dynamics", III ECCM 2006; Hirschberg, Rill & Weinfurter, "Tire model TMeasy", Vehicle
    System Dynamics 45 (2007), 101–119.
    """
    dF0, s_M, F_M = curve
    size = ca.fabs(slip)
    sigma = ca.fmin(size / s_M, 1)
    rising = dF0 / (1 + sigma * (sigma + dF0 * s_M / F_M - 2))
    tau = ca.fmin(ca.fmax((size / s_M - 1) / (SLIDING_SLIP - 1), 0), 1)
    falling = F_M * (1 - (1 - SLIDING_FORCE) * tau**2 * (3 - 2 * tau)) / ca.fmax(size, s_M)
    return ca.if_else(size <= s_M, rising, falling)


@dataclass(frozen=True)
class Direction:
    """One direction of the contact patch: its slip, the names of its parameters, and how its quantities are called."""

    slip: Callable[[Symbols], tuple[ca.SX, ca.SX]]
    """Slip [1] and transport velocity [m/s] from the symbols."""
    curve_parameters: tuple[str, str, str]
    """Initial slope, slip at the maximum and maximum force."""
    carcass_parameters: tuple[str, str, str]
    """Stiffness, its change with deflection, and damping."""
    prefix: str = ""
    """Before the name of every quantity that is announced."""

    def curve(self, s: Symbols) -> Curve:
        """The TMeasy curve of the test."""
        return Curve(*(getattr(s, name) for name in self.curve_parameters))

    def stiffness(self, s: Symbols) -> tuple[ca.SX, ca.SX]:
        """Stiffness at small deflection [N/m] and its change with deflection [1/m]."""
        return getattr(s, self.carcass_parameters[0]), getattr(s, self.carcass_parameters[1])

    def damping(self, s: Symbols) -> ca.SX:
        """Damping of the carcass [N s/m]."""
        return getattr(s, self.carcass_parameters[2])

    def quantity(self, s: Symbols, name: str, value: ca.SX) -> ca.SX:
        """Announce a quantity of this direction."""
        return s.quantity(self.prefix + name, value)


LATERAL = Direction(lateral_slip, ("dF0", "s_M", "F_M"), ("c_y", "p_y", "d_y"))


def carcass_force(s: Symbols, y: ca.SX, direction: Direction = LATERAL) -> ca.SX:
    r"""Eq. (16) of Hackl et al. 2016 [N] at deflection ``y`` [m]; quantity ``carcass_force``.

    A degressive spring holds its largest force :math:`c_y / (4 |p_y|)` from :math:`|y| = 1 / (2 |p_y|)` on, where
    eq. (16) alone would turn round and diverge.
    """
    stiffness, change = direction.stiffness(s)
    largest = 0.5 / ca.fmax(-change, _HARDLY_DEGRESSIVE)
    held = ca.fmax(-largest, ca.fmin(y, largest))
    return direction.quantity(s, "carcass_force", stiffness * (1 + change * ca.fabs(held)) * held)


class TMeasyCurve(Model):
    r"""Steady-state lateral force :math:`F = f_G(s) \, s`; see `lateral_slip` and `slip_stiffness`.

    A positive slip angle [rad] gives a positive lateral force [N]. Only the rising part (dF0, s_M, F_M) is
    identified: tests of 1 to 4 degrees end before the maximum.
    """

    name = "tmeasy_curve"
    title = "TMeasy steady-state curve"
    typical = TYPICAL_ROLLING
    parameters = TMEASY_PARAMETERS
    inputs = (SLIP_ANGLE,)
    outputs = (LATERAL_FORCE,)
    conditions = ROLLING_CONDITIONS

    def equations(self, s: Symbols) -> Equations:
        """Force of the settled tyre."""
        slip, _ = lateral_slip(s)
        force = s.quantity("steady_state_force", slip_stiffness(LATERAL.curve(s), slip) * slip)
        return Equations(outputs={"lateral_force": force})


class QuasiStaticSpring(Model):
    r"""Non-linear spring :math:`F = c_y y + c_y p_y |y| y` of the standing or slowly moved tyre.

    Eq. (16) of Hackl et al. 2016: displacement [m] so slow that dampers carry nothing, force [N]. A degressive spring
    (:math:`p_y < 0`) holds its largest force from :math:`|y| = 1 / (2 |p_y|)` on.
    """

    name = "quasi_static_spring"
    title = "quasi-static lateral spring"
    typical = TYPICAL_LOAD
    parameters = SPRING_PARAMETERS
    inputs = (Channel("lateral_displacement", "m", "lateral displacement"),)
    outputs = (LATERAL_FORCE,)

    def equations(self, s: Symbols) -> Equations:
        """Spring force."""
        y = s.quantity("deflection", s.lateral_displacement)
        return Equations(outputs={"lateral_force": carcass_force(s, y)})
