"""Commands on campaigns: check, simulate, import."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mofit.cli.app import DONE, UNUSABLE, Json, app, new_file, print_json
from mofit.errors import InputError


@app.command
def check(file: Path, /, *, as_json: Json = False) -> int:
    """Read a campaign and say all that is wrong or odd with it.

    Example: mofit check my_campaign.nc

    Parameters
    ----------
    file
        Campaign file (netCDF, mofit.campaign/1).
    """
    from dataclasses import asdict

    from mofit.check import check_campaign

    faults = check_campaign(file)
    if as_json:
        print_json({"faults": [asdict(fault) for fault in faults]})
    else:
        for fault in faults:
            print(f"{fault.severity}: {fault}")
        print(f"{file}: {len(faults)} finding(s)" if faults else f"{file}: nothing wrong found")
    return UNUSABLE if any(fault.severity == "error" for fault in faults) else DONE


@app.command
def simulate(plan: Path, /, *, out: Path | None = None, as_json: Json = False) -> int:
    """A virtual test rig: make a campaign from a model, effects and noise.

    Example: mofit simulate data/plans/table5.toml --out table5.nc

    Parameters
    ----------
    plan
        Plan file (TOML).
    out
        Campaign file to write; by default the plan's name with .nc.
    """
    from mofit.campaign_file import write_campaign
    from mofit.simulate import simulate as run

    target = new_file(out or Path(plan.with_suffix(".nc").name))
    campaign = run(plan)
    write_campaign(campaign, target)
    return _report_campaign(campaign, target, as_json)


@app.command(name="import")
def import_(
    *sources: Path,
    map: Path | None = None,
    guess: bool = False,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Turn measured files (CSV and other text, MAT, MDF, TYDEX) into a campaign, as a map file says.

    Example: mofit import measured/*.csv --map my_rig.toml --out campaign.nc

    Parameters
    ----------
    sources
        Files or folders in which the map's files are looked for.
    map
        Map file (TOML): which column is which channel, in which unit; see docs/campaigns.md.
    guess
        Propose a map from the names and units of the columns, and import nothing.
    out
        Campaign file to write, by default the map's name with .nc; with --guess the map file to write, by default
        standard output.
    """
    from mofit.readers import guess_map, import_files

    if guess == (map is not None):
        cure = "Give --map MAP.toml to import, or --guess to have a map proposed"
        raise InputError.of("import", "needs either --map or --guess", cure)
    if map is None:
        target = new_file(out) if out else None
        return _report_map(guess_map(sources), target, as_json)
    from mofit.campaign_file import write_campaign

    target = new_file(out or Path(map.with_suffix(".nc").name))
    campaign = import_files(sources, map)
    write_campaign(campaign, target)
    return _report_campaign(campaign, target, as_json)


def _report_map(text: str, target: Path | None, as_json: bool) -> int:
    if target:
        target.write_text(text, encoding="utf-8")
    if as_json:
        print_json({"map": text, "file": str(target) if target else None})
    else:
        print(f"{target}: check it, then mofit import … --map {target}" if target else text, end="\n" if target else "")
    return DONE


def _report_campaign(campaign: Any, target: Path, as_json: bool) -> int:
    from mofit.campaign import overview

    rows = [overview(measurement) for measurement in campaign.measurements]
    if as_json:
        print_json({"file": str(target), "source": campaign.source, "tests": rows})
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
    return DONE
