"""From a campaign file and names to a finished folder: what ``mofit identify`` and ``mofit diagnose`` do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mofit.bundled import bundled_campaign
from mofit.campaign import Campaign
from mofit.campaign_file import read_campaign
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.identify import Settings, identify
from mofit.library import find_effect, find_model
from mofit.model import Model, with_effects
from mofit.progress import Progress, silent
from mofit.run import plan_folder
from mofit.summary import summary

#: Model taken for a campaign whose channels are these, where none is named.
MODELS_BY_CHANNELS = (
    ({"slip_angle", "lateral_force"}, "maxwell_tyre"),
    ({"displacement", "force"}, "maxwell_damper"),
)
#: A label may be written with fewer digits than it has.
FREQUENCY_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Job:
    """An identification as a user asks for it.

    Parameters
    ----------
    file
        Campaign file; None takes the bundled campaign and says so.
    model, effects
        Names of shipped ones or ``path/to/file.py:Name``; without a model, the campaign's channels decide.
    frequencies, tests
        Frequencies (Hz) and names of the tests to use; all of the model's kinds where both are empty.
    settings
        Settings of the identification.
    out, resume
        As in `mofit.identify.identify`.
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
    if job.file is None:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    campaign = read_campaign(bundled_campaign() if job.file is None else job.file)
    chosen = find_model(job.model) if job.model else model_for(campaign)
    model = with_effects(chosen, *(find_effect(name) for name in job.effects))
    names = (*_tests_at(campaign, model, job.frequencies), *_tests_named(campaign, job.tests))
    tests = tuple(dict.fromkeys(names))
    folder, tree = identify(
        campaign, model, job.settings, tests=tests, out=job.out, resume=job.resume, progress=progress
    )
    return folder, summary(tree, folder)


def diagnose_file(
    file: Path | None,
    model: str | None,
    effects: Sequence[str],
    tests: Sequence[str],
    settings: Settings,
    out: Path | None,
    progress: Progress = silent,
) -> tuple[Path, dict[str, Any]]:
    """Read, diagnose, write ``diagnosis.html`` and ``diagnosis.json`` into a folder; see `diagnose`.

    Returns
    -------
    folder
        The folder: ``out``, or the next free one under ``runs/``.
    summary
        What ``--json`` prints.
    """
    from mofit.diagnosis.diagnose import diagnose
    from mofit.diagnosis.page_data import page_data
    from mofit.diagnosis.summary import summary as plain
    from mofit.report.diagnosis import write_diagnosis

    if file is None:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    campaign = read_campaign(bundled_campaign() if file is None else file)
    chosen = find_model(model) if model else model_for(campaign)
    configuration = {"campaign": campaign.hash(), "model": chosen.name, "effects": list(effects), "seed": settings.seed}
    folder = plan_folder(out, f"diagnosis-{chosen.name}", configuration, resume=False)
    found = diagnose(campaign, chosen, effects, settings, tests=_tests_named(campaign, tuple(tests)), progress=progress)
    with folder.at_work(configuration) as unfinished:
        progress("write", 0, 1, "page")
        write_diagnosis(page_data(found), unfinished)
    return folder.target, plain(found)


def model_for(campaign: Campaign) -> Model:
    """The model that a campaign's channels ask for.

    Raises
    ------
    InputError
        If none is known for them.
    """
    channels = {name for m in campaign.measurements for name in (*m.procedure.inputs, *m.outputs)}
    for needed, name in MODELS_BY_CHANNELS:
        if needed <= channels:
            return find_model(name)
    raise InputError.of(
        f"campaign '{campaign.title}'", f"no model is known for channels {', '.join(sorted(channels))}", "Name --model"
    )


def _tests_at(campaign: Campaign, model: Model, frequencies: Sequence[float]) -> tuple[str, ...]:
    tests: list[str] = []
    for frequency in frequencies:
        found = [
            m.name
            for m in campaign.measurements
            if m.procedure.frequency is not None
            and abs(m.procedure.frequency - frequency) <= FREQUENCY_TOLERANCE * frequency
            and (not model.procedures or m.kind in model.procedures)
        ]
        if not found:
            known = sorted({m.procedure.frequency for m in campaign.measurements if m.procedure.frequency is not None})
            raise InputError.of(
                f"--freq {frequency:g}",
                "no test has this frequency",
                f"The campaign has {', '.join(f'{f:g}' for f in known)} Hz",
            )
        tests += found
    return tuple(tests)


def _tests_named(campaign: Campaign, tests: Sequence[str]) -> Sequence[str]:
    raise_errors(
        Fault(f"--test {name}", "the campaign has no such test", did_you_mean(name, campaign.tests))
        for name in tests
        if name not in campaign.tests
    )
    return tests
