"""The result of a diagnosis, and what ``mofit diagnose --json`` prints of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from mofit.diagnosis.conclusion import Conclusion
from mofit.diagnosis.cross_validation import Shrinkage
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.next_experiment import NextExperiment
from mofit.diagnosis.residual_map import Homogeneity, ResidualMap
from mofit.diagnosis.residual_tests import LISTED, Residuals
from mofit.diagnosis.score_test import ScoreTest
from mofit.diagnosis.whitened_data import WhitenedData

SCHEMA = "mofit.diagnosis/2"


@dataclass(frozen=True)
class Diagnosis:
    """All that was found; see the modules of the parts. In a notebook it shows its page.

    Parameters
    ----------
    campaign, source
        Title and source of the campaign.
    conclusion
        Verdict, sentence, effects, group.
    attribution
        Every candidate and every model that was tried, with their final estimates.
    before, after
        The gap located, without effects and with the best model.
    homogeneity
        Whether single tests agree on the model's parameters.
    shrinkage, shrinkage_reason
        How far the gap shrinks, or why that is not reported.
    next_experiment
        What would discriminate between indistinguishable models.
    nrmsd_before, nrmsd_after, noise_floor
        Per test.
    left_out
        Effects that could not be candidates, and why.
    seconds
        Processor time.
    page
        Makes the HTML that a notebook shows.
    """

    campaign: str
    source: str
    conclusion: Conclusion
    attribution: Attribution
    before: ResidualMap
    after: ResidualMap
    homogeneity: tuple[Homogeneity, ...]
    shrinkage: Shrinkage | None
    shrinkage_reason: str
    next_experiment: NextExperiment | None
    nrmsd_before: Mapping[str, float]
    nrmsd_after: Mapping[str, float]
    noise_floor: Mapping[str, float]
    left_out: Mapping[str, str]
    seconds: float = field(compare=False)
    page: Callable[[Diagnosis], str] = field(compare=False, repr=False)

    @property
    def observed(self) -> WhitenedData:
        """The whitened tests that the final estimates were fitted to."""
        return self.attribution.baseline.hypothesis.observed

    def _repr_html_(self) -> str:
        return self.page(self)


def summary(diagnosis: Diagnosis) -> dict[str, Any]:
    """The diagnosis as plain data, every number in SI units."""
    conclusion, shrinkage, following = diagnosis.conclusion, diagnosis.shrinkage, diagnosis.next_experiment
    found = diagnosis.attribution
    renamed = {"values": "parameters"}
    shares = ("predicted", "refitted", "low", "high", "observed")
    return {
        "schema": SCHEMA,
        "verdict": conclusion.verdict,
        "sentence": conclusion.sentence,
        "effects": [
            {renamed.get(key, key): value for key, value in asdict(effect).items() if key != "title"}
            for effect in conclusion.effects
        ],
        "group": list(conclusion.group),
        "candidate_models": [list(one.effects) for one in conclusion.indistinguishable],
        "where": _where(diagnosis.before, found.baseline_residuals),
        "residual": {
            **_where(diagnosis.after, found.best_residuals),
            "share": conclusion.residual_share,
        },
        "shrinkage": None if shrinkage is None else {key: getattr(shrinkage, key) for key in shares},
        "shrinkage_reason": diagnosis.shrinkage_reason,
        "next_experiment": None if following is None else asdict(following),
        "candidates": [_candidate(found, one) for one in found.score_tests],
        "left_out": dict(diagnosis.left_out),
        "homogeneity": [
            {
                "parameter": one.parameter,
                "tests": len(one.tests),
                "p_value": _number(one.p_value),
                "i_squared": _number(one.i_squared),
            }
            for one in diagnosis.homogeneity
        ],
        "nrmsd_before": dict(diagnosis.nrmsd_before),
        "nrmsd_after": dict(diagnosis.nrmsd_after),
        "noise_floor": dict(diagnosis.noise_floor),
        "seconds": diagnosis.seconds,
    }


def _where(located: ResidualMap, residuals: Residuals) -> dict[str, Any]:
    entries = located.significant(LISTED)
    return {
        "gap": located.gap,
        "unit": located.unit,
        "of_peak": max((entry.of_peak for entry in entries), default=0.0),
        "residuals": [{key: _number(value) for key, value in asdict(entry).items()} for entry in entries],
        "residual_tests": [
            {
                "name": test.name,
                "description": test.description,
                "rms": test.rms,
                "unit": located.unit,
                "p_value": min(1.0, test.p_value * len(residuals.tests)),
                "frequency": _number(test.frequency),
            }
            for test in residuals.significant(LISTED)
        ],
    }


def _candidate(found: Attribution, one: ScoreTest) -> Mapping[str, Any]:
    """The score test of one effect, and what leaving it out would do to the model's parameters."""
    names, slope = found.baseline.hypothesis.space.names, found.baseline.derivative
    return {
        "name": one.name,
        "statistic": one.statistic,
        "p_value": one.p_holm,
        "expected_size": one.size.tolist(),
        "confounding": one.confounding,
        "bias": {name: float(value) for name, value in zip(names, one.bias * slope, strict=True)},
    }


def _number(value: Any) -> Any:
    """None for what JSON cannot hold."""
    return None if isinstance(value, float) and not np.isfinite(value) else value
