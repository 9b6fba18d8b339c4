"""Repeats of a plan with noise of their own, estimated as `mofit identify` does, for the design study."""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import Model, find_model
from mofit.optimize import merge, refine
from mofit.parameters import ParameterSpace
from mofit.problem import Problem, adjusted_posterior
from mofit.runtime.parallel import end_with_parent
from mofit.simulation import Simulator
from mofit.simulation.integrators import RK4
from mofit.simulation.virtual_rig.plan import Plan
from mofit.simulation.virtual_rig.rig import run_plan
from mofit.simulation.virtual_rig.setup import set_up
from mofit.simulation.virtual_rig.signals import noise

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
    space, stages = ParameterSpace(model.parameters), ()
    start = space.to_unit(np.array([truth[name] for name in space.names]))[None]
    found = []
    for place, tests in enumerate(choices):
        setup = set_up_problem(model, campaign, settings, tests, done=stages)
        problem, stages = setup.posterior.main, setup.calibrations
        local, steps[place] = local_problem(problem, start, steps[place])
        first = merge(refine(local.evaluate, start))[0].point
        counted = local.with_noise_at(first)
        point = merge(refine(counted.evaluate, first[None]))[0].point
        # as sampled: the likelihood as wide as the noise asks, so that the priors of the stages weigh in rightly
        wide = adjusted_posterior(counted, point)
        moved = merge(refine(wide.evaluate, point[None]))[0].point
        values = space.from_unit(moved)
        found.append([float(values[space.index(name)]) for name in DYNAMIC])
    return found


def local_problem(problem: Problem, start: FloatArray, steps: int | None) -> tuple[Problem, int | None]:
    """Integrated for the neighbourhood of the truth; the number of steps that its rule asks for, all repeats share."""
    if steps is not None:
        return replace(
            problem, simulator=Simulator(problem.system, problem.experiments, problem.space.names, steps=steps)
        ), steps
    near = problem.near(start, np.full(len(start[0]), 0.01))
    levels = [level for rule in near.simulator.rules for level in rule.levels if level.scheme is RK4]
    return near, max((level.steps for level in levels), default=None)


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


def simulated(arguments: argparse.Namespace, plan: Plan, label: str, choices: list[list[str]]) -> FloatArray:
    """Estimates (repeats, choices, 3)."""
    starts = range(0, arguments.repeats, CHUNK)
    task = partial(rows, arguments.work, plan.model_dump_json(), label, choices)
    if arguments.jobs == 1:
        return np.concatenate([np.array(task(first)) for first in starts])
    with ProcessPoolExecutor(arguments.jobs, initializer=end_with_parent) as pool:
        return np.concatenate([np.array(found) for found in pool.map(task, starts)])
