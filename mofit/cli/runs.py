"""Commands on finished runs: report, uncertainty, export."""

from __future__ import annotations

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
    to: Literal["toml", "csv", "casadi", "c"],
    mode: str = "m1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Export a run for other programs: parameters with uncertainty, or the identified model as a function.

    Example: mofit export runs/my-campaign-maxwell_tyre --to c --out tyre.c

    Parameters
    ----------
    to
        toml, csv: parameters of all modes with standard deviation, quantiles, unit and classification. casadi: a file
        for CasADi's Function.load. c: C source.
    mode
        Posterior mode whose MAP estimate goes into the function (casadi, c).
    model
        The run's model, if it is your own: path/to/file.py:Name.
    effect
        Effects of the run, all in their order, if one is your own; repeatable.
    out
        File to write. By default the model's name with the ending of the format.
    """
    from mofit.results import open_result
    from mofit.results.export import c_source, identified_function, model_of_run, parameters_csv, parameters_toml
    from mofit.runtime.files import atomic_path
    from mofit.runtime.output_file import output_file

    tree = open_result(run)
    file = Path(f"{tree.attrs['model']}.{to}".replace("+", "_")) if out is None else out
    with output_file(file) as target, atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            text = (parameters_toml if to == "toml" else parameters_csv)(tree)
            temporary.write_text(text, encoding="utf-8")
        else:
            chosen = model_of_run(tree, model, effect)
            function = identified_function(tree, chosen, mode)
            if to == "casadi":
                function.save(str(temporary))
            else:
                keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
                origin = {"mode": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
                temporary.write_text(c_source(function, chosen, origin), encoding="utf-8")
    if as_json:
        print_json({"file": str(target), "to": to, "mode": mode if to in ("casadi", "c") else None})
    else:
        print(target)
    return DONE
