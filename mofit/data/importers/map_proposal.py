"""A map proposed from the names, units and shapes of a file's columns: a draft for the user to check."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.alike_records import alike_records, record_pattern, records_alone
from mofit.data.importers.channel_aliases import TIME, key
from mofit.data.importers.channel_proposal import Channels, Guess, find, find_channels, find_time, sample_rate
from mofit.data.importers.contained import Contained
from mofit.data.importers.registry import known_endings
from mofit.data.importers.shapes import jumps
from mofit.data.importers.table import Table, read_table, source_files
from mofit.data.validation import time_issues, usual_rate
from mofit.errors import InputError, Issue, collected
from mofit.runtime.output_file import MAP_MARK
from mofit.runtime.toml import toml_value
from mofit.units import to_si

#: share of its mean by which a column may vary and still be a condition
STEADY = 0.2
#: share of an input's variance that a sine must explain
SINE_SHARE = 0.95
#: jumps of an input that is a pulse, switched on and off
_PULSE = 2
#: columns that are listed as not used
_LISTED = 40
#: names of the columns of a table of dynamic moduli
_MODULI = {
    "frequency": ("f", "freq", "frequency", "frequenz"),
    "storage": ("estor", "estorage", "storage", "storagemodulus", "gstor", "gstorage", "kstor", "speichermodul"),
    "loss": ("eloss", "loss", "lossmodulus", "gloss", "kloss", "verlustmodul"),
    "temperature": ("t", "temp", "temperature", "temperatur"),
}


@dataclass(frozen=True, eq=False)
class ProposedTest:
    """A test that was found in a table, for a picture: what became of its columns."""

    name: str
    table: Table
    time: Guess | None
    channels: Mapping[str, Guess]
    remarks: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MapProposal:
    """Text of a map file (TOML), and the tests in it that are records; of alike records the first."""

    text: str
    tests: Sequence[ProposedTest]


def propose_map(sources: Sequence[Path], contained: Contained | None = None) -> str:
    """A map file (TOML) for these files; raises as `map_proposal`, whose text it is."""
    return map_proposal(sources, contained).text


def map_proposal(sources: Sequence[Path], contained: Contained | None = None) -> MapProposal:
    """A map file (TOML) for these files: one test per file, or more where a file holds several records.

    Names are compared with `mofit.data.importers.channel_aliases`; a column whose unit does not fit is skipped. Where
    no names fit, the units decide, and then the shapes (`mofit.data.importers.shapes`). Where the file has no unit, the
    size of the values decides. Files in which no input and output are found are left out. Comments report all this.
    The ``sources`` are files, and folders of files. Formats that a library parses are read by ``contained``, by default
    a process for this proposal.

    Raises
    ------
    InputError
        If there is no file of a known format, or none in which input and output are found.
    """
    files = source_files([Path(source) for source in sources])
    endings = known_endings()
    chosen = {name: path for name, path in files.items() if {s.lower() for s in path.suffixes} & {*endings}}
    if not chosen:
        raise InputError.of("--guess", "no file of a known format", f"Give files that end in {', '.join(endings)}")
    title = Path(sources[0]).stem.replace("_", " ") if len(sources) == 1 else "My specimen"
    lines: list[str] = []
    tests: list[ProposedTest] = []
    skipped: list[Issue] = []
    # values that overflow are not used
    with np.errstate(all="ignore"), nullcontext(contained) if contained else Contained() as contained:
        for name, path in sorted(chosen.items()):
            with collected(skipped):
                lines += _tests(name, read_table(path, contained), tests)
    if not lines:
        raise InputError(skipped)
    head = [
        f"{MAP_MARK} --guess: check every line before you import",
        f"title = {toml_value(title)}",
        'source = "measured"',
    ]
    notes = [f"# skipped: {_line(issue.where)}: {_line(issue.message)}" for issue in skipped]
    return MapProposal("\n".join([*head, "", *notes, *lines]), tests)


def _line(text: str) -> str:
    """Text that fits in a comment: no control characters."""
    return "".join(sign if sign.isprintable() else " " for sign in text)


def _name(file: Path) -> str:
    """Name of a test: the file's, without the endings of its format, and without points."""
    while file.suffix.lower() in (*known_endings(), ".gz"):
        file = file.with_suffix("")
    return file.name.replace(".", "_")


def _tests(file: str, table: Table, tests: list[ProposedTest]) -> list[str]:
    """Lines of all tests of a file; what they take is added to the tests."""
    name = _name(Path(file))
    if moduli := _moduli(table):
        return list(_moduli_test(name, file, moduli))
    alike = alike_records(table)
    records = records_alone(table, alike) or [table]
    table = records[0]
    lines: list[str] = []
    for channels in find_channels(table):
        own = f"{name}_{channels.name}" if channels.name else name
        time = find_time(table, len(table.column(channels.driver.column)))
        tests.append(ProposedTest(own, table, time, channels.found, channels.remarks))
        lines += _test(own, file, records, channels, time, alike)
    return lines


