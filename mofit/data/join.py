"""Several campaigns as one: the same channels under other conditions, or of other specimens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from mofit.data.campaign import Campaign, Measurement
from mofit.data.campaign_file import read_campaign
from mofit.data.names import LONGEST_TITLE
from mofit.errors import InputError, Issue, raise_errors, repeated

#: condition that tells the campaigns apart: their number, from 1, where a file does not state it
SPECIMEN = "specimen"
#: attribute with the names of the campaigns, one a line
SPECIMENS = "specimens"


def read_joined(files: Sequence[Path]) -> Campaign:
    """The campaigns of at least one file as one; see `joined`.

    Raises
    ------
    InputError
        As `read_campaign` and `joined`.
    """
    return joined([read_campaign(file) for file in files], [file.stem for file in files])


def joined(campaigns: Sequence[Campaign], names: Sequence[str]) -> Campaign:
    """One campaign with the tests of all, each under the conditions of its own.

    Parameters
    ----------
    campaigns
        At least one; a single one is returned as it is.
    names
        One per campaign, as the stems of their files. A test whose name another campaign has too gets it in front, and
        the attribute ``specimens`` lists them. The condition ``specimen`` is the number of the campaign, from 1.

    Raises
    ------
    InputError
        If measured and simulated ones are mixed, one name is given twice, or a condition has two units.
    """
    if len(campaigns) == 1:
        return campaigns[0]
    sources = {campaign.source for campaign in campaigns}
    where = f"campaigns {', '.join(names)}"
    issues = [Issue(where, f"the name '{name}' is used twice", "Rename a file") for name in repeated(names)]
    if len(sources) > 1:
        issues.append(Issue(where, "some are measured, others simulated", "Join only what was made alike"))
    units: dict[str, str] = {}
    for campaign in campaigns:
        for name, unit in campaign.units.items():
            if units.setdefault(name, unit) != unit:
                message = f"condition '{name}' is in {units[name]} and in {unit}"
                issues.append(Issue(where, message, "Give it one unit"))
    raise_errors(issues)
    clashes = set(repeated([test for campaign in campaigns for test in campaign.tests]))
    measurements: list[Measurement] = []
    for number, (campaign, name) in enumerate(zip(campaigns, names, strict=True), start=1):
        for measurement in campaign.measurements:
            test, conditions = measurement.experiment, measurement.experiment.conditions
            experiment = replace(
                test,
                name=f"{name} {test.name}" if test.name in clashes else test.name,
                conditions={SPECIMEN: float(number), **conditions},
            )
            measurements.append(replace(measurement, experiment=experiment))
    common = {
        name: value
        for name, value in campaigns[0].conditions.items()
        if all(m.experiment.conditions.get(name) == value for m in measurements)
    }
    title = " · ".join(dict.fromkeys(campaign.title for campaign in campaigns))
    title = title if len(title) <= LONGEST_TITLE else f"{len(campaigns)} campaigns, {campaigns[0].title}"
    attributes = {SPECIMENS: "\n".join(names)}
    return Campaign(title[:LONGEST_TITLE], sources.pop(), common, tuple(measurements), attributes, units)


def specimen_name(campaign: Campaign, number: float) -> str:
    """Name of a specimen by its number."""
    names = str(campaign.attributes.get(SPECIMENS, "")).splitlines()
    k = int(number) - 1
    return names[k] if 0 <= k < len(names) and number == int(number) else f"{number:g}"


def varying_conditions(campaign: Campaign, names: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The values of conditions over the tests, in order.

    Raises
    ------
    InputError
        With every one that a test does not state, or that is the same in all.
    """
    issues, found = [], {}
    for name in names:
        lacking = [m.name for m in campaign.measurements if name not in m.experiment.conditions]
        values = sorted({m.experiment.conditions[name] for m in campaign.measurements if m.name not in lacking})
        if lacking:
            known = sorted({one for m in campaign.measurements for one in m.experiment.conditions})
            message = f"test '{lacking[0]}' does not state it" + (f", nor {len(lacking) - 1} more" * (len(lacking) > 1))
            issues.append(Issue(f"--over {name}", message, f"The tests state {', '.join(known) or 'no condition'}"))
        elif len(values) < 2:
            issues.append(Issue(f"--over {name}", f"is {values[0]:g} in all tests", "Name a condition that varies"))
        found[name] = tuple(values)
    raise_errors(issues)
    if repeated(names):
        raise InputError.of("--over", f"names {repeated(names)[0]} twice", "Name it once")
    return found
