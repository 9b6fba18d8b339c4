"""What ``mofit compare`` does: expected uncertainty and identifiability of parameters, information of tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.experimental_design.augmentation import CANDIDATES, cheapest_augmentation
from mofit.experimental_design.comparison_result import (
    Comparison,
    ExperimentResult,
    ExperimentSet,
    InformationShare,
    ParameterResult,
)
from mofit.experimental_design.expected_profiles import (
    INTERVAL_WIDTH,
    ExpectedData,
    ProfileInterval,
    expected_data,
    expected_profiles,
)
from mofit.experimental_design.identifiability import (
    BOX_PRECISION,
    COMBINATION,
    IDENTIFIABLE,
    NOT,
    ONE_SIDED,
    VERDICTS,
    Identifiability,
    condition_indices,
    correlated_parameters,
    identifiability,
    is_identifiable,
    relative_size,
)
from mofit.experimental_design.information import SourceInformation
from mofit.experimental_design.prepare import Inputs, prepare, with_simulators
from mofit.experimental_design.simulated_identification import simulated_campaign, simulated_estimates
from mofit.experimental_design.simulations_needed import kept_for_later, simulations_needed
from mofit.experimental_design.sources import Source
from mofit.experimental_design.text import share_sentence, verdict_sentence
from mofit.identification.settings import Settings
from mofit.runtime.progress import Progress, silent

#: Name of the experiment of all tests of a file.
ALL = "all"
#: What is said of experiments whose profiles the limit of simulations left out.
NO_PROFILES = (
    "too few simulations were left for profiles: verdicts rest on the slopes at the reference values alone. "
    "Allow more (--simulations), or name one experiment with --group."
)
#: Duration that experiments of different lengths are compared at [s].
_MINUTE = 60


def compare_files(
    inputs: Inputs,
    required: Sequence[str] = (),
    groups: Mapping[str, Sequence[str]] | None = None,
    posterior: int = 0,
    progress: Progress = silent,
) -> Comparison:
    """Read and compare; look for the cheapest augmentation for required parameters that are not identifiable.

    Parameters
    ----------
    inputs
        Files and options.
    required
        Parameters to be shown and identified; by default those that no calibration stage estimates are shown.
    groups
        Experiments by name, and the tests of each; see `experiments_of`.
    posterior
        Of so many experiments, the best first, simulated data are identified.
    progress
        Reports what is being done.

    Raises
    ------
    InputError
        With what is wrong with files and options.
    """
    if posterior < 0:
        raise InputError.of(f"--posterior {posterior}", "is below 0", "Give a number of experiments")
    groups = groups or {}
    progress("read", 0, len(inputs.files), "")
    with with_simulators(inputs) as counted:
        return _compared(counted, required, groups, posterior, progress)


def _compared(
    inputs: Inputs, required: Sequence[str], groups: Mapping[str, Sequence[str]], posterior: int, progress: Progress
) -> Comparison:
    """The steps of a comparison, in order."""
    named = tuple(dict.fromkeys(test for tests in groups.values() for test in tests))
    prepared = prepare(inputs, named)
    experiments = experiments_of([each.source for each in prepared], groups)
    model = prepared[0].source.model
    later = posterior * max(len(row.tests) for row in experiments)
    later += CANDIDATES + simulations_needed(model, CANDIDATES, 1) if required else 0
    with kept_for_later(model, later):
        sources = [each.information() for each in prepared]
        found = compare(sources, experiments, required, jobs=inputs.jobs, progress=progress)
    augmentations = {}
    for name in found.not_identifiable:
        best = found.best(name).experiment
        augmentations[name] = cheapest_augmentation(sources[best.source], best.tests, name, inputs.jobs)
    ranked = sorted(
        found.experiments,
        key=lambda row: float(np.mean([np.log(own.relative_sd) for own in row.parameters.values()])),
    )
    simulated, settings = {}, Settings(seed=inputs.seed, jobs=inputs.jobs, simulations=inputs.simulations)
    for number, row in enumerate(ranked[:posterior]):
        name, tests, known = row.experiment.name, row.experiment.tests, sources[row.experiment.source]
        progress("posterior", number, posterior, name)
        campaign = simulated_campaign(known, tests, inputs.seed)
        simulated[name] = simulated_estimates(campaign, known.source.model, tests, settings, found.parameters)
    return replace(found, augmentations=augmentations, simulated=simulated)


def experiments_of(sources: Sequence[Source], groups: Mapping[str, Sequence[str]]) -> tuple[ExperimentSet, ...]:
    """What is compared: the groups named, else the files if there are several, else every test alone and all.

    Raises
    ------
    InputError
        If a group's tests are not in one file, or a file has no test for the main identification.
    """
    if groups:
        return tuple(_group(name, tests, sources) for name, tests in groups.items())
    raise_errors(
        Issue(f"'{source.name}'", f"no test is left for model '{source.model.name}'", "Name some with --group")
        for source in sources
        if not source.main
    )
    every = [tuple(test.name for test in source.main) for source in sources]
    if len(sources) > 1:
        return tuple(ExperimentSet(source.name, i, every[i]) for i, source in enumerate(sources))
    alone = tuple(ExperimentSet(test, 0, (test,)) for test in every[0])
    return (*alone, ExperimentSet(ALL, 0, every[0])) if len(alone) > 1 else alone


def _group(name: str, tests: Sequence[str], sources: Sequence[Source]) -> ExperimentSet:
    for place, source in enumerate(sources):
        if set(tests) <= {test.name for test in source.main}:
            return ExperimentSet(name, place, tuple(tests))
    known = sorted({test.name for source in sources for test in source.main})
    missing = next((test for test in tests if test not in known), None)
    if missing is None:
        raise InputError.of(f"--group {name}", "its tests are in different files", "Name tests of one file")
    raise InputError.of(f"--group {name}", f"no test '{missing}'", did_you_mean(missing, known))


def compare(
    sources: Sequence[SourceInformation],
    experiments: Sequence[ExperimentSet],
    required: Sequence[str] = (),
    *,
    jobs: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Compare experiments, with profiles at the first parameter sample; see `compare_files`.

    Raises
    ------
    InputError
        For parameters that the model does not have.
    """
    model, names = sources[0].source.model, sources[0].source.space.names
    raise_errors(
        Issue(f"--parameter {name}", f"model '{model.name}' has no such parameter", did_you_mean(name, names))
        for name in required
        if name not in names
    )
    calibrated = {name for each in sources for name in each.source.calibrated}
    shown = tuple(required) or tuple(name for name in names if name not in calibrated) or names
    data: dict[int, ExpectedData] = {}
    rows, without = list[ExperimentResult](), list[str]()
    for number, experiment in enumerate(experiments):
        progress("compare", number, len(experiments), experiment.name)
        known = sources[experiment.source]
        found = identifiability(known.precision(experiment.tests), known.samples, known.source.space)
        profiles: list[ProfileInterval | None] = [None] * len(names)
        doubtful = any(found.verdict(names.index(name)) != IDENTIFIABLE for name in shown)
        if doubtful and np.isfinite(found.sd[0]).all():
            if experiment.source not in data:
                data[experiment.source] = expected_data(known, jobs)
            traced = expected_profiles(data[experiment.source], experiment.tests, found)
            without += [experiment.name] if traced is None else []
            profiles = profiles if traced is None else [*traced]
        rows.append(_result(known, experiment, found, shown, profiles))
    shares = tuple(_shares(sources[e.source], e, shown) for e in experiments if len(e.tests) > 1)
    notes = [note for each in sources for note in each.source.notes]
    notes += [share_sentence(each, k, name) for each in shares for k, name in enumerate(shown)]
    notes += [f"{', '.join(without)}: {NO_PROFILES}"] if without else []
    return Comparison(shown, tuple(required), tuple(sources), tuple(rows), shares, tuple(dict.fromkeys(notes)))


