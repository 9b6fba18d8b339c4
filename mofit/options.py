"""Values of command-line options written NAME=VALUE."""

from __future__ import annotations

from collections.abc import Iterable

from mofit.errors import Fault, raise_errors


def by_name(option: str, entries: Iterable[str]) -> dict[str, float]:
    """``["a=1", "b=2"]`` to ``{"a": 1.0, "b": 2.0}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=NUMBER.
    """
    found: dict[str, float] = {}
    faults = []
    for entry in entries:
        name, _, text = entry.partition("=")
        try:
            found[name.strip()] = float(text)
        except ValueError:
            faults.append(Fault(f"{option} {entry}", "is not NAME=NUMBER", f"Write {option} name=1.5"))
    raise_errors(faults)
    return found


def range_by_name(option: str, entries: Iterable[str]) -> dict[str, tuple[float, float]]:
    """``["a=1:2"]`` to ``{"a": (1.0, 2.0)}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=LOWER:UPPER.
    """
    found: dict[str, tuple[float, float]] = {}
    faults = []
    for entry in entries:
        name, _, text = entry.partition("=")
        lower, _, upper = text.partition(":")
        try:
            found[name.strip()] = (float(lower), float(upper))
        except ValueError:
            faults.append(Fault(f"{option} {entry}", "is not NAME=LOWER:UPPER", f"Write {option} name=1:2"))
    raise_errors(faults)
    return found
