"""What can go wrong, said so that it can be mended: where, what, and the cure."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong (``error``) or odd (``warning``) with an input.

    Parameters
    ----------
    where
        The place: file, group, variable, option or parameter.
    what
        What was found there, with the value.
    cure
        What the user can do about it.
    severity
        An ``error`` stops the work, a ``warning`` does not.
    """

    where: str
    what: str
    cure: str
    severity: Literal["error", "warning"] = "error"

    def __str__(self) -> str:
        end = "" if self.cure.endswith("?") else "."
        return f"{self.where}: {self.what.rstrip('.')}. {self.cure.rstrip('.')}{end}"


class MofitError(Exception):
    """Base of every error that mofit raises on purpose."""


class InputError(MofitError):
    """The input cannot be used (exit code 2). Carries every fault found, not just the first."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Fault, ...]]]:
        """From one process to another with its faults, which the message alone does not hold."""
        return type(self), (self.faults,)

    @classmethod
    def of(cls, where: str, what: str, cure: str) -> InputError:
        """An error with a single fault."""
        return cls([Fault(where, what, cure)])


def raise_errors(faults: Iterable[Fault]) -> None:
    """Raise one `InputError` with all faults of severity ``error``, if there are any."""
    errors = [fault for fault in faults if fault.severity == "error"]
    if errors:
        raise InputError(errors)


def check_settings(what: str, settings: object, checks: Iterable[tuple[str, bool, str]]) -> None:
    """Raise one `InputError` with every setting that cannot be used, if there are any.

    Parameters
    ----------
    what
        Whose settings they are: "search", "sampler".
    settings
        Holds the values as attributes.
    checks
        Name of the attribute, whether its value can be used, and the cure if not.
    """
    raise_errors(
        Fault(f"{what} setting '{name}'", f"{getattr(settings, name)!r} cannot be used", cure)
        for name, fine, cure in checks
        if not fine
    )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A cure for an unknown name: the closest known one, else the list of all."""
    known = sorted(known)
    folded = [other for other in known if other.casefold() == name.casefold()]
    close = folded or difflib.get_close_matches(name, known, n=1)
    if close:
        return f"Did you mean '{close[0]}'?"
    return f"Known are: {', '.join(known) or 'none'}"
