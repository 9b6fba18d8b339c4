"""Elastic forces and inertia beside the model's spring."""

from __future__ import annotations

import casadi as ca

from mofit.models.declarations import SAMPLE_INTERVAL, Applied
from mofit.models.effect import Addition, Effect
from mofit.models.filters import Washout, derivative, washout_states, washout_time
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter


class CubicStiffness(Addition):
    r"""Spring force plus :math:`k_c y^3` [N]; positive: hardening.

    Fingerprint: third harmonic, growing with amplitude.
    """

    name = "cubic_stiffness"
    title = "cubic stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (Parameter("k_c", "N/m^3", -1e9, 1e9, 2.2e7, description="cubic stiffness", neutral=0.0),)

    def term(self, s: Symbols) -> ca.SX:
        """Cubic force."""
        return s.k_c * s.quantities["deflection"] ** 3


class AsymmetricStiffness(Addition):
    r"""Spring force plus :math:`k_a |y|` [N]: stiffness :math:`k + k_a` one way, :math:`k - k_a` the other.

    Fingerprint: even harmonics.
    """

    name = "asymmetric_stiffness"
    title = "asymmetric stiffness"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (Parameter("k_a", "N/m", -5e4, 5e4, 1.2e3, description="half the difference", neutral=0.0),)

    def term(self, s: Symbols) -> ca.SX:
        """Even force."""
        return s.k_a * ca.fabs(s.quantities["deflection"])


class Payne(Addition):
    r"""Spring force plus :math:`c_P y / (1 + |y| / y_P)` [N]: stiffness that is lost beyond a deflection :math:`y_P`.

    The filler network of rubber breaks with strain (Payne, J. Appl. Polym. Sci. 6, 1962). Fingerprint: stiffness that
    falls with amplitude, odd harmonics whatever the frequency.
    """

    name = "payne"
    title = "Payne softening"
    on = ("carcass_force", "spring_force")
    needs = ("deflection",)
    parameters = (
        Parameter("c_P", "N/m", 0.0, 1e5, 1e4, description="stiffness that is lost with amplitude", neutral=0.0),
        Parameter("y_P", "m", 1e-4, 0.1, 3e-3, "log", "deflection where half of it is lost", grid=(1e-3, 3e-3, 1e-2)),
    )

    def term(self, s: Symbols) -> ca.SX:
        """Softening force."""
        y = s.quantities["deflection"]
        return s.c_P * y / (1 + ca.fabs(y) / s.y_P)


class Inertia(Effect):
    r"""Force minus :math:`m \ddot y` (tyres: belt and tread move with the deflection), or plus (dampers: moved end).

    Fingerprint: odd harmonics, growing with f², in phase with the deflection.
    """

    name = "inertia"
    title = "inertia"
    on = ("lateral_force", "damper_force")
    needs = ("deflection_rate or velocity",)
    parameters = (Parameter("m_b", "kg", 0.0, 100.0, 5.0, description="mass that is accelerated", neutral=0.0),)
    states = washout_states(name, "m/s")
    conditions = (SAMPLE_INTERVAL,)

    #: Share of the sampling interval for the washout: a tyre's acceleration jumps where the slip changes its sign, and
    #: a longer one smears the jump over the next sample.
    washout_share = 0.1

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Force with that of the mass."""
        rate = s.quantities.get("deflection_rate")
        chain = Washout(s, self.states, s.velocity if rate is None else rate, washout_time(s, self.washout_share))
        return chain.applied(value + (1 if rate is None else -1) * s.m_b * derivative(chain))
