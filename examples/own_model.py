"""A model of your own: copy, change, run.

mofit identify campaign.nc --model examples/own_model.py:ZenerDamper
"""

from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class ZenerDamper(Model):
    """Spring in parallel with a spring and a damper in series; displacement [m] in, force [N] out."""

    name = "zener_damper"
    title = "Zener damper"
    parameters = (
        # name, unit, lower bound, upper bound, typical value, scale; a log scale suits positive scale parameters
        Parameter("k", "N/m", 0.0, 1e4, 500.0, description="stiffness at rest"),
        Parameter("k_1", "N/m", 1e2, 1e7, 1e5, "log", "added stiffness at high frequency"),
        Parameter("tau", "s", 1e-4, 10.0, 0.05, "log", "relaxation time"),
    )
    states = (Channel("branch_force", "N"),)
    # a rate that is not measured is computed from its channel by a smoothing spline
    inputs = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)
    baseline = "kelvin_voigt_damper"

    def equations(self, s):
        """Write with s.<name>; CasADi's functions (ca.sin, ca.fabs, ca.if_else …) work on them."""
        x = s.quantity("deflection", s.displacement)  # announced quantities can be changed by effects
        return Equations(
            outputs={"force": s.quantity("spring_force", s.k * x) + s.branch_force},
            derivatives={"branch_force": s.k_1 * s.velocity - s.branch_force / s.tau},
        )
