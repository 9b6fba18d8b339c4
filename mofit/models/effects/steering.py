"""Between the steered wheel and the contact patch: lag, turn slip, camber, compliance and load."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Addition, Effect, Scaling
from mofit.models.filters import Washout, derivative, lagged, washout_states, washout_time
from mofit.models.library.steady_state import LATERAL, sliding_velocity, slip_stiffness
from mofit.models.library.tyres import contact_force
from mofit.models.model import SAMPLE_INTERVAL, Applied, Condition, Symbols
from mofit.parameters import Parameter, powers

#: how what a force does grows with the load
PER_LOAD = powers(vertical_force=-1)
#: and how travelled lengths grow with speed and time of the data: a test shows a lag within its times
TRAVEL = powers(longitudinal_velocity=1, time=1)
#: Rounds in which angle and force of a settled tyre find each other; each takes off nine tenths of what is left.
_ROUNDS = 5


class ContactPatchLag(Effect):
    r"""Slip angle behind a lag over a travelled length, :math:`\dot\alpha' = (\alpha - \alpha') v / \sigma`.

    Tread elements deflect anew while they pass the patch: :math:`\sigma` is about half its length (Pacejka, "Tire and
    Vehicle Dynamics", section 9.3). Fingerprint: odd harmonics, phase growing with f and with 1/v; a test at another
    speed distinguishes it from a delay.
    """

    name = "contact_patch_lag"
    title = "lag of the contact patch"
    family = "lag or delay"
    on = ("slip_angle",)
    needs = ("longitudinal_velocity", "fictitious_velocity")
    parameters = (
        Parameter(
            "sigma_c", "m", 0.0, 0.5, 0.05, description="relaxation length of the patch", neutral=0.0, scales=TRAVEL
        ),
    )
    states = washout_states(name, "rad")
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle behind the lag."""
        lag = s.sigma_c / (s.longitudinal_velocity + s.fictitious_velocity)
        chain = Washout(s, self.states, value, lag + washout_time(s))
        return chain.applied(lagged(chain, lag))


class TurnSlip(Effect):
    r"""Slip angle :math:`\alpha + l \dot\alpha / v`: steering axis a length :math:`l` off the contact, turn slip.

    With negative :math:`l` it is a contact-patch lag to first order, so a diagnosis tries it only when named.
    Fingerprint: odd harmonics, phase growing with f and 1/v.
    """

    name = "turn_slip"
    title = "turn slip"
    family = "spin slip"
    on = ("slip_angle",)
    needs = ("longitudinal_velocity", "fictitious_velocity")
    parameters = (
        Parameter("l_t", "m", -0.2, 0.2, 0.02, description="lever of the turning", neutral=0.0, scales=TRAVEL),
    )
    states = washout_states(name, "rad")
    conditions = (SAMPLE_INTERVAL,)
    candidate = False

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Slip angle of the contact patch."""
        chain = Washout(s, self.states, value, washout_time(s))
        speed = s.longitudinal_velocity + s.fictitious_velocity
        return chain.applied(value + s.l_t / speed * derivative(chain))


class Camber(Addition):
    r"""Slip angle :math:`\alpha + \epsilon \gamma` with the test's camber angle.

    :math:`\epsilon` is camber stiffness over cornering stiffness, 0.05 to 0.1 for car tyres (Pacejka, "Tire and
    Vehicle Dynamics"). At one camber angle it is a slip-angle offset, so a diagnosis tries it only when named.
    """

    name = "camber"
    title = "camber"
    family = "spin slip"
    on = ("slip_angle",)
    parameters = (
        Parameter("epsilon_c", "1", -0.5, 0.5, 0.08, description="camber over cornering stiffness", neutral=0.0),
    )
    conditions = (Condition("camber_angle", "rad", 0.0, "camber angle"),)
    candidate = False

    def term(self, s: Symbols) -> ca.SX:
        """Slip angle that has the same force as the camber."""
        return s.epsilon_c * s.camber_angle


class SteeringCompliance(Effect):
    r"""Slip angle :math:`\alpha - \kappa F`: the steering behind the angle's transducer is not rigid.

    The force depends on the angle in turn, :math:`F(\alpha - \kappa F) \approx F(\alpha) / (1 + \kappa F')` at the
    present deflection, within 0.03 N of the implicit solution at typical size. Fingerprint: odd harmonics, growing
    with load; like less cornering stiffness at one load.
    """

    name = "steering_compliance"
    title = "compliance of the steering"
    family = "compliance"
    on = ("slip_angle",)
    needs = ("dF0", "slip_normalisation")
    # 0.08 degrees per kilonewton
    parameters = (
        Parameter(
            "kappa_s", "rad/N", 0.0, 3e-5, 1.4e-6, description="steering compliance", neutral=0.0, scales=PER_LOAD
        ),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Angle that the tyre sees."""
        transport = s.longitudinal_velocity * s.slip_normalisation + s.fictitious_velocity
        if "d_y" not in s:
            return Applied(self._settled(s, value, transport))
        slip = sliding_velocity(s, value) / transport
        slope = slip_stiffness(LATERAL.curve(s), slip)
        through_damper = transport * s.d_y
        gain = slope * through_damper / (through_damper + slope)
        force = contact_force(s, slope, slip, transport) / (1 + s.kappa_s * gain)
        return Applied(value - s.kappa_s * force)

    def _settled(self, s: Symbols, value: ca.SX, transport: ca.SX) -> ca.SX:
        """Angle of a settled tyre, whose force follows the angle at once."""
        angle = value
        for _ in range(_ROUNDS):
            slip = sliding_velocity(s, angle) / transport
            angle = value - s.kappa_s * slip_stiffness(LATERAL.curve(s), slip) * slip
        return angle


class LoadCoupling(Scaling):
    r"""Vertical load :math:`F_z (1 + \kappa F)`, and the contact patch's force with it: the loading arm leans.

    Fingerprint: mean value and even harmonics.
    """

    name = "load_coupling"
    title = "lateral force on the load"
    family = "load coupling"
    # the force itself of a settled tyre
    on = ("slip_stiffness", "steady_state_force")
    needs = ("lateral_slip", "transport_velocity")
    # half a per cent per kilonewton
    parameters = (
        Parameter(
            "kappa_z",
            "1/N",
            -1e-4,
            1e-4,
            5e-6,
            description="relative change of load per force",
            neutral=0.0,
            scales=PER_LOAD,
        ),
    )

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Change of the load, from the slope of the contact patch or from its force."""
        if "d_y" not in s:
            return s.kappa_z * value
        return s.kappa_z * contact_force(s, value, s.quantities["lateral_slip"], s.quantities["transport_velocity"])
