"""A design as plain data: what ``--json`` prints, and what the table and the page are made from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit.identifiability.design import Design
from mofit.identifiability.design_files import DesignJob, Proposal
from mofit.identifiability.separate import ENOUGH, Rivalry
from mofit.identifiability.verdicts import IDENTIFIABLE, VERDICTS, Spread

#: Single candidates that are listed.
BEST = 12


def summary(proposal: Proposal, job: DesignJob) -> dict[str, Any]:
    """Everything of a design in SI units; standard deviations are medians over the parameter points."""
    found = proposal.design
    name = "T" if isinstance(found.goal, Rivalry) else found.goal.criterion
    refused = Counter(candidate.refused.partition(":")[0] for candidate in found.candidates if candidate.refused)
    parameters = {name: _parameter(found, name) for name in found.names}
    told: dict[str, Any] = {
        "programme": [
            {
                "name": candidate.name,
                **candidate.plan.model_dump(exclude_none=True, exclude={"name"}),
                "times": times,
                "seconds": times * candidate.seconds,
                "without": dict(zip(found.names, map(float, own), strict=True)),
            }
            for (candidate, times), own in zip(found.programme, found.without, strict=True)
        ],
        "seconds": found.seconds,
        "expected": {name: entry["sd"] for name, entry in parameters.items()},
        "parameters": parameters,
        "criterion": {
            "name": name,
            "of": [effect.name for effect in job.rivals] if job.rivals else list(job.combination or found.names),
            "combination": dict(job.combination),
            "robust": job.robust,
            "before": found.value_before,
            "after": found.value_after,
        },
        "exhaustive": found.exhaustive,
        "points": len(found.told.values),
        "values": dict(zip(found.told.source.space.names, map(float, found.told.values[0]), strict=True)),
        "pareto": [{"seconds": p.seconds, "value": p.value, "tests": dict(p.tests)} for p in found.pareto],
        "singles": [
            {
                "name": found.candidates[i].name,
                "seconds": found.candidates[i].seconds,
                "value": float(found.singles[i]),
                "relative_sd": dict(zip(found.names, map(float, found.single_sd[i]), strict=True)),
            }
            for i in _ranked(found)[:BEST]
        ],
        "candidates": len(found.candidates),
        "refused": dict(refused),
        "space": proposal.space.model_dump(exclude_none=True),
        "notes": list(proposal.notes),
    }
    told["lost"] = lost(told, job)
    return told


def lost(told: Mapping[str, Any], job: DesignJob) -> list[str]:
    """What was asked for and stays out of reach even with the programme, in sentences."""
    if job.rivals:
        value = told["criterion"]["after"]
        if value >= ENOUGH:
            return []
        what = " and ".join(effect.name for effect in job.rivals)
        return [
            f"{what} cannot be told {'apart' if len(job.rivals) > 1 else 'from nothing'}: noncentrality {value:.3g}, "
            f"about {ENOUGH:g} is needed. More time, a wider space or calibration of the other parameters may do."
        ]
    found = []
    for name in job.parameters:
        entry = told["parameters"][name]
        if entry["verdict"] != IDENTIFIABLE:
            found.append(
                f"{name} stays {entry['verdict']} even with the programme: expected standard deviation "
                f"{entry['sd']:.3g} {entry['unit']} ({100 * entry['relative_sd']:.3g} % of its value); with all other "
                f"parameters known it would be {entry['conditional_sd']:.3g} {entry['unit']}. "
                "More time or a wider space may do."
            )
    return found


def _ranked(found: Design) -> list[int]:
    """Candidates that are not refused, the best alone first."""
    values = -found.singles if isinstance(found.goal, Rivalry) else found.singles
    return [int(i) for i in np.argsort(values) if np.isfinite(values[i])]


def _parameter(found: Design, name: str) -> dict[str, Any]:
    source = found.told.source
    place = source.space.index(name)

    def median(spread: Spread) -> float:
        return float(np.median((spread.sd * found.told.stretch)[:, place]))

    def verdict(spread: Spread) -> str:
        words = spread.words[:, place][spread.words[:, place] >= 0]
        # the worse one of a tie
        counts = [(np.sum(words == k), k) for k in range(len(VERDICTS))]
        return VERDICTS[max(counts)[1]]

    relative = found.after.relative[:, place]
    return {
        "sd": median(found.after),
        "sd_before": median(found.before),
        "sd_here": float((found.after.sd * found.told.stretch)[0, place]),
        "relative_sd": float(np.median(relative)),
        "relative_sd_before": float(np.median(found.before.relative[:, place])),
        "low": float(relative.min()),
        "high": float(relative.max()),
        "conditional_sd": float(np.median((found.after.conditional * found.told.stretch)[:, place])),
        "verdict": verdict(found.after),
        "verdict_before": verdict(found.before),
        "unit": source.space[name].unit,
    }
