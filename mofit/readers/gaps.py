"""Gaps in a record: samples that are no number, and time stamps that are missing."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mofit.readers.columns import Array

#: distance of two time stamps, in usual sampling steps, from which one is missing between them
MISSING = 1.5


def longest_whole(time: Array, signals: Iterable[Array]) -> tuple[slice, int]:
    """The longest stretch of a record without a gap, and the number of gaps in the whole record.

    A gap is a run of samples at which the time or a signal is not finite, or a place between two samples where a time
    stamp is missing.

    Parameters
    ----------
    time
        Time stamps, shape (n,).
    signals
        What was recorded, shape (n,) each.

    Returns
    -------
    stretch
        Which samples; none if no sample is whole.
    gaps
        How many gaps there are, those at the ends included.
    """
    whole = np.isfinite(time) & np.all([np.isfinite(signal) for signal in signals], axis=0)
    steps = np.diff(time)
    together = whole[1:] & whole[:-1]
    usual = np.median(steps[together]) if together.any() else np.inf
    missing = together & (steps > MISSING * usual)
    joined = together & ~missing
    starts = np.flatnonzero(whole & ~np.concatenate([[False], joined]))
    ends = np.flatnonzero(whole & ~np.concatenate([joined, [False]])) + 1
    runs = np.count_nonzero(np.diff(np.concatenate([[True], whole])) & ~whole)
    gaps = int(runs + np.count_nonzero(missing))
    if not len(starts):
        return slice(0, 0), gaps
    longest = int(np.argmax(ends - starts))
    return slice(int(starts[longest]), int(ends[longest])), gaps
