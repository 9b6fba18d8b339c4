"""From a campaign file to a finished folder: the work of ``mofit identify`` and ``mofit diagnose``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mofit.data import Campaign, bundled_campaign, joined
from mofit.errors import InputError
from mofit.identification.inputs import as_campaign, as_effect, as_model
from mofit.identification.settings import Settings
from mofit.models import Effect, Model, default_model, with_effects
from mofit.quantities import EXCITATION_KINDS
from mofit.runtime.progress import Progress, silent
from mofit.runtime.run_directory import run_folder
from mofit.simulation.requirements import stated_conditions

if TYPE_CHECKING:
    import xarray as xr

    from mofit.diagnosis.page_beside import Draw
    from mofit.diagnosis.result import Diagnosis

#: a campaign or several, or their files
Campaigns = Campaign | str | Path | Sequence[Campaign | str | Path]
#: Relative difference between a frequency that a user writes and that of a test.
FREQUENCY_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Job:
    """An identification or a diagnosis in a user's words."""

    campaign: Campaigns = ()
    """Campaign, or its file; the tests of several are one campaign, each under the conditions of its own. None at all
    means the bundled campaign."""
    model: Model | str | None = None
    effects: tuple[Effect | str, ...] = ()
    """Objects, names of shipped ones or ``path/to/file.py:Name``; without a model, the campaign's channels decide. A
    diagnosis takes the effects as candidates."""
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
    included: tuple[Effect | str, ...] = ()
    """Effects that are part of the model that a diagnosis takes."""


def identified(job: Job, progress: Progress = silent) -> tuple[Path, xr.DataTree]:
    """Read, identify, write the run folder and its report; returns the folder and the result."""
    from mofit.identification.identify import identify

    campaign, chosen = _inputs(job, progress)
    model = _with_effects(chosen, job.effects, campaign)
    return identify(
        campaign, model, job.settings, tests=_tests(campaign, model, job), hold_out=job.hold_out, out=job.out,
        resume=job.resume, progress=progress,
    )  # fmt: skip


def identify_file(job: Job, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """As `identified`; returns the folder and what ``--json`` prints."""
    from mofit.results import summary

    folder, tree = identified(job, progress)
    return folder, summary(tree, folder)


def diagnosed(job: Job, progress: Progress = silent, drawn: Draw | None = None) -> tuple[Path | None, Diagnosis]:
    """Read and diagnose; if it is ``drawn``, see `page_beside`, page and ``diagnosis.json`` are in the folder."""
    from mofit.diagnosis.diagnose import diagnose

    campaign, chosen = _inputs(job, progress)
    model = _with_effects(chosen, job.included, campaign)
    effects, seed, tests = [_named(effect) for effect in job.effects], job.settings.seed, _tests(campaign, model, job)
    run = partial(
        diagnose, campaign, model, job.effects, job.settings, tests=tests, hold_out=job.hold_out, progress=progress
    )
    if drawn is None:
        return None, run()
    configuration = {"campaign": campaign.hash(), "model": model.name, "effects": effects, "seed": seed}
    configuration |= {"hold_out": list(job.hold_out)} if job.hold_out else {}
    with run_folder(job.out, f"diagnosis-{model.name}", configuration, resumable=False) as folder:
        found = run()
        progress("write", 0, 1, "page")
        drawn(found, folder.partial)
    return folder.target, found


def diagnose_file(job: Job, drawn: Draw, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """As `diagnosed`; returns the folder and what ``--json`` prints."""
    from mofit.diagnosis.result import summary as plain

    folder, found = diagnosed(job, progress, drawn)
    assert folder is not None
    return folder, plain(found)


def _named(effect: Effect | str) -> str:
    return effect if isinstance(effect, str) else effect.name


def _with_effects(model: Model, effects: Sequence[Effect | str], campaign: Campaign) -> Model:
    """The model with effects as the campaign's conditions ask for them."""
    stated = stated_conditions(campaign)
    return with_effects(model, *(as_effect(effect).for_tests(stated) for effect in effects))


def _inputs(job: Job, progress: Progress) -> tuple[Campaign, Model]:
    """Campaign and model, without effects; by default the model that fits the campaign's channels."""
    if not job.campaign:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    given = job.campaign or bundled_campaign()
    several = [given] if isinstance(given, Campaign | str | Path) else list(given)
    names = [one.title if isinstance(one, Campaign) else Path(one).stem for one in several]
    campaign = joined([as_campaign(one) for one in several], names)
    if job.model is not None:
        return campaign, as_model(job.model)
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
