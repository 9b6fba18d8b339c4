"""The command that diagnoses the gap between measured and simulated."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, app, print_json
from mofit.cli.options import Bounds, Fixed, Jobs, Json, ModelName, Seed, Tests, by_name, cores, range_by_name


@app.command
def diagnose(
    file: Path | None = None,
    /,
    *,
    model: ModelName = None,
    effects: tuple[str, ...] = (),
    test: Tests = (),
    bounds: Bounds = (),
    fix: Fixed = (),
    seed: Seed = 0,
    out: Path | None = None,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Diagnose the gap between a campaign and a model: where it lies, which effect causes it, how far it shrinks.

    Example: mofit diagnose my_campaign.nc --model maxwell_tyre --effects my_effect.py

    Parameters
    ----------
    file
        Campaign file; without one the bundled (simulated) campaign is taken.
    effects
        Candidate: a shipped name (then only those named are tried), or path/to/file.py:Name, which joins the others;
        repeatable. All shipped effects that fit by default.
    out
        Folder for diagnosis.html and diagnosis.json; by default the next free one under runs/.
    """
    from mofit.cli.output import progress_bar
    from mofit.identification.settings import Settings
    from mofit.workflows.jobs import Job, diagnose_file

    settings = Settings(
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        seed=seed,
        jobs=cores(jobs),
    )
    with progress_bar() as progress:
        folder, found = diagnose_file(Job(file, model, effects, (), test, settings, out), progress)
    if as_json:
        print_json({**found, "folder": str(folder)})
    else:
        from mofit.cli.output import show_diagnosis

        show_diagnosis(found, folder)
    return DONE
