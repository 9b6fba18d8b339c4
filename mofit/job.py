"""From a campaign file and names to a finished run: what the command ``mofit identify`` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mofit.bundled import bundled_campaign
from mofit.campaign import Campaign
from mofit.campaign_file import read_campaign
from mofit.errors import InputError
from mofit.identify import Settings, identify
from mofit.library import find_effect, find_model
from mofit.model import Model, with_effects
from mofit.progress import Progress, silent
from mofit.result import open_result
from mofit.summary import summary

#: Model taken for a campaign whose channels are these, where none is named.
MODELS_BY_CHANNELS = (
    ({"slip_angle", "lateral_force"}, "maxwell_tyre"),
    ({"displacement", "force"}, "maxwell_damper"),
)
#: A label may be written with fewer digits than it has.
FREQUENCY_TOLERANCE = 1e-3


def identify_file(
    file: Path | None,
    model: str | None,
    effects: Sequence[str],
    frequencies: Sequence[float],
    options: Mapping[str, Any],
    *,
    out: Path | None = None,
    resume: bool = False,
    progress: Progress = silent,
) -> tuple[Path, dict[str, Any]]:
    """Read, identify, write the run folder and its report.

    Parameters
    ----------
    file
        Campaign file; None takes the bundled campaign and says so.
    model, effects
        Names of shipped ones or ``path/to/file.py:Name``; without a model, the campaign's channels decide.
    frequencies
        Frequencies (Hz) of the tests to use; all where empty.
    options
        Fields of `Settings`.
    out, resume, progress
        As in `mofit.identify.identify`.

    Returns
    -------
    folder
        The run's folder.
    summary
        What ``--json`` prints.
    """
    if file is None:
        progress("bundled", 0, 0, "no FILE given: taking the bundled campaign, which is simulated")
    campaign = read_campaign(bundled_campaign() if file is None else file)
    chosen = find_model(model) if model else _model_for(campaign)
    extended = with_effects(chosen, *(find_effect(name) for name in effects))
    tests = _tests_at(campaign, extended, frequencies)
    folder, _ = identify(
        campaign, extended, Settings(**options), tests=tests, out=out, resume=resume, progress=progress
    )
    return folder, summary(open_result(folder), folder)


def _model_for(campaign: Campaign) -> Model:
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
