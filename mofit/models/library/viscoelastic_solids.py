"""Viscoelastic solids in dynamic mechanical analysis: complex moduli of steady sines."""

from __future__ import annotations

from types import MappingProxyType

import casadi as ca

from mofit.models.model import Channel, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter, powers

#: how moduli grow with the data
MODULUS = powers(stress=1, strain=-1)


class HavriliakNegamiSolid(Model):
    r"""Stress of a solid under a steady sine of strain: one broad relaxation, by Havriliak and Negami.

    .. math::
        E^*(\omega) &= \Bigl(E_\infty + \Delta E
            \bigl[1 - (1 + (i \omega \tau)^\alpha)^{-\beta}\bigr]\Bigr) \, e^{i \omega \tau_d} \\
        \sigma &= \operatorname{Re} E^* \, \varepsilon + \operatorname{Im} E^* \, \dot\varepsilon / \omega

    Strain [1] in, stress [Pa] out, positive together; :math:`\omega` is that of the test, which must be a sine.
    :math:`E_\infty` is the modulus at rest, :math:`\alpha` and :math:`\beta` the width and the asymmetry of the
    spectrum; :math:`\alpha = \beta = 1` is a spring beside one Maxwell branch. All relaxation times are proportional to
    :math:`\tau`: a law of it over temperature is time-temperature superposition, and
    :math:`a_T = \tau(T) / \tau(T_0)` its shift factor. :math:`\tau_d` is what the measured strain lags behind the
    stress in the instrument.

    References
    ----------
    Havriliak & Negami, "A complex plane representation of dielectric and mechanical relaxation processes in some
    polymers", Polymer 8 (1967), 161-210; Ferry, "Viscoelastic Properties of Polymers", 3rd ed. (1980), chapter 11.
    """

    name = "havriliak_negami_solid"
    title = "Havriliak–Negami solid"
    typical = MappingProxyType({"strain": 2e-3, "stress": 2e6})
    parameters = (
        Parameter("E_inf", "Pa", 1e5, 1e10, 5e7, "log", "modulus at rest", scales=MODULUS),
        Parameter("dE", "Pa", 1e7, 1e11, 2e9, "log", "modulus that relaxes", scales=MODULUS),
        Parameter("tau", "s", 1e-15, 1e15, 1.0, "log", "relaxation time"),
        Parameter("alpha", "1", 0.05, 1.0, 0.5, description="width of the relaxation", limits=(0.01, 1.0)),
        Parameter("beta", "1", 0.02, 1.0, 0.3, description="asymmetry of the relaxation", limits=(0.01, 1.0)),
        Parameter("tau_d", "s", -2e-4, 2e-4, 0.0, description="delay of the strain behind the stress"),
    )
    inputs = (
        Channel("strain", "1", "strain"),
        Channel("strain_rate", "1/s", "rate of the strain", derivative_of="strain"),
    )
    outputs = (Channel("stress", "Pa", "stress, positive with the strain"),)
    conditions = (Condition("frequency", "Hz", None, "frequency of the sine"),)
    excitations = ("sine",)
    default = True

    def equations(self, s: Symbols) -> Equations:
        """Storage modulus times strain, and loss modulus times its rate over the angular frequency."""
        omega = 2 * ca.pi * s.frequency
        power = (omega * s.tau) ** s.alpha
        along, across = 1 + power * ca.cos(ca.pi / 2 * s.alpha), power * ca.sin(ca.pi / 2 * s.alpha)
        size, angle = (along**2 + across**2) ** (-s.beta / 2), s.beta * ca.atan2(across, along)
        storage, loss = s.E_inf + s.dE * (1 - size * ca.cos(angle)), s.dE * size * ca.sin(angle)
        lead = omega * s.tau_d
        storage, loss = storage * ca.cos(lead) - loss * ca.sin(lead), storage * ca.sin(lead) + loss * ca.cos(lead)
        stress = s.quantity("storage_modulus", storage) * s.strain
        return Equations(outputs={"stress": stress + s.quantity("loss_modulus", loss) * s.strain_rate / omega})
