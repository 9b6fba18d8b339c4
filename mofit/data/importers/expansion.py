"""The tests that a map's patterns stand for: one per file, and one per record inside a file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from mofit.data.importers.import_map import TestMap
from mofit.data.importers.table import Table
from mofit.errors import Issue, collected, did_you_mean
from mofit.units import parse_quantity


class _Groups(dict[str, str]):
    """Groups of a file name; ``{group}`` of a record stays until its turn."""

    def __missing__(self, key: str) -> str:
        return f"{{{key}}}"


def expanded(
    tests: Sequence[TestMap], files: Mapping[str, Path], load: Callable[[Path], Table], issues: list[Issue]
) -> Iterator[tuple[TestMap, Table]]:
    """One test with its table per file, or per record of a file; what is wrong is added to the issues."""
    for test in tests:
        for of_file in _of_files(test, files, issues):
            with collected(issues):
                table = load(files[of_file.file or ""])
                if of_file.records is None:
                    yield of_file, table
                else:
                    yield from _of_records(of_file, table, issues)


def _of_files(test: TestMap, files: Mapping[str, Path], issues: list[Issue]) -> list[TestMap]:
    """One entry per file: a pattern is matched against the file names, ordered by frequency."""
    where = f"test '{test.name}'"
    if test.pattern is None:
        if test.file in files:
            return [test]
        issues.append(Issue(where, f"there is no file '{test.file}'", did_you_mean(str(test.file), files)))
        return []
    hint = "Give the folder of the files before --map, or correct the pattern"
    found = _matched(test, "pattern", list(files), hint, issues)
    return [filled.model_copy(update={"file": name, "pattern": None}) for name, filled in found]


def _of_records(test: TestMap, table: Table, issues: list[Issue]) -> Iterator[tuple[TestMap, Table]]:
    """One entry per record: the pattern is matched against what stands before the points of column names."""
    hint = f"file '{table.name}' has the records {', '.join(table.records()[:10]) or 'none'}"
    for name, filled in _matched(test, "records", table.records(), hint, issues):
        yield filled, table.record(name)


def _matched(
    test: TestMap, key: str, names: Sequence[str], hint: str, issues: list[Issue]
) -> list[tuple[str, TestMap]]:
    """Names that a pattern of the test matches, with the test filled in, ordered by frequency."""
    where, pattern = f"test '{test.name}'", getattr(test, key)
    try:
        matches = [(name, match) for name in names if (match := re.fullmatch(pattern, name))]
        filled = [(name, _fill(test, match, key == "pattern" and test.records is not None)) for name, match in matches]
    except (re.error, KeyError, IndexError) as error:
        advice = "Write a regular expression, and fill in only groups that it names"
        issues.append(Issue(where, f"{key} '{pattern}': {error}", advice))
        return []
    if not filled:
        issues.append(Issue(where, f"no {'file' if key == 'pattern' else 'record'} matches '{pattern}'", hint))
    return sorted(filled, key=lambda entry: parse_quantity(where, entry[1].frequency or 0.0, "Hz")[0])


def _fill(test: TestMap, match: re.Match[str], partly: bool) -> TestMap:
    """The test with ``{group}`` filled in; ``partly`` if a pattern of records follows."""
    found = {key: (text or "").replace(test.decimal, ".") for key, text in match.groupdict().items()}
    groups = _Groups(found) if partly else found
    texts = {
        key: value
        for key, value in test.model_dump().items()
        if isinstance(value, str) and key not in ("pattern", "records")
    }
    filled = {key: value.format_map(groups) for key, value in texts.items()}
    own = {key: v.format_map(groups) if isinstance(v, str) else v for key, v in test.conditions.items()}
    return test.model_copy(update={**filled, "conditions": own})
