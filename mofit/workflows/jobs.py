"""From a campaign file to a finished folder: the work of ``mofit identify`` and ``mofit diagnose``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mofit.data import Campaign, bundled_campaign, read_campaign
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.identification.identify import Settings, identify
from mofit.models import Model, default_model, find_effect, find_model, with_effects
from mofit.results import summary
from mofit.runtime.progress import Progress, silent
from mofit.runtime.run_directory import plan_folder

#: Relative difference between a frequency that a user writes and that of a test.
FREQUENCY_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Job:
    """An identification or a diagnosis in a user's words.

    Parameters
    ----------
    file
        Campaign file; None means the bundled campaign.
    model, effects
        Names of shipped ones or ``path/to/file.py:Name``; without a model, the campaign's channels decide. A diagnosis
        takes the effects as candidates.
    frequencies, tests
        Frequencies (Hz) and names of the tests to use; all that the model can use where both are empty.
    settings
        Settings of the identification.
    out
        Folder to write; None means the next free one under ``runs/``.
    resume
        Resume an interrupted identification.
    """

    file: Path | None = None
    model: str | None = None
    effects: tuple[str, ...] = ()
    frequencies: tuple[float, ...] = ()
    tests: tuple[str, ...] = ()
    settings: Settings = field(default_factory=Settings)
    out: Path | None = None
    resume: bool = False


def identify_file(job: Job, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """Read, identify, write the run folder and its report.

    Returns
    -------
    folder
        The run's folder.
    summary
        What ``--json`` prints.
    """
    campaign, chosen = _inputs(job, progress)
    model = with_effects(chosen, *(find_effect(name) for name in job.effects))
    tests = _tests(campaign, model, job)
    folder, tree = identify(
        campaign, model, job.settings, tests=tests, out=job.out, resume=job.resume, progress=progress
    )
    return folder, summary(tree, folder)


def diagnose_file(job: Job, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """Read, diagnose, write ``diagnosis.html`` and ``diagnosis.json`` into a folder; see `diagnose`.

    Returns
    -------
    folder
        The folder.
    summary
        What ``--json`` prints.
    """
    from mofit.diagnosis.diagnose import diagnose
    from mofit.diagnosis.pages import write_diagnosis
    from mofit.diagnosis.result import summary as plain

    campaign, model = _inputs(job, progress)
    effects, seed = list(job.effects), job.settings.seed
    configuration = {"campaign": campaign.hash(), "model": model.name, "effects": effects, "seed": seed}
    folder = plan_folder(job.out, f"diagnosis-{model.name}", configuration, resume=False)
    found = diagnose(campaign, model, effects, job.settings, tests=_tests(campaign, model, job), progress=progress)
    with folder.at_work(configuration) as unfinished:
        progress("write", 0, 1, "page")
        write_diagnosis(found, unfinished)
    return folder.target, plain(found)


def model_for(campaign: Campaign) -> Model:
    """The default model for a campaign's channels.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    channels = {name for m in campaign.measurements for name in (*m.experiment.inputs, *m.outputs)}
    return default_model(channels)


def _inputs(job: Job, progress: Progress) -> tuple[Campaign, Model]:
    """Campaign and model, without effects."""
    if job.file is None:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    campaign = read_campaign(bundled_campaign() if job.file is None else job.file)
    return campaign, find_model(job.model) if job.model else model_for(campaign)


def _tests(campaign: Campaign, model: Model, job: Job) -> tuple[str, ...]:
    """Names of the tests of the job's frequencies, and of those it names."""
    tests: list[str] = []
    for frequency in job.frequencies:
        found = [
            m.name
            for m in campaign.measurements
            if m.experiment.frequency is not None
            and abs(m.experiment.frequency - frequency) <= FREQUENCY_TOLERANCE * frequency
            and (not model.excitations or m.kind in model.excitations)
        ]
        if not found:
            known = sorted(
                {m.experiment.frequency for m in campaign.measurements if m.experiment.frequency is not None}
            )
            raise InputError.of(
                f"--freq {frequency:g}",
                "no test has this frequency",
                f"The campaign has {', '.join(f'{f:g}' for f in known)} Hz",
            )
        tests += found
    raise_errors(
        Issue(f"--test {name}", "the campaign has no such test", did_you_mean(name, campaign.tests))
        for name in job.tests
        if name not in campaign.tests
    )
    return tuple(dict.fromkeys([*tests, *job.tests]))
