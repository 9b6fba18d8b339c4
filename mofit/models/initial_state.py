"""The initial value of a state as a parameter, for any model that starts at rest."""

from __future__ import annotations

import casadi as ca

from mofit.models.effect import Effect
from mofit.models.model import Applied, Symbols
from mofit.parameters import PER_TEST, Parameter

#: what the name of such an effect begins with
PREFIX = "start:"
#: range in the state's SI unit where its scale is unknown, and the scale for which it is written: wide, because values
#: per test are not searched
_RANGE, WRITTEN_FOR = 1e4, 1e3


class InitialState(Effect):
    """A state starts at a value of its own in every test: a free decay, a record that begins in motion.

    ``find_effect("start:velocity")`` is this effect for the state ``velocity``; its parameter is ``velocity_start``.
    Its range follows from the data where they tell the scale of the state (`mofit.simulation.ranges.data_scales`).
    """

    family = "initial state"
    on = ("output",)
    candidate = False

    def __init__(self, state: str) -> None:
        self.state, self.name, self.title = state, PREFIX + state, f"initial {state}"
        self.needs = (state,)
        unit, what = f"unit of {state}", f"{state} at the first sample"
        # its size is the whole value: at 0 the model starts at rest
        self.parameters = (
            Parameter(
                f"{state}_start",
                unit,
                -_RANGE,
                _RANGE,
                0.0,
                description=what,
                neutral=0.0,
                per=PER_TEST,
                scales=((self.name, 1.0),),
            ),
        )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The output as it is; the state's initial value."""
        return Applied(value, initial={self.state: getattr(s, f"{self.state}_start")})
