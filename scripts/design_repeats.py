"""Repeats of a plan with noise of their own, estimated as `mofit identify` does, for the design study."""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import calibrate
from mofit.campaign import Campaign
from mofit.kernel import Simulator
from mofit.kernel.steps import RK4
from mofit.library import find_model
from mofit.model import Model
from mofit.parameters import ParameterSpace
from mofit.posing import main_problem
from mofit.problem import Problem
from mofit.refine import merge, refine
from mofit.settings import Settings
from mofit.simulate import Plan, run_plan
from mofit.simulate.noise import noise
from mofit.simulate.setup import set_up
from mofit.spread import spread_problem

Array = NDArray[np.float64]

DYNAMIC = ("d_y", "c_M", "d_M")
SEED = 5
#: Repeats per row of the work folder.
CHUNK = 10


@cache
def clean(text: str) -> tuple[Campaign, dict[str, dict[str, float]], dict[str, float]]:
    """The campaign of a plan without noise, the noise it should have, and the true values."""
    plan = Plan.model_validate_json(text)
    setup = set_up(plan, "plan")
    return run_plan(plan.model_copy(update={"noise": {}})), dict(setup.noise), dict(setup.values)


def noisy(text: str, seed: int) -> Campaign:
    """The same with noise."""
    campaign, settings, _ = clean(text)
    rng = np.random.default_rng([SEED, seed])
    measurements = tuple(
        replace(m, outputs={name: y + noise(y, rng, **settings[name]) for name, y in m.outputs.items()})
        for m in campaign.measurements
    )
    return replace(campaign, measurements=measurements)


def estimates(
    campaign: Campaign, model: Model, truth: dict[str, float], choices: list[list[str]], steps: list[int | None]
) -> list[list[float]]:
    """Estimates of the dynamic parameters from each choice of tests, beside the same calibration tests.

    ``steps`` per choice are found with the first campaign and kept for the others.
    """
    settings = Settings(jobs=1, seed=SEED)
    space = ParameterSpace(model.parameters)
    stages, _ = calibrate(model, campaign, space, seed=SEED, jobs=1)
    start = space.to_unit(np.array([truth[name] for name in space.names]))[None]
    found = []
    for place, tests in enumerate(choices):
        problem = main_problem(model, campaign.select(tests), space, stages, settings)
        local, steps[place] = local_problem(problem, start, steps[place])
        first = merge(refine(local.evaluate, start))[0].point
        counted = local.with_noise_at(first)
        point = merge(refine(counted.evaluate, first[None]))[0].point
        # as sampled: the likelihood as wide as the noise asks, so that the priors of the stages weigh in rightly
        wide = spread_problem(counted, point)
        moved = merge(refine(wide.evaluate, point[None]))[0].point
        values = space.from_unit(moved)
        found.append([float(values[space.index(name)]) for name in DYNAMIC])
    return found


def local_problem(problem: Problem, start: Array, steps: int | None) -> tuple[Problem, int | None]:
    """Integrated for the neighbourhood of the truth; the number of steps that its rule asks for, all repeats share."""
    if steps is not None:
        return replace(
            problem, simulator=Simulator(problem.system, problem.drives, problem.space.names, steps=steps)
        ), steps
    near = problem.near(start, np.full(len(start[0]), 0.01))
    rungs = [rung for rule in near.simulator.rules for rung in rule.rungs if rung.scheme is RK4]
    return near, max((rung.steps for rung in rungs), default=None)


def rows(work: Path, text: str, label: str, choices: list[list[str]], first: int) -> list[list[list[float]]]:
    """Estimates of `CHUNK` repeats, (repeat, choice, parameter); kept in the work folder."""
    path = work / f"{label}-{first}.json"
    if path.exists():
        kept = json.loads(path.read_text())
        if kept["plan"] == text and kept["choices"] == choices:
            return kept["estimates"]
    _, _, truth = clean(text)
    model = find_model("maxwell_tyre")
    steps: list[int | None] = [None] * len(choices)
    found = [estimates(noisy(text, seed), model, truth, choices, steps) for seed in range(first, first + CHUNK)]
    path.write_text(json.dumps({"plan": text, "choices": choices, "estimates": found}))
    return found


def simulated(arguments: argparse.Namespace, plan: Plan, label: str, choices: list[list[str]]) -> Array:
    """Estimates (repeats, choices, 3)."""
    starts = range(0, arguments.repeats, CHUNK)
    task = partial(rows, arguments.work, plan.model_dump_json(), label, choices)
    if arguments.jobs == 1:
        return np.concatenate([np.array(task(first)) for first in starts])
    with ProcessPoolExecutor(arguments.jobs) as pool:
        return np.concatenate([np.array(found) for found in pool.map(task, starts)])
