"""Issues with an input: where, what, and a hint to the solution."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal


@dataclass(frozen=True)
class Issue:
    """One error or warning about an input."""

    where: str
    """The place: file, group, variable, option or parameter."""
    message: str
    """What was found there, with the value."""
    hint: str
    """What the user can do about it."""
    severity: Literal["error", "warning"] = "error"
    """An ``error`` stops the work, a ``warning`` does not."""

    def __str__(self) -> str:
        end = "" if self.hint.endswith("?") else "."
        return f"{self.where}: {self.message.rstrip('.')}. {self.hint.rstrip('.')}{end}"


class MofitError(Exception):
    """Base of every error that mofit raises on purpose."""


class InputError(MofitError):
    """The input cannot be used (exit code 2). Carries every issue found, not just the first."""

    def __init__(self, issues: Iterable[Issue]) -> None:
        self.issues = tuple(issues)
        super().__init__("\n".join(str(issue) for issue in self.issues))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Issue, ...]]]:
        """Pickle with the issues, which the message alone does not carry."""
        return type(self), (self.issues,)

    @classmethod
    def of(cls, where: str, message: str, hint: str) -> InputError:
        """An error with a single issue."""
        return cls([Issue(where, message, hint)])


class WriteError(MofitError):
    """An output could not be written (exit code 2): a full disk, a quota. What was written before stays."""

    def __init__(self, issue: Issue) -> None:
        self.issue = issue
        super().__init__(issue)

    @classmethod
    def of(cls, where: str, message: str, hint: str) -> WriteError:
        """An error with its place and a hint."""
        return cls(Issue(where, message, hint))

    def with_hint(self, hint: str) -> WriteError:
        """The same for one who can do something else about it."""
        return type(self)(replace(self.issue, hint=hint))


def raise_errors(issues: Iterable[Issue]) -> None:
    """Raise one `InputError` with all issues of severity ``error``, if there are any."""
    errors = [issue for issue in issues if issue.severity == "error"]
    if errors:
        raise InputError(errors)


@contextmanager
def collected(issues: list[Issue]) -> Iterator[None]:
    """Add the issues of an `InputError` that the block raises to the list, and continue after the block."""
    try:
        yield
    except InputError as error:
        issues += error.issues


def check_settings(what: str, settings: object, checks: Iterable[tuple[str, bool, str]]) -> None:
    """Raise one `InputError` with every setting that cannot be used, if there are any.

    ``what`` says whose settings they are ("search", "sampler"); a check is the name of an attribute of ``settings``,
    whether its value can be used, and the hint if not.
    """
    raise_errors(
        Issue(f"{what} setting '{name}'", f"{getattr(settings, name)!r} cannot be used", hint)
        for name, fine, hint in checks
        if not fine
    )


def repeated(names: Iterable[str]) -> list[str]:
    """Names that occur more than once, sorted."""
    return sorted(name for name, count in Counter(names).items() if count > 1)


#: names that a hint lists: more are no help in a terminal
_LISTED = 40


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint for an unknown name: the closest known one, else a list of all, or of the first if they are many."""
    known = sorted(known)
    folded = [other for other in known if other.casefold() == name.casefold()]
    close = folded or difflib.get_close_matches(name, known, n=1)
    if close:
        return f"Did you mean '{close[0]}'?"
    shown, more = known[:_LISTED], len(known) - _LISTED
    return f"Known are: {', '.join(shown) or 'none'}{f' and {more} more' if more > 0 else ''}"
