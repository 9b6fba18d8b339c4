"""The command that writes what a run found, or a test of a campaign, for other programs."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from mofit.cli.app import DONE, Json, app, print_json


@app.command
def export(
    run: Annotated[Path, Parameter(help="Folder of a finished run; for tydex a campaign file.")],
    /,
    *,
    to: Literal["toml", "csv", "casadi", "c", "fmu", "relaxation", "bode", "tir", "tydex"],
    mode: str = "m1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    fmi: Literal["3", "2"] | None = None,
    test: str | None = None,
    template: Path | None = None,
    load: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Export a run for other programs: parameters, the identified model, an FMU, or what is wanted of a tyre.

    Example: mofit export runs/my-campaign-maxwell_tyre --to fmu --out tyre.fmu

    Parameters
    ----------
    to
        toml, csv: parameters of all modes with standard deviation, quantiles, unit and verdict. casadi: a file
        for CasADi's Function.load. c: C source. fmu: a Functional Mock-up Unit for co-simulation, with its sources, and
        with a binary where a C compiler is found. relaxation: relaxation lengths of a tyre as CSV, or as a page with
        Bode plots where --out ends in .html. bode: its frequency response as CSV, or as a picture (.svg, .png). tir: a
        property file with the Magic Formula coefficients that the run supports. tydex: a test of a campaign file,
        which is named in place of the run.
    mode
        Posterior mode: its MAP estimate goes into the function (casadi, c), its posterior mean into the FMU.
    model
        The run's model, if it is your own: path/to/file.py:Name.
    effect
        Effects of the run, all in their order, if one is your own; repeatable.
    fmi
        Version of FMI, 3.0 by default (fmu).
    test
        fmu: test whose conditions and values per test the FMU starts with; by default the conditions common to all
        tests, and the mean of the values. tydex: test to write.
    template
        Property file of Magic Formula 5.2 or 6.1 whose other entries stay as they are (tir).
    load
        Vertical force of the tests, where the model does not read it: "3600 N" (tir).
    out
        File to write. By default the model's name with the ending of the format.
    """
    from mofit.workflows.export import export as exported

    made = exported(
        run, to, mode=mode, model=model, effects=effect, fmi=fmi, test=test, template=template, load=load, out=out
    )
    if as_json:
        of_mode = mode if to in ("casadi", "c", "fmu") else None
        print_json({"schema": "mofit.export/1", "file": str(made.file), "to": to, "mode": of_mode, **made.said})
    else:
        print(made.file)
    if made.said.get("note"):
        print(f"mofit: {made.said['note']}", file=sys.stderr)
    return DONE
