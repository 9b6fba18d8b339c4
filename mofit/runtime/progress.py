"""Progress of long work, as a callback."""

from __future__ import annotations

from collections.abc import Callable

#: ``progress(stage, done, total, note)``: called now and then; ``total`` 0 where it is not known.
Progress = Callable[[str, float, float, str], None]


def silent(stage: str, done: float, total: float, note: str = "") -> None:
    """The listener that does nothing."""
