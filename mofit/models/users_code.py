"""The code of users, and the line of it that fails."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mofit.errors import InputError, MofitError


@contextmanager
def users_code(where: str, what: str, hint: str, file: str = "") -> Iterator[None]:
    """Turn all that a user's code raises, ``sys.exit`` too, into an `InputError` that says the line of the file.

    Raises
    ------
    InputError
        ``what`` raised an error, at the place ``where``.
    """
    try:
        yield
    except MofitError:
        raise
    except (Exception, SystemExit) as error:
        kind, text = type(error).__name__, str(error)
        called = "called sys.exit" if isinstance(error, SystemExit) else f"raised {kind}"
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if file and Path(frame.filename).resolve() == Path(file).resolve()]
        if isinstance(error, SyntaxError):
            lines = []  # its text has the line
        line = f" in line {lines[-1]}" if lines else ""
        message = f"{what} {called}{line}" + (f": {text}" if text else "")
        raise InputError.of(where, message, hint) from error
