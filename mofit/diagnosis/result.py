"""The result of a diagnosis, what ``mofit diagnose --json`` prints of it, and what its page draws."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from mofit.diagnosis.accounts import Account
from mofit.diagnosis.conclusion import Conclusion
from mofit.diagnosis.gap_under_conditions import GapUnder
from mofit.diagnosis.left_residual import LISTED, Residuals
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.next_experiment import NextExperiment
from mofit.diagnosis.proposal import Proposal
from mofit.diagnosis.records import page_records
from mofit.diagnosis.residual_map import Homogeneity, ResidualMap
from mofit.diagnosis.score_test import ScoreTest
from mofit.diagnosis.shrinkage import Share, Shrinkage
from mofit.diagnosis.term_curve import term_curves
from mofit.diagnosis.whitened_data import WhitenedData

SCHEMA = "mofit.diagnosis/2"
#: Samples that are drawn of a test that does not repeat.
_MOST_SAMPLES = 1500


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
    under_conditions
        The gap without effects under every value of the conditions over which parameters follow laws.
    homogeneity
        Whether single tests agree on the model's parameters.
    shrinkage, shrinkage_reason
        How far the gap shrinks, or why that is not reported.
    proposed, proposed_reason
        Terms learnt from the data where no known effect explains the gap, or why none are proposed.
    next_experiment
        What would discriminate between indistinguishable models.
    nrmsd_before, nrmsd_after, noise_floor
        Per test.
    left_out
        Effects that could not be candidates, and why.
    accounts
        What became of every candidate: fitted, not needed, or could not be fitted; and why.
    warnings
        Ranges that were widened, parameters at the end of theirs.
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
    under_conditions: tuple[GapUnder, ...]
    homogeneity: tuple[Homogeneity, ...]
    shrinkage: Shrinkage | None
    shrinkage_reason: str
    proposed: Proposal | None
    proposed_reason: str
    next_experiment: NextExperiment | None
    nrmsd_before: Mapping[str, float]
    nrmsd_after: Mapping[str, float]
    noise_floor: Mapping[str, float]
    left_out: Mapping[str, str]
    accounts: tuple[Account, ...]
    warnings: tuple[str, ...]
    complete: bool
    """Whether all simulations were made that it asked of a user's simulator."""
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
    return {
        "schema": SCHEMA,
        "verdict": conclusion.verdict,
        "sentence": conclusion.sentence,
        "effects": [{k: v for k, v in asdict(effect).items() if k != "title"} for effect in conclusion.effects],
        "families": [asdict(family) for family in conclusion.families],
        "group": list(conclusion.group),
        "candidate_models": [list(one.effects) for one in conclusion.indistinguishable],
        "where": _where(diagnosis.before, found.baseline_residuals)
        | {"conditions": [asdict(one) for one in diagnosis.under_conditions]},
        "residual": _where(diagnosis.after, found.best_residuals) | _left(diagnosis),
        "shrinkage": None if shrinkage is None else _shrinkage(shrinkage),
        "shrinkage_reason": diagnosis.shrinkage_reason,
        "proposed": None if diagnosis.proposed is None else _proposed(diagnosis.proposed),
        "proposed_reason": diagnosis.proposed_reason,
        "next_experiment": None if following is None else asdict(following),
        "candidates": [_candidate(found, one) for one in found.score_tests],
        "accounts": [asdict(one) for one in diagnosis.accounts],
        "left_out": dict(diagnosis.left_out),
        "warnings": list(diagnosis.warnings),
        "complete": diagnosis.complete,
        "homogeneity": [
            {"parameter": one.parameter, "tests": len(one.tests)}
            | {key: _number(getattr(one, key)) for key in ("p_value", "i_squared")}
            for one in diagnosis.homogeneity
        ],
        "nrmsd_before": dict(diagnosis.nrmsd_before),
        "nrmsd_after": dict(diagnosis.nrmsd_after),
        "noise_floor": dict(diagnosis.noise_floor),
        "seconds": diagnosis.seconds,
    }


