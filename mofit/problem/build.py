"""An identification problem from a model and the tests of a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from mofit.data import Campaign
from mofit.data.repeats import repeated, with_repeats
from mofit.models import Model, build_system
from mofit.parameters import ParameterLayout, ParameterSpace
from mofit.problem.objectives import first_noise
from mofit.problem.prior import FLAT, GaussianPrior
from mofit.problem.problem import TOLERANCE, Problem
from mofit.runtime.parallel import shared_map
from mofit.simulation import ExperimentData, Simulator, experiment_data, require
from mofit.simulation.requirements import analysed
from mofit.simulation.scoped_simulator import ScopedSimulator
from mofit.simulation.scopes import Scopes, scoped


def build_problem(
    model: Model,
    campaign: Campaign,
    *,
    space: ParameterSpace | None = None,
    fixed: Mapping[str, float] | None = None,
    prior: GaussianPrior = FLAT,
    settled: bool = False,
    leads: Mapping[str, float] = MappingProxyType({}),
    known: Sequence[ExperimentData] = (),
    jobs: int = 1,
) -> Problem:
    """Join a model and the tests of a campaign.

    Parameters
    ----------
    model
        Its channels and conditions are looked up in every test.
    campaign
        All of its tests are used.
    space
        Free parameters, each with its scope; all of the model's if not given.
    fixed
        Values of parameters that are not free; nominal if not given.
    prior
        Knowledge from earlier stages.
    settled
        Use only the samples after each test's transient, periodic or not.
    leads
        Time that the periodic inputs of tests act on the model before the first sample, s.
    known
        Tests of another problem on the campaign: those that this one sees alike are in memory once.
    jobs
        Threads; results do not depend on it.

    Raises
    ------
    InputError
        With every channel and condition that a test lacks; of several outputs it may lack some.
    """
    system = build_system(model)
    require(model, campaign)
    shared, own = scoped(ParameterSpace(model.parameters) if space is None else space)
    layout = ParameterLayout.of_model(model.parameters, shared, fixed)
    tests = campaign.measurements
    alone = shared_map(partial(analysed, model), tests, lambda test: test.name)
    repeats = repeated(tests)
    found = zip(tests, with_repeats(tests, alone, repeats), strict=True)
    signals = tuple(replace(analysis, lead=leads.get(test.name, 0.0)) for test, analysis in found)
    experiments = tuple(
        _known(experiment_data(model, measurement, analysis, settled), known)
        for measurement, analysis in zip(tests, signals, strict=True)
    )
    make = partial(ScopedSimulator, scopes=Scopes.of(own, tests)) if own.names else Simulator
    simulated = [name for name in shared.names if name in system.parameters]  # means and spreads are of none
    simulator = make(system, experiments, simulated, jobs=jobs, tolerance=TOLERANCE, box=layout.box())
    return Problem(
        model=model,
        system=system,
        measurements=tuple(tests),
        signals=signals,
        layout=layout,
        simulator=simulator,
        experiments=experiments,
        noise=replace(first_noise(model, tests, signals, experiments), absorbed=simulator.absorbed),
        prior=prior,
        repeats=tuple(tuple(tests[k].name for k in group) for group in repeats),
    )


def _known(experiment: ExperimentData, known: Sequence[ExperimentData]) -> ExperimentData:
    """The one of the known tests that holds the same; else what is measured may be that of one with other inputs."""
    for one in known:
        if one.same_data(experiment):
            return one
        if one.same_record(experiment):
            return replace(experiment, measured=one.measured, weights=one.weights)
    return experiment