def _result(
    known: SourceInformation,
    experiment: ExperimentSet,
    found: Identifiability,
    shown: Sequence[str],
    profiles: Sequence[ProfileInterval | None],
) -> ExperimentResult:
    source = known.source
    space, values, derivative = source.space, known.samples[:1], known.derivative[0]
    seconds = sum(test.seconds for test in source.main if test.name in experiment.tests)
    bound = identifiability(known.fisher(experiment.tests)[:1], values, space)
    minute = identifiability(known.precision(experiment.tests, _MINUTE / seconds)[:1], values, space)
    usable = found.verdicts[:, 0] >= 0
    sizes = relative_size(space, values)[0]
    results = {}
    for name in shown:
        k = space.index(name)
        verdict = _confirmed(found.verdict(k), profiles[k], float(sizes[k]))
        others: list[str] = []
        if verdict == COMBINATION:
            others = [space.names[j] for j in correlated_parameters(found.covariance[0], k, float(sizes[k]))]
        relative = found.relative_sd[usable, k]
        median = float(np.median(relative))
        own = found.verdicts[usable, k]
        profile = profiles[k]
        sd_at_values = float(found.sd[0, k] * derivative[k])
        if profile is not None and profile.closed == 2:
            sd_at_values = (profile.high - profile.low) / INTERVAL_WIDTH
        results[name] = ParameterResult(
            parameter=name,
            verdict=verdict,
            sd=float(np.median((found.sd * known.derivative)[usable, k])),
            relative_sd=median,
            sd_at_values=sd_at_values,
            relative_sd_range=(float(np.min(relative)), float(np.max(relative))),
            relative_sd_after_60_s=float(minute.relative_sd[0, k]),
            bound_sd=float(bound.sd[0, k] * derivative[k]),
            conditional_sd=float(found.conditional_sd[0, k] * derivative[k]),
            variance_inflation=float(found.variance_inflation[0, k]),
            verdicts={VERDICTS[place]: int(np.sum(own == place)) for place in np.unique(own)},
            correlated_with=tuple(others),
            profile=profile,
            sentence=verdict_sentence(name, verdict, median, profile, others, found.covariance[0], values[0], space),
        )
    places = [k for k, name in enumerate(space.names) if name not in source.calibrated] or list(range(len(space)))
    inner = np.linalg.inv(found.covariance[0][np.ix_(places, places)])
    return ExperimentResult(experiment, seconds, results, found.covariance[0], float(condition_indices(inner)[-1]))


