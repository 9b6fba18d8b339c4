"""Play in the drive of the input."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.model import UNIT_OF_TARGET, Applied, Channel, Effect
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model import Symbols

#: time in which a state follows its signal, s; it is felt only where the signal turns
FOLLOWING = 1e-3


class Backlash(Effect):
    r"""What arrives of the input :math:`u` behind a play of plus and minus :math:`b`: the play operator.

    .. math::
        u' = \max(u - b, \min(w, u + b)), \qquad
        \epsilon \dot w = u' - w + \tfrac12 \epsilon \dot u \text{ outside } [u - b, u + b]

    that is :math:`w` follows the edge of the play once it is reached, and rests in between; :math:`u' = u` for
    :math:`b = 0`. With half of the rate of :math:`u` added (of what lags behind it by :math:`\epsilon`, where no rate
    is measured), it comes to rest where the edge turns, to third order in :math:`\epsilon`. A rate that belongs to the
    input changes by that of :math:`w`. Fingerprint: odd harmonics and a
    lag whatever the frequency, worst at small amplitude.
    """

    name = "backlash"
    title = "play"
    on = ("slip_angle", "displacement")
    # 0.03 degrees; half a millimetre
    parameters = (
        Parameter("b_0", UNIT_OF_TARGET, 0.0, 0.01, 5e-4, description="half the width of the play", neutral=0.0),
    )
    states = (
        Channel("play_position", UNIT_OF_TARGET, "where the driven side rests"),
        Channel("play_free", UNIT_OF_TARGET, "where it would rest without play"),
    )

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Input behind the play."""
        position, free = s.play_position, s.play_free
        # max(u - b, min(w, u + b)), written without a tie at b = 0, where its slope by b would be lost
        # where the input rests without play, it was reached from zero
        rising = ca.logic_or(position < value, ca.logic_and(position == value, value > 0))
        arrives = ca.if_else(rising, ca.fmax(position, value - s.b_0), ca.fmin(position, value + s.b_0))
        free_rate = (value - free) / FOLLOWING
        ahead = 0.5 * (s.velocity if "velocity" in s else free_rate)
        if "velocity" in s:  # one trajectory with the position where there is no play
            free_rate += ahead
        rate = (arrives - position) / FOLLOWING + ca.if_else(ca.fabs(value - position) < s.b_0, 0, ahead)
        return Applied(
            arrives,
            rates={"play_position": rate, "play_free": free_rate},
            initial={"play_position": value, "play_free": value},
            also={"velocity": s.velocity + rate - free_rate} if "velocity" in s else {},
        )
