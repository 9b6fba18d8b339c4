"""The last guard: an error that nobody foresaw goes into a log, not onto the screen; a warning becomes a sentence."""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import TextIO

from mofit import __version__


@contextmanager
def warnings_in_words() -> Iterator[None]:
    """Of warnings of Python that nobody foresaw, as of an overflow, one sentence each on standard error.

    What a search tries and cannot compute warns of nothing: it is expected where it is computed.
    """
    told = set[str]()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        text = " ".join(str(message).split())
        if text not in told:
            told.add(text)
            place = f"{Path(filename).name}, line {lineno}"
            print(f"mofit: warning: {text} ({place}). Check that the results are plausible.", file=sys.stderr)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


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
