"""What a diagnosis said of a campaign beside its label: the only place that opens labels and reads the JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from other_rigs_cases.excitation import COUNT, PERIODS

#: verdicts that name a cause
NAMING = ("effect", "group", "several", "partly")
#: verdicts that may name more than one, as what the data cannot distinguish
SEVERAL = ("group", "several", "partly")
#: kinds of records held out, by the beginning of their names
KINDS = ("same", "group", "other")
#: kind of records by the kind of hold-out that a diagnosis tells
TOLD = {"test": "same", "group": "group", "records": "other"}


def row_of(folder: Path, name: str, code: int | None, cpu: float) -> dict[str, Any]:
    """The row of a campaign.

    Parameters
    ----------
    folder
        Work folder with ``labels`` and ``answers``.
    name
        Name of the campaign.
    code
        Exit code of the diagnosis; None where its time was up.
    cpu
        Seconds of processor time that it took.
    """
    with np.load(folder / "labels" / f"{name}.npz") as stored:
        label = json.loads(str(stored["label"]))
        truth = {key: stored[key] for key in stored.files if key != "label"}
    answer = _answer(folder / "answers" / name / "answer.json") if code == 0 else None
    row = {**label, "name": name, "code": code, "seconds": round(cpu, 1), **said(answer)}
    row["right"] = right(label, row)
    row["measured"] = _measured(folder / "answers" / name / "predictions.npz", truth) if answer else {}
    if code != 0:
        row["message"] = _last_line(folder / "answers" / name / "errors.txt", code)
    return row


def said(answer: Mapping[str, Any] | None) -> dict[str, Any]:
    """Verdict, what is named, how probable, and how far the gap shrinks."""
    if answer is None:
        return {
            "verdict": "no result",
            "effects": [],
            "families": [],
            "sentence": "",
            "intervals": {},
            "proposed": None,
        }
    shrinkage, proposed = answer.get("shrinkage") or {}, answer.get("proposed")
    return {
        "verdict": answer["verdict"],
        "sentence": answer["sentence"],
        "effects": [one["name"] for one in answer["effects"]],
        "families": [one["name"] for one in answer["families"]],
        "probability": max((one["probability"] for one in answer["families"]), default=None),
        "share": shrinkage.get("share", shrinkage.get("refitted")),
        "intervals": intervals(shrinkage),
        "proposed": dict(_flat(proposed)) if proposed else None,
    }


def intervals(shrinkage: Mapping[str, Any]) -> dict[str, list[float]]:
    """The intervals that are told: ``headline``, and those of every kind of hold-out where there are kinds."""
    told = {"headline": shrinkage, **{TOLD[one["kind"]]: one for one in shrinkage.get("kinds", [])}}
    return {kind: [one["low"], one["high"]] for kind, one in told.items() if one.get("low") is not None}


def right(label: Mapping[str, Any], row: Mapping[str, Any]) -> dict[str, bool]:
    """What is right: that there is no gap, the cause as the first, its family, or that nothing is named."""
    naming, effects, families = row["verdict"] in NAMING, row["effects"], row["families"]
    listed = families if row["verdict"] in SEVERAL else families[:1]
    return {
        "quiet": row["verdict"] == "none",
        "first": naming and bool(effects) and effects[0] == label["effect"],
        "named": naming and label["effect"] in effects,
        "family": naming and label["family"] in listed,
        "refused": row["verdict"] in ("unknown", "partly"),
        "unknown": row["verdict"] == "unknown",
        "akin": row["verdict"] == "unknown" or (naming and label["akin"] in listed),
    }


def _measured(path: Path, truth: Mapping[str, FloatArray]) -> dict[str, float]:
    if not path.exists():
        return {}
    with np.load(path) as stored:
        return measured_shares({key: stored[key] for key in stored.files}, truth)


def measured_shares(predicted: Mapping[str, FloatArray], truth: Mapping[str, FloatArray]) -> dict[str, float]:
    """Share of the squared gap that a model removes, by kind of records held out.

    Parameters
    ----------
    predicted
        Outputs ``with:TEST`` of that model and ``without:TEST`` of the model without it.
    truth
        Outputs per test without noise.
    """
    found = {}
    for kind in KINDS:
        squares = {"with": 0.0, "without": 0.0}
        for test in (test for test in truth if test.startswith(kind)):
            clean = truth[test][COUNT // PERIODS :]
            if np.ptp(clean) == 0:  # a dead band that this record does not leave
                continue
            for which in squares:
                error = predicted[f"{which}:{test}"][COUNT // PERIODS :] - clean
                squares[which] += float(np.mean(error**2) / np.ptp(clean) ** 2)
        if squares["without"] > 0 and np.isfinite(squares["with"]):
            found[kind] = 1 - squares["with"] / squares["without"]
    return found


def _flat(value: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Numbers and words of a proposed term, without its curves."""
    for key, one in value.items():
        if isinstance(one, Mapping):
            yield from ((f"{key}.{inner}", each) for inner, each in _flat(one))
        elif not isinstance(one, list):
            yield key, one


def _answer(path: Path) -> dict[str, Any] | None:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except ValueError:
        return None


def _last_line(path: Path, code: int | None) -> str:
    if code is None:
        return "time is up"
    lines = [line.strip() for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""
