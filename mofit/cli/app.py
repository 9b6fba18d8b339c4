"""What all commands share: the application, exit codes, how they print."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from cyclopts import App, Parameter

from mofit import __version__
from mofit.errors import InputError

DONE, UNUSABLE, NOT_CONVERGED, NOT_IDENTIFIABLE = 0, 2, 3, 4
INTERRUPTED = 130


def _shown(default: Any) -> str | None:
    """A default worth showing in the help: not a flag that is off, nor what is left out."""
    return None if default is None or default is False or default == () else str(default)


app = App(
    name="mofit",
    version=__version__,
    help="Identify dynamic models from test-bench data, with every plausible solution and calibrated uncertainty.",
    help_format="rich",
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative="", show_default=_shown),
)


def say(text: str) -> None:
    """To standard error."""
    print(text, file=sys.stderr)


def print_json(data: Any) -> None:
    """One object on standard output."""
    print(json.dumps(data, allow_nan=False))


def new_file(target: Path) -> Path:
    """The file, if it can be written without harm; else an `InputError`."""
    if target.exists():
        raise InputError.of(str(target), "exists already", "Name another with --out, or remove it")
    if not target.parent.is_dir():
        raise InputError.of(str(target), "its folder does not exist", "Make the folder first")
    if not os.access(target.parent, os.W_OK):
        raise InputError.of(str(target), "its folder is not writable", "Name another folder with --out")
    return target
