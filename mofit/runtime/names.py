"""Names of outputs: which of them a new file or folder can have, and how a message shows them."""

from __future__ import annotations

from pathlib import Path

from mofit.errors import InputError
from mofit.runtime.files import unwritable


def named_path(out: str | Path, option: str = "--out") -> Path:
    """The path that an option names, if it can be a new file or folder; else an `InputError`."""
    path = Path(out)
    if not str(out).strip() or path.name in ("", ".."):
        raise InputError.of(f"{option} '{out}'", "names no new file or folder", "Give a name")
    try:
        path.exists()
    except (OSError, ValueError) as error:  # too long, or with a zero byte
        raise unwritable(f"{option} {shortened(path)}", error) from None
    return path


def shortened(path: Path) -> str:
    """A path for a message, its middle left out where it is long."""
    text = str(path)
    return text if len(text) <= 120 else f"{text[:60]}…{text[-40:]}"


def slug(title: str) -> str:
    """A title as the name of a folder: small letters and digits with hyphens between; empty if it has neither."""
    return "-".join("".join(c if c.isalnum() else " " for c in title.lower()).split())[:40]
