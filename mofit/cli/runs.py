"""Commands on finished runs: report, uncertainty."""

from __future__ import annotations

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
