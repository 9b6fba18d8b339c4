"""The command import, in a module of its own because its help reads the registry of formats."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from mofit.cli.app import DONE, Force, Json, print_json
from mofit.cli.campaign import report_campaign
from mofit.data.importers.registry import import_formats
from mofit.errors import InputError
from mofit.runtime.output_file import output_file

_FORMATS = "; ".join(f"{known.name} ({', '.join(known.endings)})" for known in import_formats())


def import_(
    *sources: Annotated[
        Path, Parameter(help=f"Files, or folders in which the map's files are looked up. Formats: {_FORMATS}.")
    ],
    map: Path | None = None,
    guess: bool = False,
    out: Path | None = None,
    force: Force = False,
    as_json: Json = False,
) -> int:
    """Import measured files into a campaign, as a map file describes them, or propose the map.

    Parameters
    ----------
    map
        Map file (TOML): which column is which channel, in which unit. --guess proposes one.
    guess
        Propose a map from names, units and shapes of the columns, to be read and corrected; nothing is imported.
    out
        Campaign file to write. By default the map's name with .nc. With --guess: map file to write, and beside it a
        picture of what was understood, .png; by default the map goes to standard output.
    """
    from mofit.cli.output import progress_bar
    from mofit.data import campaign_warnings, import_files, write_campaign
    from mofit.data.campaign_file import is_campaign_file

    if guess == (map is not None):
        hint = "Give --map MAP.toml to import, or --guess for a proposed map"
        raise InputError.of("import", "needs either --map or --guess", hint)
    if map is None:
        return _report_map(sources, out, force, as_json)
    name = Path(map.with_suffix(".nc").name) if out is None else out
    with output_file(name, force=force, inputs=(*sources, map), recognised=is_campaign_file) as target:
        campaign = import_files(sources, map)
        write_campaign(campaign, target)
    with progress_bar() as progress:
        warnings = campaign_warnings(campaign, progress)
    return report_campaign("import", campaign, target, as_json, warnings)


def _report_map(sources: tuple[Path, ...], target: Path | None, force: bool, as_json: bool) -> int:
    from mofit.data import propose_map
    from mofit.workflows.proposed_map import write_map

    picture = None
    if target is None:
        text = propose_map(sources)
    else:
        picture = write_map(sources, target, force)
        text = target.read_text(encoding="utf-8")
    if as_json:
        files = {"file": str(target) if target else None, "picture": str(picture) if picture else None}
        print_json({"schema": "mofit.map/1", "map": text, **files})
    elif target is None:
        print(text, end="")
    else:
        seen = f" and look at {picture}" if picture else ""
        print(f"{target}: check it{seen}, then mofit import … --map {target}")
    return DONE
