"""What the diagnosis page draws, as plain data and arrays in SI units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from mofit.diagnosis.refit import probabilities
from mofit.diagnosis.result import Diagnosis, summary
from mofit.simulation import first_input

#: Samples that are drawn of a test that does not repeat.
_MOST_SAMPLES = 1500


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
        "residual_maps": {
            name: {
                "residuals": [asdict(entry) for entry in located.entries],
                "input": asdict(located.input_map),
                "time": [asdict(part) for part in located.time_maps],
                "squares": dict(located.squares),
            }
            for name, located in (("before", diagnosis.before), ("after", diagnosis.after))
        },
        "fitted_models": [
            {
                "effects": list(one.effects),
                "criterion": one.criterion - found.best.criterion,
                "probability": float(probability),
                "parameters": one.fitted.values,
            }
            for one, probability in zip(found.models, probabilities(found.models), strict=True)
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
        "records": list(_records(diagnosis)),
    }


def _records(diagnosis: Diagnosis) -> Iterator[dict[str, Any]]:
    """Input, measured and simulated output of every record: its last period, or the end of it."""
    observed, found = diagnosis.observed, diagnosis.attribution
    before, after = (one.hypothesis.outputs(one.minimum.point[None]) for one in (found.baseline, found.best.fitted))
    name = first_input(observed.problem.model)
    driver = next(c for c in observed.problem.model.inputs if (c.derivative_of or c.name) == name)
    for test, output, w in observed.records:
        measurement, channel = observed.problem.measurements[test], observed.problem.model.outputs[output]
        length = round(w.period / w.step) + 1 if w.periods else _MOST_SAMPLES
        stop = w.start + w.count
        cut = slice(max(stop - length, w.start), stop)
        yield {
            "test": measurement.name,
            "kind": measurement.kind,
            "frequency": 1 / w.period if w.periods else None,
            "input_name": name.replace("_", " "),
            "input_unit": measurement.units.get(name, driver.unit),
            "output_name": channel.name.replace("_", " "),
            "output_unit": channel.unit,
            "time": measurement.time[cut],
            "input": measurement.channel(name)[cut],
            "measured": measurement.channel(channel.name)[cut],
            "before": before[test][0][0, cut, output],
            "after": after[test][0][0, cut, output],
        }
