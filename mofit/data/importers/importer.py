"""From files and a map to a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import cache, partial
from pathlib import Path

import numpy as np

from mofit.data.campaign import Campaign, Experiment, Measurement
from mofit.data.importers.contained import Contained
from mofit.data.importers.expansion import expanded
from mofit.data.importers.import_map import TestMap, read_map
from mofit.data.importers.moduli import moduli_tests
from mofit.data.importers.record import read_conditions, read_record
from mofit.data.importers.stretches import Stretch, stretches
from mofit.data.importers.table import read_table, source_files
from mofit.data.names import name_issues, shown, title_issues
from mofit.data.validation import experiment_issues, finite_issues
from mofit.errors import collected, raise_errors


def import_files(sources: Sequence[Path], map_path: Path, contained: Contained | None = None) -> Campaign:
    """Read the tests that a map names into one campaign, in SI units.

    The map's file names are looked up in the ``sources``, files and folders; without any, in the folder of the map.
    Formats that a library parses are read by ``contained``, by default a process for this import. A record that is
    resampled becomes one test per stretch without gaps.

    Raises
    ------
    InputError
        With the issues of the map, of the files and of every test together.
    """
    map_path = Path(map_path)
    plan = read_map(map_path)
    files = source_files([Path(source) for source in sources] or [map_path.parent])
    issues = title_issues("title", plan.title) + name_issues("attributes", "attribute", plan.attributes)
    conditions, units = read_conditions("root", plan.conditions, issues)
    measurements = []
    # what overflows becomes infinite, and is counted as such
    with np.errstate(all="ignore"), nullcontext(contained) if contained else Contained() as contained:
        load = cache(partial(read_table, contained=contained))
        for test, table in expanded(plan.tests, files, load, issues):
            with collected(issues):
                if test.moduli is not None:
                    measurements += moduli_tests(test, test.moduli, table, conditions)
                    continue
                record = read_record(test, table, conditions)
                units |= record.condition_units
                found = stretches(test, record)
                for number, stretch in enumerate(found, 1):
                    name = test.name if len(found) == 1 else f"{test.name}_{number}"
                    with collected(issues):
                        measurements.append(_measurement(name, test, stretch, conditions))
    raise_errors(dict.fromkeys(issues))
    return Campaign(plan.title, plan.source, conditions, tuple(measurements), dict(plan.attributes), units)


def _measurement(name: str, test: TestMap, stretch: Stretch, shared: Mapping[str, float]) -> Measurement:
    """A test from a stretch of a record; ``shared`` are the conditions of the campaign."""
    where = f"test '{shown(name)}'"
    record, time = stretch.record, stretch.record.time
    time = time - time[0] if time.size else time
    issues = experiment_issues(where, test.procedure, time, record.channels, record.numbers["frequency"])
    means = {key: float(np.mean(values)) if values.size else np.nan for key, values in record.sensed.items()}
    for key, values in record.sensed.items():
        if bad := finite_issues(f"{where}, condition '{key}'", values):
            issues += bad
        elif values.size:  # the mean of huge numbers may overflow
            issues += finite_issues(f"{where}, mean of '{key}'", np.atleast_1d(means[key]))
    raise_errors(issues)
    numbers = {key: record.numbers[key] for key in ("frequency", "amplitude", "start_time", "transient")}
    experiment = Experiment(
        name, test.procedure, time, record.channels["input"], {**shared, **record.conditions, **means}, **numbers,
        interpolation=test.interpolation,
    )  # fmt: skip
    return Measurement(experiment, record.channels["output"], record.units, stretch.gaps, stretch.history)