def _test(
    name: str, file: str, records: Sequence[Table], channels: Channels, time: Guess | None, alike: Sequence[str]
) -> Iterator[str]:
    """Lines of one test, or of one per record where the file has several alike."""
    table = records[0]
    pattern, groups = record_pattern(alike)
    yield from ("[[tests]]", f"name = {toml_value('_'.join([name, *(f'{{{group}}}' for group in groups)]))}")
    yield f"file = {toml_value(file)}"
    if alike:
        yield f"records = {toml_value(pattern)}  # {len(alike)} records; what follows is of the first"
    yield from _procedure(table, time, channels.driver)
    if time is not None:
        yield f"time = {_entry(time)}"
        yield from _resample(records, time)
        if others := _other_times(table, time):
            yield f"# other times of as many samples: {', '.join(others)}; the channels must share the one above"
    elif rate := sample_rate(table):
        yield f'sample_rate = "{rate}"  # no time column: from a constant of the file'
    else:
        yield 'time = { column = "?", unit = "s" }  # no time column found: name it, or give sample_rate = "… Hz"'
    yield from ("", "[tests.channels]", *(f"{name} = {_entry(found)}" for name, found in channels.found.items()))
    conditions = {
        name: found
        for name, words in channels.conditions.items()
        if (found := find(table, name, words.split(), None, {g.column for g in channels.found.values()}))
    }
    if conditions:
        yield from ("", "[tests.conditions]", *(_condition(table, name, found) for name, found in conditions.items()))
    used = {g.column for g in (*channels.found.values(), *conditions.values(), *([time] if time else []))}
    for column, remark in channels.remarks.items():
        if column not in used:
            yield f"# not used: {toml_value(column)}, {_line(remark)}"
    unused = [name for name in table.columns if name not in used and name not in channels.remarks]
    if unused:
        more = f" and {len(unused) - _LISTED} more" if len(unused) > _LISTED else ""
        yield f"# not used: {', '.join(toml_value(name) for name in unused[:_LISTED])}{more}"
    yield ""


def _moduli(table: Table) -> dict[str, Guess]:
    """Columns of a table of dynamic moduli; empty if it is none."""
    found: dict[str, Guess] = {}
    for name, words in _MODULI.items():
        if guess := find(table, name, words, None, {g.column for g in found.values()}):
            found[name] = guess
    return found if {"frequency", "storage", "loss"} <= set(found) else {}


def _moduli_test(name: str, file: str, found: Mapping[str, Guess]) -> Iterator[str]:
    yield from ("[[tests]]", f"name = {toml_value(name)}", f"file = {toml_value(file)}", 'procedure = "sine"', "")
    yield "[tests.moduli]  # a table of dynamic moduli: every row becomes a sine test"
    yield from (f"{key} = {_entry(guess)}" for key, guess in found.items())
    yield from ("deviation = 0.01  # relative standard deviation of both moduli: state yours", "")


def _other_times(table: Table, time: Guess) -> list[str]:
    """Time columns of the same length that hold other times: channels of an MDF file may follow any of them."""
    own = table.column(time.column)
    return [
        toml_value(name)
        for name, values in table.columns.items()
        if key(name) in TIME and len(values) == len(own) and not np.array_equal(values, own, equal_nan=True)
    ]


def _procedure(table: Table, time: Guess | None, driver: Guess) -> Iterator[str]:
    """Lines of the excitation: ``sine`` and its frequency, ``step`` for a pulse, else ``free``."""
    values = table.column(driver.column)
    sound = bool(np.all(np.isfinite(values)) and 0 < np.var(values) < np.inf)
    switched = jumps(values) if sound else 0
    if sound and time is not None and (frequency := _sine_frequency(table, time, values)):
        yield 'procedure = "sine"'
        yield f'frequency = "{frequency:.4g} Hz"  # from the input; amplitude = "…" may be added'
    elif 1 <= switched <= _PULSE:
        yield 'procedure = "step"  # the input is switched'
    else:
        yield 'procedure = "free"'
        if switched:
            yield 'interpolation = "linear"  # the input is switched: a spline would overshoot'


def _sine_frequency(table: Table, time: Guess, values: FloatArray) -> float | None:
    """Frequency in Hz of an input (n,) that is a sine, else None."""
    from mofit.data.signals.periodicity import sine_period  # imports scipy, which an import with a map does not need

    stamps = to_si(table.column(time.column), time.unit, "s")
    if time_issues("", stamps):
        return None
    period = sine_period(stamps, values)
    if period is None or period > np.ptp(stamps):
        return None
    phase = 2 * np.pi * stamps / period
    design = np.column_stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    left = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
    return 1 / period if np.var(left) < (1 - SINE_SHARE) * np.var(values) else None


def _resample(records: Sequence[Table], time: Guess) -> Iterator[str]:
    """The key that brings uneven stamps to one rate, where it can: that of the fastest record, so that none loses."""
    every = [to_si(record.column(time.column), time.unit, "s") for record in records]
    found = [issues[0] for stamps in every if (issues := time_issues("", stamps)) and "resample" in issues[0].hint]
    rate = max((rate for stamps in every if 0 < (rate := usual_rate(stamps)) < np.inf), default=0.0)
    if found and rate:
        of = f"; of {len(found)} of {len(records)} records, and the fastest decides" if len(records) > 1 else ""
        yield f'resample = "{rate:.4g} Hz"  # the time {_line(found[0].message)}{of}'


def _condition(table: Table, name: str, found: Guess) -> str:
    values = table.column(found.column)
    mean, spread = float(np.mean(values)), float(np.ptp(values))
    line = f"{name} = {_entry(found)}"
    if len(values) > 1 and not spread <= STEADY * abs(mean):
        return f"# {line}  varies from {np.min(values):.4g} to {np.max(values):.4g}: not a condition of the whole test"
    return line


def _entry(found: Guess) -> str:
    role = f', role = "{found.role}"' if found.role else ""
    entry = f"{{ column = {toml_value(found.column)}, unit = {toml_value(found.unit)}{role} }}"
    return f"{entry}  # {_line(found.remark)}" if found.remark else entry
