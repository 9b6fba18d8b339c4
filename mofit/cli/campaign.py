"""Commands on campaigns: check, simulate; import is in a module of its own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mofit.cli.app import DONE, UNUSABLE, Json, app, print_json, say

if TYPE_CHECKING:
    from mofit.data import Campaign
    from mofit.errors import Issue


@app.command
def check(file: Path, /, *, as_json: Json = False) -> int:
    """Check a campaign file: list every error and every data-quality warning.

    Example: mofit check my_campaign.nc

    Parameters
    ----------
    file
        Campaign file (netCDF, mofit.campaign/1).
    """
    from dataclasses import asdict

    from mofit.cli.output import progress_bar
    from mofit.data import check_campaign

    with progress_bar() as progress:
        issues = check_campaign(file, progress)
    if as_json:
        print_json({"schema": "mofit.check/1", "issues": [asdict(issue) for issue in issues]})
    else:
        for issue in issues:
            print(f"{issue.severity}: {issue}")
        print(f"{file}: {len(issues)} issue(s)" if issues else f"{file}: no issues")
    return UNUSABLE if any(issue.severity == "error" for issue in issues) else DONE


@app.command
def simulate(plan: Path, /, *, out: Path | None = None, as_json: Json = False) -> int:
    """Simulate a campaign on a virtual test rig: a model, effects and noise.

    Example: mofit simulate data/plans/table5.toml --out table5.nc

    Parameters
    ----------
    plan
        Plan file (TOML): model, true parameters, tests and noise; see docs/models.md.
    out
        Campaign file to write. By default the plan's name with .nc.
    """
    from mofit.data import write_campaign
    from mofit.runtime.output_file import output_file
    from mofit.simulation.virtual_rig.rig import simulate as run

    with output_file(Path(plan.with_suffix(".nc").name) if out is None else out) as target:
        campaign = run(plan)
        write_campaign(campaign, target)
    return report_campaign("simulate", campaign, target, as_json)


# loaded on demand, because its help lists the formats
app.command(
    "mofit.cli.import_files:import_",
    name="import",
    help="""Import measured files into a campaign, as a map file describes them, or propose the map.

    Example: mofit import measured/*.csv --map my_rig.toml --out campaign.nc
    """,
)


def report_campaign(
    command: str, campaign: Campaign, target: Path, as_json: bool, warnings: Sequence[Issue] = ()
) -> int:
    """Print what a new campaign file holds, and what is wrong with its data."""
    from dataclasses import asdict

    from mofit.data import overview

    rows = [overview(measurement) for measurement in campaign.measurements]
    if as_json:
        issues = [asdict(issue) for issue in warnings]
        found = {"schema": f"mofit.{command}/1", "file": str(target), "source": campaign.source}
        print_json({**found, "tests": rows, "issues": issues})
        return DONE
    print(f"{target}: {campaign.title} ({campaign.source}), {len(rows)} tests")
    for row in rows:
        print(
            f"  {row['test']}: {row['procedure']}, {row['samples']} samples, {row['rate']:.4g} Hz,"
            f" {row['seconds']:.3g} s" + (f", cut from a record with {row['gaps']} gap(s)" if row["gaps"] else "")
        )
        for name, channel in row["channels"].items():
            low, high = channel["range"]
            print(f"    {channel['role']} {name}: {low:.4g} to {high:.4g} {channel['unit']}")
        if row["conditions"]:
            print("    " + ", ".join(f"{name} {value:.5g}" for name, value in row["conditions"].items()) + " (SI)")
        if row["history"]:
            print(f"    {row['history']}")
    for issue in warnings:
        say(f"{issue.severity}: {issue}")
    return DONE
