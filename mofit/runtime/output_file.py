"""A file that a command writes: claimed before the work, and never one that something else has made."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from mofit.errors import InputError
from mofit.runtime.claims import TakenError, claim
from mofit.runtime.files import unwritable
from mofit.runtime.names import named_path, shortened

#: What a page of mofit has in its head.
PAGE_MARK = '<meta name="generator" content="mofit">'
#: What a plan that mofit proposes begins with.
PLAN_MARK = "# Proposed by mofit design"
#: What a map that mofit proposes begins with.
MAP_MARK = "# Proposed by mofit import"
#: What a picture of mofit has in its head.
PICTURE_MARK = "Software of this picture: mofit"
#: What pages had in its place before.
_EARLIER_MARK = '<link rel="icon" href="data:,">'
#: Bytes of a file in which the mark is looked for.
_HEAD = 4096


@contextmanager
def output_file(
    target: str | Path,
    option: str = "--out",
    *,
    force: bool | None = None,
    inputs: Sequence[Path] = (),
    recognised: Callable[[Path], bool] | None = None,
) -> Iterator[Path]:
    """Claim a file that is written at the end of the block.

    Parameters
    ----------
    target, option
        The file, and the option that names it.
    force
        Whether a file that mofit has made may be replaced; None where the command has no such option.
    inputs
        Files that the command reads: they are never replaced.
    recognised
        Whether mofit has made a file that bears no mark in its head.

    Raises
    ------
    InputError
        If the file exists and may not be replaced, cannot be written, or another process is writing it.
    """
    path = named_path(target, option)
    where = f"{option} {shortened(path)}"
    _may_be_replaced(path, where, option, force, inputs, recognised)
    if not path.parent.is_dir():
        raise InputError.of(where, "its folder does not exist", "Make the folder first")
    lock = path.with_name(f".{path.name}.lock")
    try:
        held = claim(lock)
    except TakenError as error:
        raise InputError.of(where, str(error), "Wait for it, or name another file") from None
    except OSError as error:
        raise unwritable(where, error) from None
    try:
        _may_be_replaced(path, where, option, force, inputs, recognised)  # another process may just have finished it
        yield path
    finally:
        held.release()


def _may_be_replaced(
    path: Path,
    where: str,
    option: str,
    force: bool | None,
    inputs: Sequence[Path],
    recognised: Callable[[Path], bool] | None,
) -> None:
    if not os.path.lexists(path):
        return
    other = f"Name another with {option}" if option.startswith("--") else "Rename it"
    if any(given.exists() and path.exists() and given.samefile(path) for given in inputs):
        raise InputError.of(where, "is an input of this command", other)
    if force is None:
        raise InputError.of(where, "exists already", f"{other}, or remove it")
    if not (recognised or _made_here)(path):
        raise InputError.of(where, "exists already, and mofit has not made it", other)
    if not force:
        raise InputError.of(where, "exists already", f"{other}, or replace it with --force")


def _made_here(path: Path) -> bool:
    """Whether a file bears a mark of mofit."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return False
    return any(mark.encode() in head for mark in (PAGE_MARK, PLAN_MARK, MAP_MARK, PICTURE_MARK, _EARLIER_MARK))
