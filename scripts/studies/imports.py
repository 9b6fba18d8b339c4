"""Raw files of others, imported with `mofit import --guess`. Writes reports/imports/README.md.

    python scripts/studies/imports.py [--data ../shared/data] [--work FOLDER]

Every file of measurements under the data folder, as its authors published it, is proposed a map on its own. What the
map gets wrong or cannot know is edited by hand, at most three lines: the edits stand in `EDITS` and in the table. The
edited map is then imported. Rows that the work folder holds already are kept if the same code made
them.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from kept import kept
from mofit.data import Campaign, import_files, propose_map
from mofit.errors import InputError
from report_page import ROOT, header, made_with, table, write_page

#: lines of a proposed map that are replaced, by a pattern of the path: (what the line begins with, the new line)
EDITS: dict[str, tuple[tuple[str, str], ...]] = {
    r"silverbox/": (
        ("time = ", 'sample_rate = "610.3515625 Hz"'),
        ("input_voltage = ", 'force = { column = "V1", unit = "N", role = "input" }'),
        ("output_voltage = ", 'displacement = { column = "V2", unit = "m", role = "output" }'),
    ),
    r"emps/": (
        ("input = ", 'displacement = { column = "qm", unit = "m" }'),
        ("output = ", 'force = { column = "vir", scale = "gtau", unit = "N" }'),
    ),
    r"nrel_dma/": (("deviation = ", "deviation = 0.03"),),
}
#: files that are no measurement
NO_RECORD = {"freq_user_master__shift_factors.csv": "shift factors by temperature, which an author computed"}


@dataclass(frozen=True)
class Row:
    """A file: how many lines were edited and what came of it."""

    file: str
    edited: int
    channels: str
    tests: int
    samples: int
    seconds: float
    refused: str = ""


def data_files(data: Path) -> list[Path]:
    """Files of numbers."""
    return sorted(path for path in data.glob("*/*") if path.suffix.lower() in (".gz", ".csv", ".mat"))


def edited_map(path: Path) -> tuple[str, int]:
    """The proposed map of a file with its edits, and how many lines they changed.

    Raises
    ------
    InputError
        If nothing can be proposed.
    ValueError
        If a line to be edited is not in the proposal: the table of edits is out of date.
    """
    text = propose_map([path])
    count = 0
    for pattern, edits in EDITS.items():
        if not re.search(pattern, path.as_posix()):
            continue
        for begin, line in edits:
            text, found = re.subn(rf"^{re.escape(begin)}.*$", lambda _, line=line: line, text, flags=re.M)  # type: ignore[misc]
            if not found:
                raise ValueError(f"{path.name}: no line begins with {begin!r}")
            count += len(line.splitlines())
    return text, count


def imported(path: Path, folder: Path) -> tuple[Campaign, int]:
    """What a file becomes, and how many lines were edited."""
    text, count = edited_map(path)
    (folder / "map.toml").write_text(text, encoding="utf-8")
    return import_files([path], folder / "map.toml"), count


def measured_row(path: Path) -> Row:
    """Import a file and say how it went."""
    started = time.perf_counter()
    name = f"{path.parent.name}/{path.name}"
    with tempfile.TemporaryDirectory() as folder:
        try:
            campaign, count = imported(path, Path(folder))
        except InputError as error:
            return Row(name, 0, "", 0, 0, time.perf_counter() - started, str(error).splitlines()[0][:200])
    test = campaign.measurements[0]
    channels = f"{', '.join(test.experiment.inputs)} → {', '.join(test.outputs)}"
    samples = sum(len(one.time) for one in campaign.measurements)
    return Row(name, count, channels, len(campaign.measurements), samples, time.perf_counter() - started)


def main() -> None:
    """Import every file and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--work", type=Path, default=Path("runs/imports"))
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    rows = []
    for path in data_files(given.data):
        file = given.work / f"{path.parent.name}-{path.name}.json"
        rows.append(Row(**kept(file, lambda path=path: vars(measured_row(path)))))  # type: ignore[misc]
    cells = [
        (
            row.file,
            row.edited,
            row.channels or "–",
            row.tests,
            row.samples,
            f"{row.seconds:.1f}",
            "no measurement" if Path(row.file).name in NO_RECORD else row.refused or "imported",
        )
        for row in rows
    ]
    done = [row for row in rows if not row.refused]
    most = max((row.edited for row in done), default=0)
    measured = [row for row in rows if Path(row.file).name not in NO_RECORD]
    command = "imports.py"
    lines = header("Raw files, imported with --guess", __doc__ or "", command, made_with())
    lines += [
        f"{len(done)} of {len(measured)} files of measurements become campaigns, at most {most} edited lines each; "
        f"{sum(row.edited == 0 for row in done)} need none. Seconds are wall time of proposal and import on a busy "
        "machine of two cores.",
        "",
        *[
            f"`{name}` lies beside them and holds no measurement: {why}. It has no time, no input and no output, and "
            "`--guess` says so."
            for name, why in NO_RECORD.items()
        ],
        "",
        *table(("file", "edited lines", "channels", "tests", "samples", "s", "result"), cells),
        "## The edits",
        "",
        *table(
            ("files", "edited to"),
            [(f"`{pattern}`", f"`{line}`".replace("\n", "`, `")) for pattern, es in EDITS.items() for _, line in es],
        ),
    ]
    write_page("imports", lines)


if __name__ == "__main__":
    main()
