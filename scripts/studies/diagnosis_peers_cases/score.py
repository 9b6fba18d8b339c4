"""A peer's answer beside the label, in the terms of `other_rigs_cases.score`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from other_rigs_cases.score import KINDS, measured_shares

#: verdicts of mofit that propose no model
SILENT = ("none", "unknown", "no result")
#: how far below what was told a measured share still holds it
MARGIN = 0.1


def peer_row(work: Path, name: str, peer: str, said: Mapping[str, Any]) -> dict[str, Any]:
    """The row of a peer: verdict ``gap``, ``none`` or ``no result``, and what was measured."""
    with np.load(work / "labels" / f"{name}.npz") as stored:
        label = json.loads(str(stored["label"]))
        truth = {key: stored[key] for key in stored.files if key != "label"}
    answer = said["answer"] or {"gap": False, "terms": [], "families": [], "where": "", "told": None, "corrects": False}
    verdict = "no result" if said["answer"] is None else "gap" if answer["gap"] else "none"
    row = {**label, "name": name, "code": said["code"], "seconds": round(said["seconds"], 1), "verdict": verdict}
    row |= {"families": answer["families"], "terms": answer["terms"], "where": answer["where"], "share": answer["told"]}
    row["measured"] = dict.fromkeys(KINDS, 0.0)
    if answer["corrects"]:
        folder = work / "peers" / name
        correction = np.load(folder / f"{peer}.npy")
        with np.load(folder / "simulated.npz") as stored:
            tests, scale = [key for key in stored.files if key != "scale"], float(stored["scale"])
            without = {f"without:{test}": stored[test] for test in tests}
        pairs = zip(tests, correction, strict=True)
        with_ = {f"with:{test}": without[f"without:{test}"] + scale * one for test, one in pairs}
        row["measured"] = measured_shares({**without, **with_}, truth)
    return row


def proposed(row: Mapping[str, Any]) -> dict[str, float]:
    """Shares that what is handed to the user removes: none of mofit where it proposes no model."""
    return dict.fromkeys(KINDS, 0.0) if row["verdict"] in SILENT else dict(row["measured"])


def right(row: Mapping[str, Any]) -> dict[str, bool]:
    """Whether a gap is seen, the family named first or at all, and no cause named.

    A verdict ``group`` or ``several`` of mofit names its families alike; other terms and families have an order.
    """
    naming = row["verdict"] not in SILENT
    alike = row["verdict"] in ("group", "several")
    return {
        "gap": row["verdict"] not in ("none", "no result"),
        "first": naming and row["family"] in (row["families"] if alike else row["families"][:1]),
        "named": naming and row["family"] in row["families"],
        "nameless": row["verdict"] == "unknown" or (row["verdict"] in ("gap", "none") and not row["families"]),
        # a part of the gap explained, with the rest told, is no wrong name: as in the study of other rigs
        "refused": row["verdict"] in ("unknown", "partly")
        or (row["verdict"] in ("gap", "none") and not row["families"]),
    }


def holds(row: Mapping[str, Any]) -> list[bool]:
    """Whether what was told of the shrinkage was measured, less a margin, by kind of records held out."""
    if row["share"] is None or row["verdict"] in SILENT:
        return []
    return [share >= row["share"] - MARGIN for share in row["measured"].values()]
