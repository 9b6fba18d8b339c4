"""What the diagnosis page draws, as plain data and arrays in SI units, and the page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.summary import summary
from mofit.diagnosis.verdict import weights
from mofit.drives import first_input
from mofit.report.diagnosis import write_diagnosis
from mofit.report.inline import Page

if TYPE_CHECKING:
    from mofit.diagnosis.diagnose import Diagnosis

Array = NDArray[np.float64]

#: Samples of a test that does not repeat that are drawn.
_MOST_SAMPLES = 1500


def diagnosis_page(diagnosis: Diagnosis) -> Page:
    """The page of a diagnosis, to be seen in a notebook; nothing is written."""
    with TemporaryDirectory() as folder:
        return Page(write_diagnosis(page_data(diagnosis), Path(folder)).read_text(encoding="utf-8"))


def page_data(diagnosis: Diagnosis) -> dict[str, Any]:
    """Maps, explanations, and measured beside simulated, for `mofit.report.diagnosis`, over the plain summary."""
    found = diagnosis.attribution
    model = found.baseline.hypothesis.observed.problem.model
    return {
        **summary(diagnosis),
        "campaign": diagnosis.campaign,
        "source": diagnosis.source,
        "model_title": model.title or model.name,
        "maps": {
            name: {
                "spots": [asdict(spot) for spot in where.spots],
                "input": asdict(where.input_map),
                "time": [asdict(part) for part in where.time_maps],
                "squares": dict(where.squares),
            }
            for name, where in (("before", diagnosis.before), ("after", diagnosis.after))
        },
        "tried": [
            {
                "effects": list(explanation.effects),
                "criterion": explanation.criterion - found.best.criterion,
                "probability": float(weight),
                "parameters": explanation.fitted.values,
            }
            for explanation, weight in zip(found.explanations, weights(found.explanations), strict=True)
        ],
        "titles": {one.name: one.effect.title or one.name for one in found.screened},
        "own_parameters": {
            name: {
                "unit": parameter.unit,
                "before": found.baseline.values[name],
                "after": found.best.fitted.values[name],
                "sd": float(sd),
                "at_bound": bool(bound),
            }
            for name, parameter, sd, bound in zip(
                found.baseline.hypothesis.space.names,
                found.baseline.hypothesis.space.parameters,
                _sd(found.baseline),
                found.baseline.minimum.at_bound,
                strict=True,
            )
        },
        "agreements": [asdict(one) for one in diagnosis.agreements],
        "series": list(_series(diagnosis)),
    }


def _sd(fitted: Fitted) -> Array:
    space = fitted.hypothesis.space
    return fitted.sd() * space.slope(space.from_unit(fitted.minimum.point))


def _series(diagnosis: Diagnosis) -> Iterator[dict[str, Any]]:
    """Input, measured and simulated output of every record: its last period, or a stretch of it."""
    found = diagnosis.attribution
    observed = found.baseline.hypothesis.observed
    stored = [
        fitted.hypothesis.simulator.sensitivities(fitted.hypothesis.full(fitted.minimum.point[None]))
        for fitted in (found.baseline, found.best.fitted)
    ]
    driver = next(
        c for c in observed.problem.model.inputs if (c.derivative_of or c.name) == first_input(observed.problem.model)
    )
    for test, output, w in observed.parts:
        measurement = observed.problem.measurements[test]
        length = round(w.period / w.step) + 1 if w.periods else _MOST_SAMPLES
        stop = w.start + w.count
        cut = slice(max(stop - length, w.start), stop)
        channel = observed.problem.model.outputs[output]
        name = first_input(observed.problem.model)
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
            "before": stored[0][test][0][0, cut, output],
            "after": stored[1][test][0][0, cut, output],
        }
