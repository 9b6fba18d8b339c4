"""From a campaign file to a finished folder: the work of ``mofit identify`` and ``mofit diagnose``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mofit.data import Campaign, bundled_campaign, joined, read_campaign
from mofit.errors import InputError
from mofit.identification.identify import Settings, identify
from mofit.models import Model, default_model, find_effect, find_model, with_effects
from mofit.quantities import EXCITATION_KINDS
from mofit.results import summary
from mofit.runtime.progress import Progress, silent
from mofit.runtime.run_directory import run_folder
from mofit.simulation.requirements import stated_conditions

#: Relative difference between a frequency that a user writes and that of a test.
FREQUENCY_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Job:
    """An identification or a diagnosis in a user's words."""

    file: Path | None = None
    """Campaign file; None means the bundled campaign."""
    model: str | None = None
    effects: tuple[str, ...] = ()
    """Names of shipped ones or ``path/to/file.py:Name``; without a model, the campaign's channels decide. A diagnosis
    takes the effects as candidates."""
    frequencies: tuple[float, ...] = ()
    tests: tuple[str, ...] = ()
    """Frequencies (Hz) and names of the tests to use; all that the model can use where both are empty."""
    settings: Settings = field(default_factory=Settings)
    """Settings of the identification."""
    out: Path | None = None
    """Folder to write; None means the next free one under ``runs/``."""
    resume: bool = False
    """Resume an interrupted identification."""
    hold_out: tuple[str, ...] = ()
    """Tests that are not used, but predicted."""
    included: tuple[str, ...] = ()
    """Effects that are part of the model that a diagnosis takes."""
    more: tuple[Path, ...] = ()
    """More campaign files: the tests of all are one campaign, each under the conditions of its own."""


def identify_file(job: Job, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """Read, identify, write the run folder and its report; returns the folder and what ``--json`` prints."""
    campaign, chosen = _inputs(job, progress)
    model = _with_effects(chosen, job.effects, campaign)
    tests = _tests(campaign, model, job)
    folder, tree = identify(
        campaign, model, job.settings, tests=tests, hold_out=job.hold_out, out=job.out, resume=job.resume,
        progress=progress,
    )  # fmt: skip
    return folder, summary(tree, folder)


def diagnose_file(job: Job, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """Read, diagnose, write page and ``diagnosis.json``; returns the folder and what ``--json`` prints."""
    from mofit.diagnosis.diagnose import diagnose
    from mofit.diagnosis.page_beside import page_beside
    from mofit.diagnosis.result import summary as plain

    campaign, chosen = _inputs(job, progress)
    model = _with_effects(chosen, job.included, campaign)
    effects, seed = list(job.effects), job.settings.seed
    configuration = {"campaign": campaign.hash(), "model": model.name, "effects": effects, "seed": seed}
    configuration |= {"hold_out": list(job.hold_out)} if job.hold_out else {}
    tests = _tests(campaign, model, job)
    place = run_folder(job.out, f"diagnosis-{model.name}", configuration, resumable=False)
    with place as folder, page_beside() as drawn:
        found = diagnose(campaign, model, effects, job.settings, tests=tests, hold_out=job.hold_out, progress=progress)
        progress("write", 0, 1, "page")
        drawn(found, folder.partial)
    return folder.target, plain(found)


def _with_effects(model: Model, names: Sequence[str], campaign: Campaign) -> Model:
    """The model with effects as the campaign's conditions ask for them."""
    stated = stated_conditions(campaign)
    return with_effects(model, *(find_effect(name).for_tests(stated) for name in names))


def _inputs(job: Job, progress: Progress) -> tuple[Campaign, Model]:
    """Campaign and model, without effects; by default the model that fits the campaign's channels."""
    if job.file is None:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    files = [bundled_campaign() if job.file is None else job.file, *job.more]
    campaign = joined([read_campaign(file) for file in files], [file.stem for file in files])
    if job.model:
        return campaign, find_model(job.model)
    return campaign, default_model(name for m in campaign.measurements for name in (*m.experiment.inputs, *m.outputs))


def _tests(campaign: Campaign, model: Model, job: Job) -> tuple[str, ...]:
    """Names of the tests of the job's frequencies, and of those it names."""
    labels = {m.name: m.experiment.frequency for m in campaign.measurements if m.experiment.frequency is not None}
    kinds = model.excitations or EXCITATION_KINDS
    tests: list[str] = []
    for frequency in job.frequencies:
        near = [name for name, label in labels.items() if abs(label - frequency) <= FREQUENCY_TOLERANCE * frequency]
        found = [name for name in near if campaign[name].kind in kinds]
        if not found:
            hint = f"The campaign has {', '.join(f'{label:g}' for label in sorted(set(labels.values())))} Hz"
            raise InputError.of(f"--freq {frequency:g}", "no test has this frequency", hint)
        tests += found
    campaign.select(job.tests)
    return tuple(dict.fromkeys([*tests, *job.tests]))
