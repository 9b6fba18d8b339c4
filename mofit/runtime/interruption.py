"""Ctrl-C and its like, also where what cleans up behind them fails."""

from __future__ import annotations


def interruption(error: BaseException | None) -> KeyboardInterrupt | None:
    """The interruption that an error is, or behind which it was raised; None without one.

    A pool whose thread was about to start, say, cannot join it and says so: that is not why the work ended.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error
