"""The page of the study of records: a summary, a section per case, and the other programs."""

from __future__ import annotations

from typing import Any

from records_cases.case import Case
from report_page import table

Rows = list[tuple[Case, dict[str, Any]]]


def summary_table(rows: Rows) -> list[str]:
    """One line per case."""
    head = ("case", "fit", "NRMSD %", "prediction", "NRMSD %", "in the 90 % band, %", "seconds", "converged", "wanted")
    cells = []
    for case, row in rows:
        unit = case.unit[0]
        predicted = next(iter(row["predictions"].values()), None)
        about = ("", "", "") if predicted is None else (
            f"{predicted['rms']:.3g} {unit}", f"{predicted['nrmsd']:.2f}", f"{predicted['covered']:.0f}"
        )  # fmt: skip
        cells.append([
            case.title, f"{row['fit']['rms']:.3g} {unit}", f"{row['fit']['nrmsd']:.2f}", *about,
            f"{row['cpu']:.1f}", yes(row["converged"]), case.wanted,
        ])  # fmt: skip
    return table(head, cells)


def section(case: Case, row: dict[str, Any]) -> list[str]:
    """Model, parameters, errors and what mofit says of one case."""
    best, unit = row["modes"][0], case.unit[0]
    cells = [
        [name, entry["unit"], *(_number(entry[key]) for key in ("value", "mean", "sd")), entry["verdict"]]
        for name, entry in best["parameters"].items()
    ]
    seconds = row["seconds"]
    shares = {key: 100 * seconds[key] / seconds["total"] for key in ("search", "refine", "sample") if key in seconds}
    parts = ", ".join(f"{key} {share:.0f} %" for key, share in shares.items())
    doc = " ".join((case.model.__doc__ or "").split("\n\n")[0].split())
    lines = [f"## {case.title}", "", doc, "", f"`python scripts/studies/records.py --only {case.name}`", ""]
    lines += table(("parameter", "unit", "best", "mean", "sd", "verdict"), cells)
    lines += [
        f"- Wanted: {case.wanted}.",
        *([f"- {case.remark}"] if case.remark else []),
        f"- Fit: {row['fit']['rms']:.4g} {unit}, NRMSD {row['fit']['nrmsd']:.2f} %.",
    ]
    for test, found in row["predictions"].items():
        lines.append(
            f"- Prediction of `{test}`: {found['rms']:.4g} {unit} (NRMSD {found['nrmsd']:.2f} %) at the best point, "
            f"{found['rms_of_mean']:.4g} {unit} (NRMSD {found['nrmsd_of_mean']:.2f} %) by the mean of the draws; "
            f"{found['covered']:.0f} % of the samples in the 90 % band."
        )
    lines.append(f"- {row['cpu']:.1f} s ({parts}); converged: {yes(row['converged'])}; modes: {len(row['modes'])}.")
    if len(row["modes"]) > 1:
        fits = (
            f"{mode['id']} {', '.join(f'{100 * share:.2f} %' for share in mode['nrmsd'].values())}, "
            f"probability {mode['probability']:.2f}"
            for mode in row["modes"]
        )
        lines.append(f"- NRMSD of the modes: {'; '.join(fits)}.")
    lines += [f"- Said: {text}" for text in dict.fromkeys(row["warnings"])]
    return [*lines, ""]


def peer_table(found: list[dict[str, Any]], rows: dict[str, dict[str, Any]]) -> list[str]:
    """Other programs beside mofit."""
    cells = []
    for peer in found:
        ours = rows.get(peer["case"])
        if ours and (not cells or peer["title"] not in [cell[0] for cell in cells]):
            predicted = next(iter(ours["predictions"].values()), {}).get("rms")
            fit = ours["fit"]["rms"]
            cells.append([peer["title"], "mofit", f"{fit:.4g}", _number(predicted), f"{ours['cpu']:.1f}", "posterior"])
        cells.append([
            peer["title"], peer["peer"], _number(peer.get("fit")), _number(peer.get("predicted")),
            "" if "seconds" not in peer else f"{peer['seconds']:.1f}", peer["note"],
        ])  # fmt: skip
    head = ("case", "program", "rms of the fit", "rms of the prediction", "seconds", "note")
    text = "Root mean squares in V (tanks) and mV (battery); the others start at the nominal values of the model."
    return ["## Other programs", "", text, "", *table(head, cells)]


def yes(value: bool) -> str:
    """In words."""
    return "yes" if value else "no"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
