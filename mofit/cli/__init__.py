"""The command line: parse, call one function, print."""

from __future__ import annotations

import atexit
import gc
import os
from collections.abc import Sequence

from cyclopts import CycloptsError

# they register their commands
from mofit.cli import campaign, completion, design, export, identify, mcp, predict, runs  # noqa: F401
from mofit.cli.app import DONE, INTERRUPTED, NOT_CONVERGED, UNEXPECTED, UNUSABLE, app, say
from mofit.cli.time_limit import TimeIsUp
from mofit.cli.unexpected import command_line, log_unexpected, warnings_in_words
from mofit.errors import MofitError
from mofit.runtime.interruption import interruption

#: What a user can do after Ctrl-C, by command; of the others what interrupted them has a note, if they keep anything.
_AFTER_INTERRUPTION = {"batch": "Nothing is lost: the same command goes on."}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code (see the README)."""
    # matrices are small here: the threads of NumPy's linear algebra would wait for one another in busy loops and take
    # the cores from the kernel's. Set before NumPy is imported; the user's own setting wins
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # most of what imports and figures make stays: looking for garbage after every 700 objects, as Python does by
    # itself, takes a sixth of the importing and a quarter of the drawing
    gc.set_threshold(50_000, 20, 20)
    atexit.register(gc.freeze)  # the search for garbage before the end takes half a second
    try:
        with warnings_in_words():
            code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        return code if isinstance(code, int) else DONE
    except BaseException as error:  # noqa: BLE001 - the one place where anything may arrive
        return _told(interruption(error) or error, arguments)


def _told(error: BaseException, arguments: Sequence[str] | None) -> int:
    """Say what ended a command early; returns the exit code."""
    match error:
        case MofitError():
            say(f"mofit: {error}")
            return UNUSABLE
        case CycloptsError():
            say(f"mofit: {error}".rstrip() + " See mofit --help.")
            return UNUSABLE
        case TimeIsUp():
            say(f"mofit: the time limit is reached. {_after(error, arguments)}")
            return NOT_CONVERGED
        case KeyboardInterrupt():
            say(f"mofit: interrupted. {_after(error, arguments)}")
            return INTERRUPTED
        case BrokenPipeError():
            return DONE
        case Exception():
            say(f"mofit: {log_unexpected(error, command_line(arguments))}")
            return UNEXPECTED
    raise error


def _after(stop: BaseException, arguments: Sequence[str] | None) -> str:
    """What is left of an interrupted command."""
    command = next(iter(command_line(arguments)), "")
    notes = getattr(stop, "__notes__", ())
    return _AFTER_INTERRUPTION.get(command) or " ".join(notes) or "Nothing was written."
