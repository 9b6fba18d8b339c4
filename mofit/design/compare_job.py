"""What the command ``mofit compare`` does: read the files, compute, return a result that is ready to be reported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mofit.design.augmentation import cheapest_augmentation
from mofit.design.comparison import compare, experiments_of
from mofit.design.comparison_result import Comparison
from mofit.design.prepare import Inputs, prepare
from mofit.design.simulated_identification import simulated_campaign, simulated_estimates
from mofit.identification.settings import Settings
from mofit.runtime.progress import Progress, silent


@dataclass(frozen=True)
class CompareJob:
    """A comparison as a user asks for it.

    Parameters
    ----------
    inputs
        Files and options.
    parameters
        Those required; by default all that no calibration stage estimates.
    groups
        Experiments by name, and the tests of each.
    posterior
        Of so many experiments, the best first, simulated data are identified.
    """

    inputs: Inputs
    parameters: tuple[str, ...] = ()
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    posterior: int = 0


def compare_files(job: CompareJob, progress: Progress = silent) -> Comparison:
    """Read, compare, and look for the cheapest augmentation for every required parameter that is not identifiable.

    Raises
    ------
    InputError
        With what is wrong with files and options.
    """
    inputs = job.inputs
    progress("read", 0, len(inputs.files), "")
    named = tuple(dict.fromkeys(test for tests in job.groups.values() for test in tests))
    prepared = prepare(inputs, named)
    experiments = experiments_of([each.source for each in prepared], job.groups)
    sources = [each.information() for each in prepared]
    found = compare(sources, experiments, job.parameters, jobs=inputs.jobs, progress=progress)
    augmentations = {}
    for name in found.not_identifiable:
        best = found.best(name).experiment
        augmentations[name] = cheapest_augmentation(sources[best.source], best.tests, name, inputs.jobs)
    ranked = sorted(
        found.experiments,
        key=lambda row: float(np.mean([np.log(own.relative_sd) for own in row.parameters.values()])),
    )
    simulated, settings = {}, Settings(seed=inputs.seed, jobs=inputs.jobs)
    for number, row in enumerate(ranked[: job.posterior]):
        name, tests, known = row.experiment.name, row.experiment.tests, sources[row.experiment.source]
        progress("posterior", number, job.posterior, name)
        campaign = simulated_campaign(known, tests, inputs.seed)
        simulated[name] = simulated_estimates(campaign, known.source.model, tests, settings, found.parameters)
    return replace(found, augmentations=augmentations, simulated=simulated)
