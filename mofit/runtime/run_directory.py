"""The folder of a run: claimed before the work, worked on under a temporary name, renamed when done, resumed."""

from __future__ import annotations

import errno
import json
import os
import shutil
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

from mofit.errors import InputError, WriteError
from mofit.runtime.claims import LOCK, Claim, TakenError, claim
from mofit.runtime.files import unwritable, write_text, writing
from mofit.runtime.interruption import interruption
from mofit.runtime.names import named_path, shortened

_PARTIAL = ".partial"
CONFIGURATION = "configuration.json"
LOG = "run.log"
#: What a run writes before there is anything to resume.
_NOTHING_YET = {LOCK, CONFIGURATION, LOG}
#: How often a folder is tried that other processes make and remove at the same time.
_TRIES = 20


def configuration_hash(configuration: Mapping[str, Any]) -> str:
    """Hash of what decides a run's numbers."""
    return sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class RunFolder:
    """Where a run ends up (``target``) and where it is made (``partial``)."""

    target: Path
    partial: Path

    @classmethod
    def at(cls, target: Path) -> RunFolder:
        """That of a run which ends up in ``target``."""
        return cls(target, target.with_name(target.name + _PARTIAL))

    @property
    def has_results(self) -> bool:
        """Whether something is there that can be resumed."""
        return any(path.name not in _NOTHING_YET for path in self.partial.iterdir())

    @property
    def is_free(self) -> bool:
        """Whether there is neither a finished nor an unfinished run."""
        return not os.path.lexists(self.target) and not os.path.lexists(self.partial)


@contextmanager
def run_folder(
    out: str | Path | None, stem: str, configuration: Mapping[str, Any], *, resume: bool = False, resumable: bool = True
) -> Iterator[RunFolder]:
    """Claim the folder of a run; it gets its name when the block ends well.

    By default it is the next free one of ``runs/<stem>``, ``runs/<stem>-2`` … With ``resume`` it is that of an
    interrupted run of the same ``configuration``, which is everything that decides the run's numbers; if there is
    none, a new one. The work goes into `RunFolder.partial`. What is there stays for ``--resume`` after an interruption,
    unless it is nothing yet or the run is not ``resumable``; the exception gets a note that says so. Bad input found on
    the way leaves nothing behind, unless an earlier run had left the folder.

    Raises
    ------
    InputError
        If the folder exists, cannot be written to, or belongs to another process or to a run of other settings.
    WriteError
        If the disk fills up; what was written before stays.
    """
    named = None if out is None else named_path(out)
    made: list[Path] = []
    try:
        folder, held, new = _claimed(named, stem, configuration, resume, resumable, made)
    except BaseException:
        _remove_empty(made)
        raise
    try:
        with writing(folder.partial, "Make room, then continue with --resume" if resumable else "Make room"):
            yield folder
        _finish(folder)
    except BaseException as error:
        if not resumable or not folder.has_results or (new and isinstance(error, InputError)):
            _discard(folder.partial)
            _remove_empty(made)
        elif stop := interruption(error):
            stop.add_note(f"What is known so far is in {folder.partial}; the same command with --resume goes on.")
        held.release(folder.partial / LOCK)
        raise
    held.release(folder.target / LOCK)


