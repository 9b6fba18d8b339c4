"""Commands on finished runs: report, uncertainty, export."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

from mofit.cli.app import DONE, NOT_CONVERGED, NOT_IDENTIFIABLE, FinishedRun, Json, app, print_json


@app.command
def report(run: FinishedRun, /, *, as_json: Json = False) -> int:
    """Rebuild the HTML report of a run.

    Example: mofit report runs/my-campaign-maxwell_tyre
    """
    from mofit.report import build_report

    page = build_report(run)
    if as_json:
        print_json({"report": str(page)})
    else:
        print(page)
    return DONE


@app.command
def uncertainty(run: FinishedRun, /, *, parameter: tuple[str, ...] = (), as_json: Json = False) -> int:
    """Build the uncertainty page of a run: intervals, correlations, predictive bands, homogeneity of the tests.

    Example: mofit uncertainty runs/my-campaign-maxwell_tyre --parameter d_M

    Parameters
    ----------
    parameter
        Exit code 4 if the data do not identify this parameter; repeatable.
    """
    from mofit.report import build_uncertainty
    from mofit.report.uncertainty.table import uncertainty_summary
    from mofit.results import open_result

    tree = open_result(run)
    table = uncertainty_summary(tree, parameter)
    page = build_uncertainty(run, tree)
    if as_json:
        print_json({"uncertainty": str(page), **table})
    else:
        print(page)
    if not table["converged"]:
        return NOT_CONVERGED
    return NOT_IDENTIFIABLE if table["not_identifiable"] else DONE


@app.command
def export(
    run: FinishedRun,
    /,
    *,
    to: Literal["toml", "csv", "casadi", "c", "fmu"],
    mode: str = "m1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    fmi: Literal["3", "2"] | None = None,
    test: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Export a run for other programs: parameters with uncertainty, the identified model as a function, or an FMU.

    Example: mofit export runs/my-campaign-maxwell_tyre --to fmu --out tyre.fmu

    Parameters
    ----------
    to
        toml, csv: parameters of all modes with standard deviation, quantiles, unit and classification. casadi: a file
        for CasADi's Function.load. c: C source. fmu: a Functional Mock-up Unit for co-simulation, with its sources, and
        with a binary where a C compiler is found.
    mode
        Posterior mode: its MAP estimate goes into the function (casadi, c), its posterior mean into the FMU.
    model
        The run's model, if it is your own: path/to/file.py:Name.
    effect
        Effects of the run, all in their order, if one is your own; repeatable.
    fmi
        Version of FMI, 3.0 by default (fmu).
    test
        Test whose conditions and values per test the FMU starts with; by default those common to all, and the mean.
    out
        File to write. By default the model's name with the ending of the format.
    """
    from mofit.workflows.export import export as exported

    made = exported(run, to, mode=mode, model=model, effects=effect, fmi=fmi, test=test, out=out)
    said = {"fmi": made.fmi, "platform": made.platform, "note": made.note or None} if to == "fmu" else {}
    target = made.file
    if as_json:
        print_json({"file": str(target), "to": to, "mode": None if to in ("toml", "csv") else mode, **said})
    else:
        print(target)
    if said.get("note"):
        print(f"mofit: {said['note']}", file=sys.stderr)
    return DONE
