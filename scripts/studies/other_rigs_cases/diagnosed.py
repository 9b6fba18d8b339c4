"""One diagnosis, blinded: campaign and model in, JSON and predictions of records held out. Runs as a process.

python diagnosed.py NAME --work FOLDER --model MODEL --seed 0
"""

from __future__ import annotations

import argparse
import inspect
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mofit import Campaign, diagnose, read_campaign
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.result import Diagnosis, summary
from mofit.identification.settings import Settings
from mofit.models import find_model, with_effects
from mofit.parameters import ParameterSpace
from mofit.problem import build_problem


def predictions(found: Diagnosis, model: str, records: Campaign) -> dict[str, Any]:
    """Outputs of the records by the fitted models, without effects and with the best ones.

    What each test has of its own is neutral in them. Records of the campaign's kind begin as its tests do: at rest, or
    once the rig has settled.
    """
    pairs = {"without": found.attribution.baseline, "with": found.attribution.best.fitted}
    return {
        f"{key}:{test.name}": output
        for key, fitted in pairs.items()
        for test, output in zip(records.measurements, _outputs(fitted, model, records), strict=True)
    }


def _outputs(fitted: Fitted, model: str, records: Campaign) -> list[Any]:
    extended = with_effects(find_model(model), *fitted.hypothesis.effects)
    leads, names = _leads(fitted, records), [one.name for one in extended.parameters]
    neutral = {name: value for effect in fitted.hypothesis.effects for name, value in effect.neutral.items()}
    fixed = neutral | {name: value for name, value in fitted.values.items() if name in names}
    problem = build_problem(extended, records, space=ParameterSpace(()), fixed=fixed, leads=leads)
    return [one[0, :, 0] for one in problem.simulate(np.empty((1, 0)))]


def _leads(fitted: Fitted, records: Campaign) -> dict[str, float]:
    """Time [s] for which inputs act before a record: the longest one of a test of its kind in the campaign."""
    problem = fitted.hypothesis.observed.problem
    found = dict[str, float]()
    for test, signals in zip(problem.measurements, problem.signals, strict=True):
        found[test.kind] = max(found.get(test.kind, 0.0), signals.lead)
    return {one.name: found.get(one.kind, 0.0) for one in records.measurements}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--model", required=True)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    campaign, more = read_campaign(args.work / "campaigns" / f"{args.name}.nc"), {}
    if "hold_out" in inspect.signature(diagnose).parameters:
        given = read_campaign(args.work / "given" / f"{args.name}.nc").measurements
        campaign = replace(campaign, measurements=(*campaign.measurements, *given))
        more["hold_out"] = tuple(one.name for one in given)
    found = diagnose(campaign, args.model, settings=Settings(seed=args.seed, jobs=1), **more)
    print(json.dumps(summary(found)))
    records = read_campaign(args.work / "held_out" / f"{args.name}.nc")
    np.savez_compressed(
        args.work / "answers" / args.name / "predictions.npz", **predictions(found, args.model, records)
    )


if __name__ == "__main__":
    main()
