"""A tyre property file (``.tir``, Magic Formula 5.2 or 6.1) as text: its numbers read, some of them replaced."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from mofit.errors import InputError, Issue, raise_errors

#: ``FITTYP`` of the versions
_VERSIONS = {"5": "5.2", "6": "5.2", "21": "5.2", "52": "5.2", "61": "6.1"}
_ENTRY = re.compile(r"^(\s*([A-Za-z_]\w*)\s*=\s*)([^\s$!]+|'[^']*')")
#: units in which the numbers are read and written
_UNITS = {"LENGTH": ("meter", "m", "meters"), "FORCE": ("newton", "n"), "ANGLE": ("radian", "radians", "rad")}


@dataclass(frozen=True)
class Replacement:
    """A new number of an entry, and the comment line above it."""

    value: float
    comment: str


@dataclass(frozen=True)
class TirFile:
    """The text of a file, byte by byte (latin-1, with its own line ends)."""

    text: str
    where: str

    @classmethod
    def of_bytes(cls, content: bytes, where: str) -> TirFile:
        """Read and check a file.

        Raises
        ------
        InputError
            If it is no property file of Magic Formula 5.2 or 6.1 in metre, newton and radian.
        """
        found = cls(content.decode("latin-1"), where)
        found.check()
        return found

    @cached_property
    def lines(self) -> list[str]:
        """Lines with their ends."""
        return re.findall(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+$", self.text)

    @cached_property
    def entries(self) -> dict[str, list[tuple[int, str]]]:
        """Line number and value of every key; several where it is given more than once."""
        found: dict[str, list[tuple[int, str]]] = {}
        for number, line in enumerate(self.lines):
            if match := _ENTRY.match(line):
                found.setdefault(match[2].upper(), []).append((number, match[3].strip("'\"")))
        return found

    @property
    def version(self) -> str:
        """``5.2`` or ``6.1``; empty for another."""
        return _VERSIONS.get(self._one("FITTYP").partition(".")[0], "")

    def check(self) -> None:
        """Raise every reason why the file cannot be patched."""
        issues = []
        if not self.version:
            given = self._one("FITTYP")
            what = f"FITTYP is {given}" if given else "it has no FITTYP"
            issues.append(Issue(self.where, what, "Give a property file of Magic Formula 5.2 (FITTYP 6) or 6.1 (61)"))
        for key, known in _UNITS.items():
            given = self._one(key).lower()
            if given and given not in known:
                what = f"its unit of {key.lower()} is '{given}'"
                issues.append(Issue(self.where, what, f"Convert it to '{known[0]}': its numbers are read as such"))
        raise_errors(issues)

    def _one(self, key: str) -> str:
        found = self.entries.get(key)
        return found[-1][1] if found else ""

    def has(self, key: str) -> bool:
        """Whether the key is there once, with a number."""
        found = self.entries.get(key, [])
        return len(found) == 1 and _number(found[0][1]) is not None

    def number(self, key: str, default: float | None = None) -> float:
        """The number of a key, or the default of the format.

        Raises
        ------
        InputError
            If it is missing without a default, given twice, or no number.
        """
        found = self.entries.get(key, [])
        if not found and default is not None:
            return default
        value = _number(found[0][1]) if len(found) == 1 else None
        if value is None:
            what = f"it has no {key}" if not found else f"{key} is given twice or is no number"
            raise InputError.of(self.where, what, "Complete the template")
        return value

    def patched(self, replacements: Mapping[str, Replacement]) -> bytes:
        """The file with other numbers, and a comment line above each; every other byte as it was."""
        lines = list(self.lines)
        for key, new in replacements.items():
            number = self.entries[key][0][0]
            line = lines[number]
            match = _ENTRY.match(line)
            assert match is not None
            end = re.search(r"(\r\n|\r|\n)$", line)
            lines[number] = f"$ {new.comment}{end[1] if end else chr(10)}{match[1]}{new.value!r}{line[match.end() :]}"
        return "".join(lines).encode("latin-1")


def _number(text: str) -> float | None:
    try:
        return float(text.lower().replace("d", "e"))
    except ValueError:
        return None
