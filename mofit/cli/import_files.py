"""The command import, in a module of its own because its help reads the registry of formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from mofit.cli.app import DONE, Json, new_file, print_json
from mofit.cli.campaign import report_campaign
from mofit.data.importers.registry import import_formats
from mofit.errors import InputError

_FORMATS = "; ".join(f"{known.name} ({', '.join(known.endings)})" for known in import_formats())


def import_(
    *sources: Annotated[
        Path, Parameter(help=f"Files, or folders in which the map's files are looked up. Formats: {_FORMATS}.")
    ],
    map: Path | None = None,
    guess: bool = False,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Import measured files into a campaign, as a map file describes them.

    Parameters
    ----------
    map
        Map file (TOML): which column is which channel, in which unit; see docs/campaigns.md.
    guess
        Propose a map from the names and units of the columns, and import nothing.
    out
        Campaign file to write. By default the map's name with .nc. With --guess: map file to write, by default
        standard output.
    """
    from mofit.cli.output import progress_bar
    from mofit.data import campaign_warnings, import_files, propose_map, write_campaign

    if guess == (map is not None):
        hint = "Give --map MAP.toml to import, or --guess for a proposed map"
        raise InputError.of("import", "needs either --map or --guess", hint)
    if map is None:
        return _report_map(propose_map(sources), new_file(out) if out else None, as_json)
    target = new_file(out or Path(map.with_suffix(".nc").name))
    campaign = import_files(sources, map)
    write_campaign(campaign, target)
    with progress_bar() as progress:
        warnings = campaign_warnings(campaign, progress)
    return report_campaign(campaign, target, as_json, warnings)


def _report_map(text: str, target: Path | None, as_json: bool) -> int:
    if target:
        target.write_text(text, encoding="utf-8")
    if as_json:
        print_json({"map": text, "file": str(target) if target else None})
    else:
        print(f"{target}: check it, then mofit import … --map {target}" if target else text, end="\n" if target else "")
    return DONE
