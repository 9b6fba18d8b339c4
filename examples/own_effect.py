"""An effect of your own: copy, change, run.

mofit diagnose campaign.nc --effects examples/own_effect.py
mofit identify campaign.nc --effect examples/own_effect.py
"""

import casadi as ca

from mofit.models import Applied, Effect
from mofit.parameters import Parameter


class DeadZone(Effect):
    """Within plus and minus half the gap no stroke is transmitted; beyond it the rest is."""

    name = "dead_zone"
    title = "dead zone of the clamping"
    # what it acts on, the first that the model has: an input, output, parameter, condition or announced quantity
    on = ("deflection", "displacement")
    # at its neutral value the model is unchanged; a parameter without one means nothing while the effect is absent, and
    # needs a grid of values to try
    parameters = (Parameter("gap", "m", 0.0, 0.01, 1e-3, description="width of the dead zone", neutral=0.0),)

    def apply(self, s, value):
        """The quantity with the effect; an effect with states returns their derivatives as well."""
        half = s.gap / 2
        return Applied(ca.fmax(value - half, 0) + ca.fmin(value + half, 0))
