"""The last guard: an error that nobody foresaw goes into a log, not onto the screen."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import traceback
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from mofit import __version__


def log_unexpected(error: BaseException, arguments: Sequence[str]) -> str:
    """Write what a developer needs to a new log file; returns one sentence for the user."""
    text = str(error).strip().splitlines()
    what = f"{type(error).__name__}: {text[0]}" if text else type(error).__name__
    content = "\n".join(
        (
            f"mofit {__version__}, Python {platform.python_version()}, {platform.platform()}",
            f"time: {datetime.now().astimezone().isoformat(' ', 'seconds')}",
            f"folder: {Path.cwd()}",
            f"command: mofit {' '.join(arguments)}",
            "",
            "".join(traceback.format_exception(error)),
        )
    )
    for folder in (None, "."):  # the system's folder for such files first: the user's may be what is wrong
        try:
            handle, name = tempfile.mkstemp(".log", "mofit-", folder)
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(content)
        except OSError:
            continue
        return f"unexpected error ({what}). This is a fault of mofit; please report it with {Path(name)}."
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"unexpected error ({what}) in {Path(place.filename).name}, line {place.lineno}; no log could be written."


def command_line(arguments: Sequence[str] | None) -> Sequence[str]:
    """The arguments, by default those of the process."""
    return sys.argv[1:] if arguments is None else arguments