def _shrinkage(shrinkage: Shrinkage) -> dict[str, Any]:
    """The headline, and every kind of hold-out, the most demanding one last."""
    headline = shrinkage.headline
    return {
        "sentence": shrinkage.sentence,
        **{key: getattr(headline, key) for key in ("kind", "share", "low", "high", "observed")},
        "predicted": shrinkage.predicted,
        "caveat": shrinkage.caveat,
        "kinds": [_share(one) for one in shrinkage.shares],
    }


def _share(one: Share) -> dict[str, Any]:
    own = ("name", "tests", "share", "low", "high", "ran_away")
    hold_outs = [{key: getattr(hold_out, key) for key in own} for hold_out in one.hold_outs]
    values = {key: getattr(one, key) for key in ("kind", "place", "share", "low", "high", "observed")}
    return {**values, "hold_outs": [{**hold_out, "tests": list(hold_out["tests"])} for hold_out in hold_outs]}


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


def _left(diagnosis: Diagnosis) -> dict[str, Any]:
    """What the best model leaves of the gap, and where most of that lies."""
    location = diagnosis.after.location
    return {
        "share": diagnosis.conclusion.residual_share,
        "location": None if location is None else asdict(location),
    }


def _proposed(proposal: Proposal) -> dict[str, Any]:
    """What is proposed, with its estimates and what it removes of the gap."""
    return {
        "sentence": proposal.sentence,
        "quantity": proposal.target.name,
        "alike": list(proposal.target.alike),
        "beside": list(proposal.beside),
        "terms": [{"title": one.term.title, "formula": one.text} for one in proposal.effect.terms],
        "scales": {one.name: one.scale for one in proposal.effect.variables},
        "parameters": [asdict(one) for one in proposal.estimates],
        "shrinkage": {key: getattr(proposal, key) for key in ("removed", "low", "high", "observed", "held_out")},
    }


def _candidate(found: Attribution, one: ScoreTest) -> Mapping[str, Any]:
    """The score test of one effect, and what leaving it out would do to the model's parameters."""
    names, slope = found.baseline.hypothesis.space.names, found.baseline.derivative
    shared = found.baseline.hypothesis.layout.shared
    return {
        "name": one.name,
        "family": one.effect.cause,
        "statistic": one.statistic,
        "p_value": one.p_holm,
        "expected_size": one.size.tolist(),
        "confounding": one.confounding,
        "bias": {name: float(value) for name, value, own in zip(names, one.bias * slope, shared, strict=True) if own},
    }


def _number(value: Any) -> Any:
    """None for what JSON cannot hold."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def page_data(diagnosis: Diagnosis) -> dict[str, Any]:
    """The plain summary, and beside it maps, fitted models, and measured and simulated records."""
    found = diagnosis.attribution
    baseline, best = found.baseline, found.best.fitted
    model, space = diagnosis.observed.problem.model, baseline.hypothesis.space
    return {
        **summary(diagnosis),
        "campaign": diagnosis.campaign,
        "source": diagnosis.source,
        "model_title": model.title or model.name,
        "residual_maps": {"before": _maps(diagnosis.before), "after": _maps(diagnosis.after)},
        "fitted_models": [
            {
                "effects": list(one.effects),
                "criterion": one.criterion - found.best.criterion,
                "probability": float(probability),
                "parameters": one.fitted.values,
            }
            for one, probability in zip(found.models, diagnosis.conclusion.probabilities, strict=True)
        ],
        "titles": {one.name: one.effect.title or one.name for one in found.score_tests},
        "model_parameters": {
            name: {
                "unit": unit,
                "before": baseline.values[name],
                "after": best.values[name],
                "sd": float(sd),
                "at_bound": bool(bound),
            }
            for name, unit, sd, bound in zip(
                space.names, space.units, baseline.sd() * baseline.derivative, baseline.minimum.at_bound, strict=True
            )
        },
        "test_estimates": [asdict(one) for one in diagnosis.homogeneity],
        "records": list(page_records(diagnosis.observed, baseline, best)),
        "proposed_curves": None if diagnosis.proposed is None else term_curves(diagnosis.proposed),
    }


def _maps(located: ResidualMap) -> dict[str, Any]:
    return {
        "residuals": [asdict(entry) for entry in located.entries],
        "input": asdict(located.input_map),
        "time": [asdict(part) for part in located.time_maps],
        "squares": dict(located.squares),
    }
