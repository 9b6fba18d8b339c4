"""The folder of a run: worked on under a temporary name, renamed when done, taken up again by ``--resume``."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import Any

from mofit.errors import InputError
from mofit.runtime.files import write_text

_PARTIAL = ".partial"
CONFIGURATION = "configuration.json"


def configuration_hash(configuration: Mapping[str, Any]) -> str:
    """Hash of what decides a run's numbers."""
    return sha256(json.dumps(configuration, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class RunFolder:
    """Where a run ends up (``target``) and where it is made (``partial``)."""

    target: Path
    partial: Path

    @contextmanager
    def at_work(self, configuration: Mapping[str, Any]) -> Iterator[Path]:
        """The partial folder; renamed to the target on success, kept for ``--resume`` when interrupted.

        Bad input found on the way leaves nothing behind, unless an earlier run had left the folder.
        """
        new = not self.partial.exists()
        self.partial.mkdir(parents=True, exist_ok=True)
        record = self.partial / CONFIGURATION
        if not record.exists():
            write_text(record, json.dumps(configuration, indent=1, sort_keys=True))
        try:
            yield self.partial
        except InputError:
            if new:
                shutil.rmtree(self.partial)
            raise
        record.unlink()
        os.replace(self.partial, self.target)


def plan_folder(out: Path | None, stem: str, configuration: Mapping[str, Any], *, resume: bool) -> RunFolder:
    """Find the folder of a run; nothing is written yet.

    By default it is the next free one of ``runs/<stem>``, ``runs/<stem>-2`` … With ``resume`` it is that of an
    interrupted run of the same ``configuration``, which is everything that decides the run's numbers.

    Raises
    ------
    InputError
        If the folder exists, or there is nothing (or something else) to resume.
    """
    if resume:
        return _interrupted(out, stem, configuration)
    if out is not None:
        folder = _folder(out)
        if folder.target.exists():
            raise InputError.of(f"--out {out}", "exists already", "Choose another folder, or remove it")
        if folder.partial.exists():
            hint = f"Add --resume, or remove {folder.partial}"
            raise InputError.of(f"--out {out}", "an interrupted run is there", hint)
        return folder
    names = (stem if number == 1 else f"{stem}-{number}" for number in count(1))
    folders = (_folder(Path("runs") / name) for name in names)
    return next(folder for folder in folders if not folder.target.exists() and not folder.partial.exists())


def differing_settings(record: Path, configuration: Mapping[str, Any]) -> list[str]:
    """Names of the settings that differ from those in a record of earlier work; none without a record."""
    if not record.exists():
        return []
    earlier = json.loads(record.read_text(encoding="utf-8"))
    now = json.loads(json.dumps(configuration))
    return sorted(key for key in {*earlier, *now} if earlier.get(key) != now.get(key))


def partial_folder(target: Path) -> Path:
    """Where a run that ends up in ``target`` is worked on."""
    return target.with_name(target.name + _PARTIAL)


def _folder(target: Path) -> RunFolder:
    return RunFolder(target, partial_folder(target))


def _interrupted(out: Path | None, stem: str, configuration: Mapping[str, Any]) -> RunFolder:
    if out is not None:
        folder = _folder(out)
        if not folder.partial.exists():
            raise InputError.of(f"--out {out}", "there is no interrupted run to resume", "Leave --resume out")
        if differing := differing_settings(folder.partial / CONFIGURATION, configuration):
            message = f"the interrupted run was started with other settings ({', '.join(differing)})"
            hint = "Give the same options and file, or start a new run with another --out"
            raise InputError.of(f"--resume {out}", message, hint)
        return folder
    candidates = sorted(Path("runs").glob(f"{stem}*{_PARTIAL}"), key=lambda path: path.stat().st_mtime, reverse=True)
    for partial in candidates:
        if not differing_settings(partial / CONFIGURATION, configuration):
            return RunFolder(partial.with_name(partial.name.removesuffix(_PARTIAL)), partial)
    message = f"no interrupted run with these settings under runs/ ({stem})"
    raise InputError.of("--resume", message, "Name it with --out, or leave --resume out")
