"""Commands on finished runs: report, uncertainty, export."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from mofit.cli.app import DONE, NOT_CONVERGED, NOT_IDENTIFIABLE, FinishedRun, Json, app, print_json

if TYPE_CHECKING:
    from xarray import DataTree


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
    from mofit.errors import Issue, raise_errors
    from mofit.results import open_result
    from mofit.results.export import require_equations
    from mofit.runtime.files import atomic_path
    from mofit.runtime.output_file import output_file

    given = {"--fmi": fmi, "--test": test}
    raise_errors(
        Issue(f"{option} {value}", f"is for an FMU, not for {to}", "Add --to fmu, or leave it out")
        for option, value in given.items()
        if value is not None and to != "fmu"
    )
    tree = open_result(run)
    if to not in ("toml", "csv"):
        require_equations(tree)
    file = Path(re.sub("[^0-9A-Za-z_.-]", "_", f"{tree.attrs['model']}.{to}")) if out is None else out
    said: dict[str, str | None] = {}
    with output_file(file) as target, atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            _export_parameters(tree, temporary, to)
        elif to == "fmu":
            said = _export_fmu(tree, temporary, fmi or "3", mode, model, effect, test)
        else:
            _export_function(tree, temporary, to, mode, model, effect)
    if as_json:
        print_json({"file": str(target), "to": to, "mode": None if to in ("toml", "csv") else mode, **said})
    else:
        print(target)
    if said.get("note"):
        print(f"mofit: {said['note']}", file=sys.stderr)
    return DONE


def _export_parameters(tree: DataTree, file: Path, to: str) -> None:
    from mofit.results.export import parameters_csv, parameters_toml

    text = (parameters_toml if to == "toml" else parameters_csv)(tree)
    file.write_text(text, encoding="utf-8")


def _export_function(
    tree: DataTree, file: Path, to: str, mode: str, model: str | None, effects: tuple[str, ...]
) -> None:
    from mofit.results.export import c_source, identified_function, model_of_run

    chosen = model_of_run(tree, model, effects)
    function = identified_function(tree, chosen, mode)
    if to == "casadi":
        function.save(str(file))
        return
    keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
    origin = {"mode": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
    file.write_text(c_source(function, chosen, origin), encoding="utf-8")


def _export_fmu(
    tree: DataTree,
    file: Path,
    fmi: Literal["3", "2"],
    mode: str,
    model: str | None,
    effects: tuple[str, ...],
    test: str | None,
) -> dict[str, str | None]:
    """What is to be said of it."""
    from mofit.results.export import model_of_run
    from mofit.results.fmu.archive import write_fmu

    built = write_fmu(tree, model_of_run(tree, model, effects), file, fmi=fmi, mode=mode, test=test)
    return {"fmi": fmi, "platform": built.platform, "note": built.note or None}
