"""Names and titles that a campaign file and a result file can hold."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable

from mofit.errors import Issue

#: bytes of a name in UTF-8: netCDF takes 256, and a result adds endings such as "_weight"
LONGEST_NAME = 200
#: characters of a title, which heads every page
LONGEST_TITLE = 200
#: control characters, half characters, and separators of lines and paragraphs
_FORBIDDEN = ("Cc", "Cs", "Zl", "Zp")
#: characters of a name that a message shows
_SHOWN = 40


def name_issues(where: str, what: str, names: Iterable[str]) -> list[Issue]:
    """An issue for every name that netCDF cannot hold as a group or variable; ``what`` says what they name."""
    hint = "Rename it: letters, digits, spaces and any signs but '/' behind a first letter or digit"
    return [Issue(where, f"the {what} name '{shown(name)}' {fault}", hint) for name in names if (fault := _fault(name))]


def channel_name_issues(where: str, channels: Iterable[str], conditions: Iterable[str]) -> list[Issue]:
    """The same for channels and conditions of a test, which must also differ from its time."""
    channels, conditions = list(channels), list(conditions)
    issues = name_issues(where, "channel", channels) + name_issues(where, "condition", conditions)
    if "time" in (*channels, *conditions):
        issues.append(Issue(where, "'time' names a channel or condition", "Rename it: the time axis has this name"))
    both = sorted({*channels} & {*conditions})
    issues += [Issue(where, f"'{shown(name)}' is a channel and a condition", "Rename one of them") for name in both]
    return issues


def title_issues(where: str, title: str) -> list[Issue]:
    """A title that is too long for a page, or that cannot be stored."""
    hint = "Describe in a few words what was tested"
    if wrong := _forbidden(title):
        return [Issue(where, f"the title holds {wrong}", hint)]
    if len(title) > LONGEST_TITLE:
        return [Issue(where, f"the title has {len(title)} characters, more than {LONGEST_TITLE}", hint)]
    return []


def shown(text: str) -> str:
    """Text as a message can show it: without control characters, and not too long."""
    safe = "".join(sign if unicodedata.category(sign) not in _FORBIDDEN else f"\\x{ord(sign):02x}" for sign in text)
    return safe if len(safe) <= _SHOWN else f"{safe[:_SHOWN]}…"


def _fault(name: str) -> str:
    """What is wrong with a name; nothing if it can be stored and read again."""
    if not name:
        return "is empty"
    if wrong := _forbidden(name):
        return f"holds {wrong}"
    if "/" in name:
        return "holds '/', which would make a group inside a group"
    if not ((name[0].isascii() and name[0].isalnum()) or name[0] == "_" or ord(name[0]) > 127) or name[0].isspace():
        return f"begins with '{name[0]}'"
    if name[-1].isspace():
        return "ends with a space"
    if (length := len(name.encode())) > LONGEST_NAME:
        return f"takes {length} bytes, more than {LONGEST_NAME}"
    if unicodedata.normalize("NFC", name) != name:
        return "has its accents apart from their letters (it is not in Unicode's form NFC)"
    return ""


def _forbidden(text: str) -> str:
    """The first character that is no text, in words."""
    for sign in text:
        if unicodedata.category(sign) in _FORBIDDEN:
            return f"the control character \\x{ord(sign):02x}"
    return ""
