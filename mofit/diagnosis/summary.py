"""What ``mofit diagnose --json`` prints: plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from mofit.diagnosis.locate import Where, significant
from mofit.diagnosis.remaining import Remaining

if TYPE_CHECKING:
    from mofit.diagnosis.diagnose import Diagnosis

#: Chance below which a spot of the gap is listed.
_LISTED = 0.01


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis as plain data, every number in SI units."""
    conclusion, shrinkage, following = diagnosis.conclusion, diagnosis.shrinkage, diagnosis.next_test
    effects = [
        {
            "name": effect.name,
            "probability": effect.probability,
            "size": effect.size,
            "size_low": effect.size_low,
            "size_high": effect.size_high,
            "unit": effect.unit,
            "parameters": effect.values,
            "calibration_tests_too": effect.everywhere,
        }
        for effect in conclusion.effects
    ]
    return {
        "verdict": conclusion.verdict,
        "sentence": conclusion.sentence,
        "effects": effects,
        "group": list(conclusion.group),
        "explanations": [list(explanation.effects) for explanation in conclusion.alike],
        "where": _where(diagnosis.before, diagnosis.attribution.left),
        "left": {**_where(diagnosis.after, diagnosis.attribution.best_left), "share": conclusion.left_share},
        "shrinkage": None if shrinkage is None else {
            key: getattr(shrinkage, key) for key in ("predicted", "confirmed", "low", "high", "measured")
        },
        "shrinkage_reason": diagnosis.shrinkage_reason,
        "next_test": None if following is None else asdict(following),
        "candidates": [_candidate(diagnosis, one) for one in diagnosis.attribution.screened],
        "left_out": dict(diagnosis.left_out),
        "agreement": [
            {"parameter": a.parameter, "tests": len(a.tests), "p": _number(a.p), "i_squared": _number(a.i_squared)}
            for a in diagnosis.agreements
        ],
        "nrmsd_before": dict(diagnosis.nrmsd_before),
        "nrmsd_after": dict(diagnosis.nrmsd_after),
        "noise_floor": dict(diagnosis.noise_floor),
        "seconds": diagnosis.seconds,
    }  # fmt: skip


def _where(where: Where, left: Remaining) -> dict[str, Any]:
    listed = [spot for spot, on in zip(where.spots, significant(where, _LISTED), strict=True) if on]
    return {
        "gap": where.gap,
        "unit": where.unit,
        "of_peak": max((spot.of_peak for spot in listed), default=0.0),
        "spots": [{key: _number(value) for key, value in asdict(spot).items()} for spot in listed],
        "clues": [
            {
                "name": clue.name,
                "told": clue.told,
                "rms": clue.rms,
                "unit": where.unit,
                "p": min(1.0, clue.p * len(left.clues)),
                "frequency": _number(clue.frequency),
            }
            for clue in left.loud(_LISTED)
        ],
    }


def _candidate(diagnosis: Diagnosis, one: Any) -> Mapping[str, Any]:
    """The screen's view of one effect, and what leaving it out would do to the model's parameters."""
    baseline = diagnosis.attribution.baseline
    space = baseline.hypothesis.space
    slope = space.slope(space.from_unit(baseline.minimum.point))
    return {
        "name": one.name,
        "statistic": one.statistic,
        "p": one.p_holm,
        "expected_size": one.size.tolist(),
        "absorbed": one.absorbed,
        "bias": {name: float(value) for name, value in zip(space.names, one.bias * slope, strict=True)},
    }


def _number(value: Any) -> Any:
    """None for what JSON cannot say."""
    return None if isinstance(value, float) and not np.isfinite(value) else value
