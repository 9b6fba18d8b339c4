"""Parameters over conditions: laws recovered, a condition left out, and the cost. Writes reports/conditions/README.md.

    python scripts/studies/conditions.py [--seeds 50] [--sampled 2] [--cells 2 4 8] [--seed 0] [--work FOLDER]

Simulated: a Maxwell damper under three loads, three pressures and two speeds, integrated by a Runge-Kutta method of
conditions_cases.py, which shares no code with mofit. Its parameters follow laws: c is linear in load and pressure, d
linear in speed, c_M linear in load and speed, d_M quadratic in load and linear in speed, the offset constant. Every
combination has one multisine of 2 s (0.5 to 7.5 Hz, sampled at 200 Hz: at 50 Hz the velocity from the samples is off by
enough to bias d) with 20 N of white noise, 1 % of the range. One combination (the middle load at the highest pressure
and speed) is left out. The laws are chosen by evidence, then identified jointly, as `mofit identify --over --hold-out
--no-sample` does without its reference fits and report. Intervals and bands are of 90 %, those of the Laplace
approximation. Counted are the laws chosen; the intervals that hold the true coefficient; at the combination left out
the bands that hold the true parameter, the samples of the true output within the band by the parameters alone, and the
measured samples within the band with noise. A mean over seeds has its standard error. Beside it stand the fits of the
combinations alone: standard deviation, and root mean square error against the truth, of a parameter by the laws
relative to that alone; and how often their intervals hold the truth. The first seeds (--sampled) are sampled with
emcee, too. The cost is processor time over the number of loads, laws said. Rows that the work folder holds already are
kept if the same code made them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from conditions_cases import (
    CONDITIONS,
    LAWS,
    LEFT_OUT,
    PARAMETERS,
    TRUTH,
    combinations,
    name_of,
    simulated,
    true_values,
)
from conditions_page import page
from kept import kept
from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.conditions import study_conditions
from mofit.identification.findings import of_laws
from mofit.identification.law_study import LawStudy
from mofit.identification.mode_sampling import sample_modes
from mofit.identification.result import IdentificationResult, Located, PosteriorMode
from mofit.identification.result_tree import assemble
from mofit.identification.settings import Settings
from mofit.identification.stages import adjusted_modes, locate_minima
from mofit.models import Model, find_model, values_under
from mofit.prediction.draws import posterior_draws
from mofit.prediction.records import Prediction, predict_records
from mofit.results import parameter_layout
from report_page import ROOT, header, made_with, write_page

MODEL = "maxwell_damper"
DRAWS = 4000


def settings(seed: int, laws: dict[str, str], over: Sequence[str] = CONDITIONS, sample: bool = False) -> Settings:
    """No progression; all else as by default."""
    return Settings(fixed={"p": 0.0}, over=tuple(over), laws=laws, sample=sample, seed=seed, jobs=1)


def recovered(seed: int, sample: bool = False) -> dict[str, Any]:
    """One campaign: laws, intervals, the combination left out."""
    began, model = time.process_time(), find_model(MODEL)
    tests, clean = simulated(combinations(), np.random.default_rng(seed))
    whole, left = Campaign("damper", "simulated", {}, tests), name_of(LEFT_OUT)
    campaign, chosen = whole.select([name for name in whole.tests if name != left]), settings(seed, {}, sample=sample)
    study = study_conditions(campaign, model, chosen)
    studied, lawful, own = time.process_time(), study.model(model), study.settings(chosen)
    located = locate_minima(campaign, lawful, own, start=study.fit.values)
    modes = sample_modes(adjusted_modes(located.posterior, located.minima, own), own)
    fitted = time.process_time()
    tree = assemble(_result(whole, lawful, own, study, located, modes))
    (predicted,) = predict_records(tree, lawful, whole.select([left]))
    mode, names = tree["modes/m1"].dataset, parameter_layout(tree).space.names
    draws = dict(zip(names, posterior_draws(tree, DRAWS, seed).T, strict=True))
    mean, sd = (mode["mean"], mode["sd"]) if sample else (mode["value"], mode["laplace_sd"])
    return {
        "wrong": [f"{n} over {q}: {form}" for (n, q), form in study.fit.forms.items() if form != LAWS[n, q]],
        "z": {
            n: float((v - TRUTH[n]) / s) for n, v, s in zip(names, mean.values, sd.values, strict=True) if n in TRUTH
        },
        "mean": dict(zip(names, mean.values.tolist(), strict=True)),
        "sd": dict(zip(names, sd.values.tolist(), strict=True)),
        "left": _held(study, lawful, draws),
        "output": _output(predicted, clean[whole.tests.index(left)]),
        "beside": _beside(study, lawful, draws),
        "said": [one.text for one in of_laws(study, whole)],
        "chi_square": [study.fit.chi_square, study.fit.freedom],
        "seconds": [studied - began, fitted - studied, time.process_time() - fitted],
    }


def _result(
    whole: Campaign, model: Model, own: Settings, study: LawStudy, located: Located, modes: tuple[PosteriorMode, ...]
) -> IdentificationResult:
    """As `mofit.identification.identify` makes it, without reference fits."""
    laws = {"parameter_laws": [asdict(law) for law in study.laws]}
    known = {"model": model.name, "tests": list(located.problem.tests), **own.deciding(), **laws}
    return IdentificationResult(
        **vars(located), campaign=whole, configuration=known, modes=modes, references={}, seconds={}, study=study
    )


def _under(study: LawStudy, model: Model, draws: dict[str, FloatArray], at: Sequence[float], name: str) -> FloatArray:
    """Draws of a parameter under a combination."""
    known = {one.name: one for one in model.parameters}
    return values_under(known[name], study.laws, draws, dict(zip(CONDITIONS, at, strict=True)))


def _held(study: LawStudy, model: Model, draws: dict[str, FloatArray]) -> dict[str, bool]:
    """Whether the band of a parameter holds the truth at the combination left out; a free one has none there."""
    names = [name for name in PARAMETERS if name not in study.fit.free]
    bands = {name: np.quantile(_under(study, model, draws, LEFT_OUT, name), [0.05, 0.95]) for name in names}
    return {name: bool(low <= true_values(LEFT_OUT)[name] <= high) for name, (low, high) in bands.items()}


def _output(predicted: Prediction, clean: FloatArray) -> dict[str, float]:
    """Shares of the samples of the combination left out within the bands of its output."""
    (band,), (score,) = predicted.bands, predicted.scores
    used = predicted.scored[:, 0]
    inside = (clean >= band.parameter_low) & (clean <= band.parameter_high)
    return {"true": float(np.mean(inside[used])), "measured": score.coverage, "nrmsd": score.nrmsd}


def _beside(study: LawStudy, model: Model, draws: dict[str, FloatArray]) -> dict[str, dict[str, list[float]]]:
    """Of every parameter in every combination: standard deviation and error, by the laws and alone."""
    found: dict[str, dict[str, list[float]]] = {}
    for k, one in enumerate(study.cells.parameters):
        if one.name in study.fit.free:
            continue
        lawful = [_under(study, model, draws, at, one.name) for at in study.cells.at]
        truth = [true_values(tuple(at))[one.name] for at in study.cells.at]
        found[one.name] = {
            "sd": [float(np.std(own)) for own in lawful],
            "sd alone": study.cells.sd[:, k].tolist(),
            "error": [float(np.median(own) - true) for own, true in zip(lawful, truth, strict=True)],
            "error alone": (study.cells.values[:, k] - truth).tolist(),
        }
    return found


def cost(count: int) -> dict[str, Any]:
    """Processor time over the number of loads, laws said."""
    began, rng, model = time.process_time(), np.random.default_rng(count), find_model(MODEL)
    tests, _ = simulated([(float(load), 2.5e5, 20.0) for load in np.linspace(2e3, 4e3, count)], rng)
    laws = dict.fromkeys(("c", "c_M", "d_M"), "linear") | dict.fromkeys(("d", "F_0"), "constant")
    campaign, chosen = Campaign("damper", "simulated", {}, tests), settings(0, laws, CONDITIONS[:1])
    study = study_conditions(campaign, model, chosen)
    alone = time.process_time()
    located = locate_minima(campaign, study.model(model), study.settings(chosen), start=study.fit.values)
    adjusted_modes(located.posterior, located.minima, chosen)
    return {"alone": alone - began, "joint": time.process_time() - alone}


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--sampled", type=int, default=2)
    parser.add_argument("--cells", type=int, nargs="*", default=[2, 4, 8])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "conditions")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    costs = {count: kept(options.work / f"cost_{count}.json", partial(cost, count)) for count in options.cells}
    rows: dict[bool, list[dict[str, Any]]] = {False: [], True: []}
    for sample, count in ((False, options.seeds), (True, options.sampled)):
        for seed in range(options.seed, options.seed + count):
            file = options.work / f"{'sampled' if sample else 'seed'}_{seed}.json"
            rows[sample].append(kept(file, partial(recovered, seed, sample)))
            command = (
                f"conditions.py --seeds {len(rows[False])} --sampled {len(rows[True])}"
                f" --cells {' '.join(map(str, options.cells))} --seed {options.seed}"
            )
            lines = header("Parameters over conditions", __doc__, command, made_with())
            write_page("conditions", [*lines, *page(rows[False], rows[True], costs)])


if __name__ == "__main__":
    main()