def differing_settings(record: Path, configuration: Mapping[str, Any]) -> list[str]:
    """Names of the settings that differ from those in a record of earlier work; none without a record.

    Raises
    ------
    InputError
        If the record is damaged.
    """
    if not record.exists():
        return []
    try:
        earlier = dict(json.loads(record.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        hint = f"Remove {record.parent} to start afresh, or choose another folder"
        raise InputError.of(f"file '{record}'", f"is damaged ({error})", hint) from None
    now = json.loads(json.dumps(configuration))
    return sorted(key for key in {*earlier, *now} if earlier.get(key) != now.get(key))


def _claimed(
    out: Path | None,
    stem: str,
    configuration: Mapping[str, Any],
    resume: bool,
    resumable: bool,
    made: list[Path],
) -> tuple[RunFolder, Claim, bool]:
    """The folder, its lock, and whether it is new; parents that had to be made join the list."""
    if out is None and resume and (interrupted := _interrupted(stem, configuration)):
        out = interrupted.target
    if out is None:
        for number in count(1):
            folder = RunFolder.at(Path("runs") / (stem if number == 1 else f"{stem}-{number}"))
            if folder.is_free and (held := _new(folder, "--out", configuration, made)):
                return folder, held, True
    assert out is not None
    folder, where = RunFolder.at(out), f"--out {shortened(out)}"
    for _ in range(_TRIES):
        if os.path.lexists(folder.target):
            _refuse(folder, where, resume)
        if os.path.lexists(folder.partial):
            if held := _taken_up(folder, where, configuration, resume, resumable):
                return folder, held, False
        elif held := _new(folder, where, configuration, made):
            return folder, held, True
    raise InputError.of(where, "other processes are making and removing it", "Choose another folder")


def _new(folder: RunFolder, where: str, configuration: Mapping[str, Any], made: list[Path]) -> Claim | None:
    """Make the partial folder, with its lock and record at once; None if another process was quicker."""
    try:
        staged = _staged(folder, made)
        try:
            held = claim(staged / LOCK)
            write_text(staged / CONFIGURATION, _record(configuration))
            if folder.is_free and _renamed(staged, folder.partial):
                if not os.path.lexists(folder.target):
                    return held
                folder.partial.rename(staged)  # the other process has finished
            held.release()
        except BaseException:  # interrupted: it may have its name already, and nobody else renames it
            if not staged.exists():
                _discard(folder.partial)
            raise
        finally:
            shutil.rmtree(staged, ignore_errors=True)
    except (OSError, WriteError) as error:
        raise unwritable(where, error) from None
    return None


def _staged(folder: RunFolder, made: list[Path]) -> Path:
    """A new folder beside the run's; parents that had to be made join the list."""
    parent = folder.target.parent
    staged = _aside(folder.partial)
    for left in reversed(range(_TRIES)):
        made += [path for path in (parent, *parent.parents) if path not in made and not path.exists()]
        try:
            parent.mkdir(parents=True, exist_ok=True)
            staged.mkdir()
            break
        except FileNotFoundError:  # another process, which had made the parent, has just removed it
            if not left:
                raise
    return staged


def _aside(partial: Path) -> Path:
    """A hidden name beside a folder that no other process or thread uses."""
    return partial.with_name(f".{partial.name}-{os.getpid()}-{threading.get_ident()}-{time.monotonic_ns()}")


def _discard(partial: Path) -> None:
    """Remove a folder; others never see it half removed."""
    with suppress(OSError):
        shutil.rmtree(partial.rename(_aside(partial)))


def _renamed(staged: Path, partial: Path) -> bool:
    """Whether the folder could be renamed; one that is not empty is never replaced."""
    try:
        staged.rename(partial)
    except OSError as error:
        if error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
            return False
        raise
    return True


def _record(configuration: Mapping[str, Any]) -> str:
    return json.dumps(configuration, indent=1, sort_keys=True)


def _taken_up(
    folder: RunFolder, where: str, configuration: Mapping[str, Any], resume: bool, resumable: bool
) -> Claim | None:
    """The lock of a partial folder that an earlier process has left; None if the folder is gone meanwhile."""
    if not folder.partial.is_dir():
        raise InputError.of(where, f"'{folder.partial}' is in the way: it is no folder", "Choose another folder")
    try:
        held = claim(folder.partial / LOCK)
    except TakenError as error:
        raise InputError.of(where, str(error), "Wait for it, or choose another folder") from None
    except FileNotFoundError:
        return None
    except OSError as error:
        raise unwritable(where, error) from None
    try:
        if not folder.has_results:
            write_text(folder.partial / CONFIGURATION, _record(configuration))
        elif not resume:
            remove = f"remove {folder.partial}"
            hint = f"Add --resume, or {remove}" if resumable else f"Choose another folder, or {remove}"
            raise InputError.of(where, "an interrupted run is there", hint)
        elif differing := differing_settings(folder.partial / CONFIGURATION, configuration):
            message = f"the interrupted run was started with other settings ({', '.join(differing)})"
            hint = "Give the same options and file, or start a new run with another --out"
            raise InputError.of(f"--resume {folder.target}", message, hint)
    except BaseException:
        held.release()
        raise
    return held


def _refuse(folder: RunFolder, where: str, resume: bool) -> None:
    if resume and folder.target.is_dir() and not folder.partial.exists():
        raise InputError.of(
            where, "exists already: this run is not interrupted", "Leave --resume out, and name another"
        )
    raise InputError.of(where, "exists already", "Choose another folder, or remove it")


def _interrupted(stem: str, configuration: Mapping[str, Any]) -> RunFolder | None:
    """The latest interrupted run of these settings under ``runs/``; None if nothing is interrupted there."""
    found = [
        RunFolder.at(path.with_name(path.name.removesuffix(_PARTIAL)))
        for path in Path("runs").glob(f"{stem}*{_PARTIAL}")
    ]
    found = [folder for folder in found if folder.partial.is_dir() and folder.has_results]
    for folder in sorted(found, key=lambda folder: folder.partial.stat().st_mtime, reverse=True):
        if not differing_settings(folder.partial / CONFIGURATION, configuration):
            return folder
    if found:
        message = f"no interrupted run with these settings under runs/ ({stem})"
        raise InputError.of("--resume", message, "Name it with --out, or leave --resume out")
    return None


def _finish(folder: RunFolder) -> None:
    """Rename first: a run that is killed in between is whole, with or without its record."""
    try:
        folder.partial.rename(folder.target)
    except OSError as error:
        if not os.path.lexists(folder.target):
            raise
        hint = f"The run is whole in {folder.partial}: rename that folder"
        raise WriteError.of(f"folder '{folder.target}'", "somebody else has made it meanwhile", hint) from error
    (folder.target / CONFIGURATION).unlink(missing_ok=True)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
