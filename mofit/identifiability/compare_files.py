"""From files and options to a comparison, and what ``--json`` prints of it: what the command ``mofit compare`` does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mofit.campaign import Campaign
from mofit.errors import Fault, raise_errors
from mofit.identifiability.compare import compare, procedures_of
from mofit.identifiability.comparison import Comparison, Entry
from mofit.identifiability.mend import Mend, cheapest_mend
from mofit.identifiability.points import POINTS, around, at_values, of_run
from mofit.identifiability.sources import Source, read_source
from mofit.identifiability.telling import tell
from mofit.model import Model
from mofit.progress import Progress, silent
from mofit.simulate import Plan


@dataclass(frozen=True)
class CompareJob:
    """A comparison as a user asks for it.

    Parameters
    ----------
    files
        Campaigns and plans.
    parameters
        Those that matter; by default all that no calibration stage knows.
    groups
        Names of procedures and of the tests in each.
    at
        Values that the verdicts are asked at.
    run
        Folder of a run, whose posterior takes the place of the box around those values.
    points
        How many parameter sets.
    seed, jobs
        Seed of every random draw; threads.
    """

    files: tuple[Path, ...]
    parameters: tuple[str, ...] = ()
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    at: Mapping[str, float] = field(default_factory=dict)
    run: Path | None = None
    points: int = POINTS
    seed: int = 0
    jobs: int = 1


def compare_files(
    job: CompareJob, choose: Callable[[Plan | Campaign], Model], progress: Progress = silent
) -> tuple[Comparison, dict[str, Mend | None]]:
    """Read, compare, and look for the cheapest mend of every parameter asked for that nothing identifies.

    Raises
    ------
    InputError
        With what is wrong with files and options.
    """
    progress("read", 0, len(job.files), "")
    named = tuple(dict.fromkeys(test for tests in job.groups.values() for test in tests))
    stems = [path.stem for path in job.files]
    raise_errors(
        [Fault("FILE", "none is given", "Name a campaign or a plan")] if not job.files else
        [Fault(f"FILE {stem}", "two files have this name", "Rename one of them")
         for stem in sorted({stem for stem in stems if stems.count(stem) > 1})]
    )  # fmt: skip
    sources = [read_source(path, choose, named, job.jobs, job.seed) for path in job.files]
    raise_errors(
        Fault(f"FILE {source.name}", f"its model is '{source.model.name}', not '{sources[0].model.name}'",
              "Name --model") for source in sources if source.space.names != sources[0].space.names
    )  # fmt: skip
    told = [tell(source, _points(job, source), job.jobs) for source in sources]
    comparison = compare(told, procedures_of(sources, job.groups), job.parameters, jobs=job.jobs, progress=progress)
    mends = {}
    for name in comparison.lost:
        best = min(comparison.judged, key=lambda row: row.entries[name].relative_sd)
        mends[name] = cheapest_mend(comparison.told[best.procedure.source], best.procedure, name, job.jobs)
    return comparison, mends


def _points(job: CompareJob, source: Source) -> np.ndarray:
    values = at_values(source.space, source.values, job.at)
    if job.run is not None:
        from mofit.result import open_result

        return of_run(open_result(job.run), source.space, values, job.points, job.seed)
    free = tuple(name for name in source.space.names if name not in source.calibrated)
    return around(source.space, values, free, job.points, job.seed)


def summary(comparison: Comparison, mends: Mapping[str, Mend | None]) -> dict[str, Any]:
    """The comparison as plain data, for ``--json``; SI units."""
    source = comparison.told[0].source
    values = comparison.told[0].values[0]
    return {
        "model": source.model.name,
        "values": {
            name: {"value": float(value), "unit": source.space[name].unit}
            for name, value in zip(source.space.names, values, strict=True)
        },
        "points": len(comparison.told[0].values),
        "procedures": [
            {
                "name": row.procedure.name,
                "source": comparison.told[row.procedure.source].source.name,
                "tests": list(row.procedure.tests),
                "seconds": row.seconds,
                "condition_index": row.condition,
                "parameters": {name: _entry(entry, comparison) for name, entry in row.entries.items()},
            }
            for row in comparison.judged
        ],
        "carried": [
            {
                "procedure": each.procedure,
                "share": {
                    name: dict(zip(each.tests, map(float, each.share[:, k]), strict=True))
                    for k, name in enumerate(comparison.parameters)
                },
            }
            for each in comparison.carried
        ],
        "not_identifiable": list(comparison.lost),
        "mends": {
            name: None if mend is None else {"test": mend.words, "repeats": mend.repeats, "seconds": mend.seconds,
                                             "sd": mend.sd}
            for name, mend in mends.items()
        },
        "notes": list(comparison.notes),
    }  # fmt: skip


def _entry(entry: Entry, comparison: Comparison) -> dict[str, Any]:
    space = comparison.told[0].source.space
    interval = None
    if entry.limits is not None:
        place = space.index(entry.parameter)
        unit = space.to_unit(comparison.told[0].values[0])

        def natural(limit: float) -> float | None:
            if not np.isfinite(limit):
                return None
            unit[place] = limit
            return float(space.from_unit(unit)[place])

        interval = [natural(entry.limits.low), natural(entry.limits.high)]
    return {
        "sd": entry.sd,
        "relative_sd": entry.relative_sd,
        "verdict": entry.verdict,
        "unit": space[entry.parameter].unit,
        "sd_at_values": entry.sd_here,
        "relative_sd_range": [entry.low, entry.high],
        "relative_sd_after_60_s": entry.per_minute,
        "bound_sd": entry.bound_sd,
        "conditional_sd": entry.conditional_sd,
        "variance_inflation": entry.inflation,
        "profile_interval": interval,
        "partners": list(entry.partners),
        "verdicts": dict(entry.verdicts),
        "sentence": entry.sentence,
    }


def mend_sentence(name: str, mend: Mend | None, comparison: Comparison) -> str:
    """What would make a parameter identifiable."""
    if mend is None:
        return f"{name}: no single sine, chirp or step within ten minutes would make it identifiable."
    often = "" if mend.repeats == 1 else f", {mend.repeats} times"
    space = comparison.told[0].source.space
    value = comparison.told[0].values[0, space.index(name)]
    size = f"{100 * mend.sd / abs(value):.2g} %" if value else f"{mend.sd:.3g} {space[name].unit}"
    return f"Cheapest mend for {name}: one more test, {mend.words}, 20 s{often}: ±{size}."


def parse_groups(entries: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """``["low=a,b"]`` to ``{"low": ("a", "b")}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=TEST,TEST, and names used twice.
    """
    found: dict[str, tuple[str, ...]] = {}
    faults = []
    for entry in entries:
        name, _, text = entry.partition("=")
        tests = tuple(test.strip() for test in text.split(",") if test.strip())
        if not name.strip() or not tests:
            faults.append(Fault(f"--group {entry}", "is not NAME=TEST,TEST", "Write --group low=sine_a,sine_b"))
        elif name.strip() in found:
            faults.append(Fault(f"--group {entry}", "the name is used twice", "Rename one of them"))
        found[name.strip()] = tests
    raise_errors(faults)
    return found
