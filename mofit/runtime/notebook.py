"""Progress in a notebook: one line under the cell that is written anew."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from html import escape
from importlib import import_module
from typing import Any

from mofit.runtime.progress import Progress, silent

#: seconds between two drawings: more would fill the notebook's channel
_PAUSE = 0.2


def listener(progress: Progress | None) -> Progress:
    """The listener given; without one, where the code runs in a notebook, one that shows stage and share done."""
    if progress is not None:
        return progress
    return NotebookProgress() if hasattr(_shell(), "kernel") else silent


def _shell() -> Any:
    """The interactive shell, if Python runs in one."""
    module = sys.modules.get("IPython")
    return None if module is None else module.get_ipython()


class NotebookProgress:
    """Shows the latest word of a job.

    Parameters
    ----------
    display
        Shows a page of HTML and returns a handle whose ``update`` replaces it; by default IPython's.
    """

    def __init__(self, display: Callable[[str], Any] | None = None) -> None:
        self.display = display or _display
        self.handle: Any = None
        self.stage, self.drawn = "", 0.0

    def __call__(self, stage: str, done: float, total: float, note: str = "") -> None:
        """Hear of progress."""
        now = time.monotonic()
        if stage == self.stage and now - self.drawn < _PAUSE and not (total and done >= total):
            return
        self.stage, self.drawn = stage, now
        page = progress_html(stage, done, total, note)
        if self.handle is None:
            self.handle = self.display(page)
        else:
            self.handle.update(page)


class _Shown:
    """An output of IPython that can be replaced."""

    def __init__(self, page: str) -> None:
        self.ipython = import_module("IPython.display")
        self.handle = self.ipython.display(self.ipython.HTML(page), display_id=True)

    def update(self, page: str) -> None:
        self.handle.update(self.ipython.HTML(page))


def _display(page: str) -> _Shown:
    return _Shown(page)


def progress_html(stage: str, done: float, total: float, note: str) -> str:
    """A bar with its stage and note; without a bar where the total is not known."""
    bar = f'<progress value="{done:g}" max="{total:g}"></progress> ' if total else ""
    return f"<div>{bar}<b>{escape(stage)}</b> {escape(note)}</div>"