def _confirmed(verdict: str, profile: ProfileInterval | None, size: float) -> str:
    """The verdict after the profile; a profile sees curvature that derivatives miss."""
    if verdict in (IDENTIFIABLE, COMBINATION) or profile is None:
        return verdict
    if profile.closed == 1:
        return ONE_SIDED
    half = np.asarray(profile.width / INTERVAL_WIDTH)
    return IDENTIFIABLE if profile.closed == 2 and bool(is_identifiable(half, np.asarray(size))) else NOT


def _shares(known: SourceInformation, experiment: ExperimentSet, shown: Sequence[str]) -> InformationShare:
    r"""Shares of the tests in the precision of every parameter, and the standard deviations without each of them.

    With the Fisher information :math:`M = \sum_t F_t + P` and :math:`c = M^{-1} e_i`, the precision of parameter i is
    :math:`\sum_t c^T F_t c / c_i^2 + \dots`: a sum over tests that leaves out what other parameters can explain.
    """
    source, values = known.source, known.samples[:1]
    index = [i for i, test in enumerate(source.tests) if test.group == 0 and test.name in experiment.tests]
    places = [source.space.index(name) for name in shown]
    total = known.fisher(experiment.tests)[0] + BOX_PRECISION * np.eye(len(source.space))
    columns = np.linalg.inv(total)[:, places]
    diagonal = columns[places, range(len(places))]
    share = np.einsum("ip,tij,jp->tp", columns, known.tests.fisher[index, 0], columns) / diagonal
    calibration = np.einsum("ip,ij,jp->p", columns, known.fisher(())[0], columns) / diagonal
    names = tuple(source.tests[i].name for i in index)

    def sd(tests: Sequence[str]) -> np.ndarray:
        return identifiability(known.precision(tests)[:1], values, source.space).sd[0, places]

    without = np.array([sd([other for other in names if other != name]) for name in names])
    return InformationShare(experiment.name, names, share, calibration, without / sd(experiment.tests))
