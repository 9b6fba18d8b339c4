"""An effect of your own: copy, change, run.

mofit identify campaign.nc --effect examples/own_effect.py:Backlash
"""

import casadi as ca

from mofit.model import Applied, Effect
from mofit.parameters import Parameter


class Backlash(Effect):
    """Play: within plus and minus half the gap nothing is transmitted, beyond it the rest of the angle or stroke."""

    name = "backlash"
    title = "play of the steering or the clamping"
    # what it acts on: an input, an output or a quantity that the model announces; the first that the model has
    on = ("slip_angle", "deflection")
    # at its neutral value the model must be unchanged
    parameters = (Parameter("gap", "1", 0.0, 0.01, 1e-3, description="width of the play", neutral=0.0),)

    def apply(self, s, value):
        """The quantity with the effect; an effect with states returns their rates as well."""
        half = s.gap / 2
        return Applied(ca.fmax(value - half, 0) + ca.fmin(value + half, 0))
