"""Play between what drives and what is driven."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mofit.models.effect import Effect
from mofit.models.model import SAMPLE_INTERVAL, TARGET_UNIT, Applied, Channel, Symbols
from mofit.parameters import Parameter

#: how the width of a play grows with the data
INPUT = (("slip_angle or displacement", 1.0),)
#: time constant with which the state of a play follows its signal, in sampling intervals; it matters only where the
#: signal turns
FOLLOWING = 0.1
#: half widths of the plays of a distributed play, relative to their mean
WIDTHS = (1 / 3, 1.0, 5 / 3)


def behind_plays(s: Symbols, value: ca.SX, widths: Sequence[ca.SX], positions: Sequence[str], free: str) -> Applied:
    r"""Mean of what arrives of an input :math:`u` behind plays of plus and minus :math:`b`: play operators.

    .. math::
        u' = \max(u - b, \min(w, u + b)), \qquad
        \epsilon \dot w = u' - w + \tfrac12 \epsilon \dot u \text{ outside } [u - b, u + b]

    that is :math:`w` follows the edge of the play once it is reached, and rests in between; :math:`u' = u` for
    :math:`b = 0`. With half of the rate of :math:`u` added (of what lags behind it by :math:`\epsilon`, where no rate
    is measured), it comes to rest where the edge turns, to third order in :math:`\epsilon`. A rate that belongs to the
    input changes by that of :math:`w`: over a time that grows with :math:`\sqrt b`.

    Parameters
    ----------
    s, value
        Symbols, and the input.
    widths, positions
        Half the width of every play, and the state that is the position of what it drives.
    free
        The state that is where this would rest without play.
    """
    measured, following = s.target_rate, FOLLOWING * s.sample_interval
    free_rate = (value - getattr(s, free)) / following
    ahead = 0.5 * (getattr(s, measured) if measured else free_rate)
    if measured:  # one trajectory with the position where there is no play
        free_rate += ahead
    arriving, rates = [], {free: free_rate}
    for half, name in zip(widths, positions, strict=True):
        position = getattr(s, name)
        # max(u - b, min(w, u + b)), written without a tie at b = 0, where its slope by b would be lost
        # where the input rests without play, it was reached from zero
        rising = ca.logic_or(position < value, ca.logic_and(position == value, value > 0))
        arrives = ca.if_else(rising, ca.fmax(position, value - half), ca.fmin(position, value + half))
        rates[name] = (arrives - position) / following + ca.if_else(ca.fabs(value - position) < half, 0, ahead)
        arriving.append(arrives)
    moving = ca.vertcat(*(rates[name] for name in positions))
    behind = ca.sum1(moving) / len(positions) - free_rate
    return Applied(
        ca.sum1(ca.vertcat(*arriving)) / len(arriving),
        derivatives=rates,
        initial=dict.fromkeys(rates, value),
        inputs={measured: getattr(s, measured) + behind} if measured else {},
    )


class Backlash(Effect):
    """What arrives of an input behind a play, see `behind_plays`.

    Fingerprint: odd harmonics and a lag whatever the frequency, worst at small amplitude.
    """

    name = "backlash"
    title = "play"
    family = "play"
    abrupt = True
    on = ("slip_angle", "displacement")
    # 0.03 degrees; half a millimetre
    parameters = (
        Parameter(
            "b_0", TARGET_UNIT, 0.0, 0.01, 5e-4, description="half the width of the play", neutral=0.0, scales=INPUT
        ),
    )
    states = (
        Channel("play_position", TARGET_UNIT, "where the driven side rests"),
        Channel("play_free", TARGET_UNIT, "where it would rest without play"),
    )
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Input behind the play."""
        return behind_plays(s, value, [s.b_0], ["play_position"], "play_free")


class GradedPlay(Effect):
    """What arrives of an input behind a play of distributed width: the mean of plays of several widths.

    A Prandtl-Ishlinskii operator with weights that are equal up to twice the mean width, by three plays
    (`behind_plays`). Fingerprint: that of a play, but a hysteresis that narrows gradually towards the turns.

    References
    ----------
    Visintin: Differential Models of Hysteresis (1994), ch. III.
    """

    name = "graded_play"
    title = "play of distributed width (Prandtl-Ishlinskii)"
    family = "play"
    refines = "backlash"
    abrupt = True
    on = ("slip_angle", "displacement")
    parameters = (
        Parameter(
            "b_g",
            TARGET_UNIT,
            0.0,
            0.01,
            5e-4,
            description="half the mean width of the plays",
            neutral=0.0,
            scales=INPUT,
        ),
    )
    states = (
        *(Channel(f"graded_position_{k}", TARGET_UNIT, "where a part rests") for k in range(len(WIDTHS))),
        Channel("graded_free", TARGET_UNIT, "where it would rest without play"),
    )
    conditions = (SAMPLE_INTERVAL,)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """Input behind the plays."""
        *positions, free = (state.name for state in self.states)
        return behind_plays(s, value, [width * s.b_g for width in WIDTHS], positions, free)
