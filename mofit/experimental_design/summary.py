"""Comparisons and designs as plain data in SI units: what ``--json`` prints; terminal and pages read it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.experimental_design.comparison_result import Comparison, ParameterResult
from mofit.experimental_design.criteria import ENOUGH, scales, sd_over_samples
from mofit.experimental_design.design_job import Proposal
from mofit.experimental_design.identifiability import COMBINATION, IDENTIFIABLE, NOT, is_identifiable
from mofit.experimental_design.information import SourceInformation
from mofit.experimental_design.optimal_design import Design

COMPARE_SCHEMA = "mofit.compare/2"
DESIGN_SCHEMA = "mofit.design/2"
#: Single candidates that are listed.
_BEST = 12


def comparison_summary(comparison: Comparison) -> dict[str, Any]:
    """Everything of a comparison; standard deviations are medians over the samples unless noted."""
    known = comparison.sources[0]
    source = known.source
    found: dict[str, Any] = {
        "schema": COMPARE_SCHEMA,
        "model": source.model.name,
        "values": {
            name: {"value": float(value), "unit": source.space[name].unit}
            for name, value in zip(source.space.names, known.samples[0], strict=True)
        },
        "samples": len(known.samples),
        "experiments": [
            {
                "name": row.experiment.name,
                "source": comparison.sources[row.experiment.source].source.name,
                "tests": list(row.experiment.tests),
                "seconds": row.seconds,
                "condition_index": row.condition_index,
                "parameters": {name: _result(entry, known) for name, entry in row.parameters.items()},
            }
            for row in comparison.experiments
        ],
        "information_share": [
            {
                "experiment": each.experiment,
                "share": {
                    name: dict(zip(each.tests, map(float, each.share[:, k]), strict=True))
                    for k, name in enumerate(comparison.parameters)
                },
            }
            for each in comparison.shares
        ],
        "not_identifiable": list(comparison.not_identifiable),
        "augmentations": {
            name: None if best is None else asdict(best) for name, best in comparison.augmentations.items()
        },
        "notes": list(comparison.notes),
    }
    if comparison.simulated:
        found["posterior"] = {
            experiment: {name: asdict(own) for name, own in parameters.items()}
            for experiment, parameters in comparison.simulated.items()
        }
    return found


def _result(entry: ParameterResult, known: SourceInformation) -> dict[str, Any]:
    interval = None
    if entry.profile is not None:
        interval = [end if np.isfinite(end) else None for end in (entry.profile.low, entry.profile.high)]
    own = {name: value for name, value in vars(entry).items() if name not in ("parameter", "profile")}
    return {**own, "unit": known.source.space[entry.parameter].unit, "profile_interval": interval}


def design_summary(proposal: Proposal) -> dict[str, Any]:
    """Everything of a design; standard deviations are summed up over the samples as the criterion is."""
    found, job = proposal.design, proposal.job
    parameters = {name: _parameter(found, name) for name in found.names}
    summary: dict[str, Any] = {
        "schema": DESIGN_SCHEMA,
        "design": [
            {
                "name": candidate.name,
                **candidate.plan.model_dump(exclude_none=True, exclude={"name"}),
                "times": times,
                "seconds": times * candidate.seconds,
                "without": dict(zip(found.names, map(float, own), strict=True)),
            }
            for (candidate, times), own in zip(found.tests, found.without, strict=True)
        ],
        "seconds": found.seconds,
        "expected": {name: entry["sd"] for name, entry in parameters.items()},
        "parameters": parameters,
        "criterion": {
            "name": found.criterion.name,
            "of": list(proposal.effects or job.combination or found.names),
            "combination": dict(job.combination),
            "target": _target(found),
            "robust": job.robust,
            **_values(proposal, parameters),
        },
        "exhaustive": found.exhaustive,
        "samples": len(found.known.samples),
        "values": dict(zip(found.known.source.space.names, map(float, found.known.samples[0]), strict=True)),
        "pareto": [{"seconds": p.seconds, "value": p.value, "tests": dict(p.tests)} for p in found.pareto],
        "singles": [
            {
                "name": found.candidates[i].name,
                "seconds": found.candidates[i].seconds,
                "value": float(found.singles[i]),
                "relative_sd": dict(zip(found.names, map(float, found.single_sd[i]), strict=True)),
            }
            for i in _ranked(found)[:_BEST]
        ],
        "candidates": len(found.candidates),
        "infeasible": dict(Counter(c.infeasible.partition(":")[0] for c in found.candidates if c.infeasible)),
        "space": proposal.space.model_dump(exclude_none=True),
        "notes": list(proposal.notes),
    }
    summary["not_identifiable"] = _not_identifiable(summary, proposal)
    return summary


def _not_identifiable(summary: Mapping[str, Any], proposal: Proposal) -> list[str]:
    """What was asked for and is not reached even with the design, in sentences."""
    if proposal.effects:
        value = summary["criterion"]["after"]
        if value >= ENOUGH:
            return []
        what = " and ".join(proposal.effects)
        return [
            f"The design does not discriminate {what}{'' if len(proposal.effects) > 1 else ' from no effect'}: "
            f"noncentrality {value:.3g}, about {ENOUGH:g} is needed. More time, a wider space or calibration of the "
            "other parameters may help."
        ]
    found = []
    for name in proposal.job.parameters:
        entry = summary["parameters"][name]
        if entry["verdict"] != IDENTIFIABLE:
            found.append(
                f"{name} stays {entry['verdict']} with the design: expected standard deviation {entry['sd']:.3g} "
                f"{entry['unit']} ({100 * entry['relative_sd']:.3g} % of its value); with all other parameters known "
                f"it would be {entry['conditional_sd']:.3g} {entry['unit']}. More time or a wider space may help."
            )
    return found


def _values(proposal: Proposal, parameters: Mapping[str, Any]) -> dict[str, float]:
    """The criterion before and after; that of a single parameter is what the table of the parameters says of it."""
    found = proposal.design
    if found.criterion.name == "c" and not proposal.job.combination:
        (own,) = parameters.values()
        return {"before": own["relative_sd_before"], "after": own["relative_sd"]}
    return {"before": found.value_before, "after": found.value_after}


def _ranked(found: Design) -> list[int]:
    """Feasible candidates, the best alone first."""
    values = -found.singles if found.criterion.larger_is_better else found.singles
    return [int(i) for i in np.argsort(values) if np.isfinite(values[i])]


def _target(found: Design) -> dict[str, Any] | None:
    if found.target is None:
        return None
    return {name: {"value": value, "unit": found.target.units[name]} for name, value in found.target.conditions.items()}


def _at_target(found: Design, name: str) -> dict[str, Any]:
    """Of a parameter under the conditions of the target; by its laws a design has no bounds there."""
    known, target = found.known, found.target
    assert target is not None
    place, k = known.source.space.index(name), found.names.index(name)
    size, (before, after) = target.size[:, place], (own[:, k] for own in found.relative_sd)
    share = (
        np.abs(target.rows[:, place, place])
        * known.derivative[:, place]
        / scales(known.source.space, known.samples)[:, place]
    )
    alone = share * found.after.conditional_sd[:, place]

    def over(values: FloatArray) -> float:
        return float(sd_over_samples(values, found.criterion.aggregate))

    def verdict(relative: FloatArray) -> str:
        for sd, said in ((relative, IDENTIFIABLE), (alone, COMBINATION)):
            if np.mean(is_identifiable(sd, 1.0)) > 0.5:
                return said
        return NOT

    return {
        "sd": over(after * size),
        "sd_before": over(before * size),
        "sd_at_values": float(after[0] * size[0]),
        "relative_sd": over(after),
        "relative_sd_before": over(before),
        "low": float(after.min()),
        "high": float(after.max()),
        "conditional_sd": over(alone * size),
        "verdict": verdict(after),
        "verdict_before": verdict(before),
        "unit": known.source.space[name].unit,
    }


def _parameter(found: Design, name: str) -> dict[str, Any]:
    if found.target is not None:
        return _at_target(found, name)
    known = found.known
    place = known.source.space.index(name)

    def over(values: FloatArray) -> float:
        return float(sd_over_samples(values[:, place], found.criterion.aggregate))

    before, after, relative = found.before, found.after, found.after.relative_sd[:, place]
    return {
        "sd": over(after.sd * known.derivative),
        "sd_before": over(before.sd * known.derivative),
        "sd_at_values": float(after.sd[0, place] * known.derivative[0, place]),
        "relative_sd": over(after.relative_sd),
        "relative_sd_before": over(before.relative_sd),
        "low": float(relative.min()),
        "high": float(relative.max()),
        "conditional_sd": over(after.conditional_sd * known.derivative),
        "verdict": after.verdict(place),
        "verdict_before": before.verdict(place),
        "unit": known.source.space[name].unit,
    }
