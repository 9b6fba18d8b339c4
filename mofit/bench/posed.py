"""The bundled campaign as a problem whose noise is known: what the benchmarks of sampling and of whole jobs share."""

from __future__ import annotations

from mofit.bundled import bundled_campaign
from mofit.calibration import calibrate
from mofit.campaign_file import read_campaign
from mofit.library import find_model
from mofit.posing import choose_tests, main_problem
from mofit.problem import Problem
from mofit.refine import Minimum
from mofit.refining import refined
from mofit.settings import Settings, free_space
from mofit.sobol import sobol

MODEL = "maxwell_tyre"
#: A power of two keeps the Sobol points balanced.
STARTS = 16


def pose(seed: int, jobs: int) -> tuple[Problem, Minimum]:
    """All parameters free, calibrations as priors, noise counted at the best minimum; and that minimum."""
    settings = Settings(seed=seed, jobs=jobs)
    campaign, model = read_campaign(bundled_campaign()), find_model(MODEL)
    space = free_space(model, settings)
    calibrations, _ = calibrate(model, campaign, space, seed=seed, jobs=jobs)
    chosen = campaign.select(choose_tests(model, campaign, ()))
    problem = main_problem(model, chosen, space, calibrations, settings)
    assert isinstance(problem, Problem)  # a joint one is for settings.joint
    counted, minima = refined(problem, sobol(len(space), seed).random(STARTS))
    return counted, minima[0]
