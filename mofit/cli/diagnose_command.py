"""The command that diagnoses the gap between measured and simulated."""

from __future__ import annotations

import os
from pathlib import Path

from mofit.cli.app import DONE, Jobs, Json, app, print_json


@app.command
def diagnose(
    file: Path | None = None,
    /,
    *,
    model: str | None = None,
    effects: tuple[str, ...] = (),
    test: tuple[str, ...] = (),
    bounds: tuple[str, ...] = (),
    fix: tuple[str, ...] = (),
    seed: int = 0,
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
    model
        Name of a shipped model, or path/to/file.py:Name. Found from the channels if left out.
    effects
        Candidate: a shipped name (then only those named are tried), or path/to/file.py:Name, which joins the others;
        repeatable. All shipped effects that fit by default.
    test
        Use only the test of this name; repeatable.
    bounds
        Other bounds for a parameter, NAME=LOWER:UPPER in SI units; repeatable.
    fix
        Hold a parameter, NAME=VALUE in SI units; repeatable.
    seed
        Seed of every random draw.
    out
        Folder for diagnosis.html and diagnosis.json; by default the next free one under runs/.
    """
    from mofit.job import diagnose_file
    from mofit.options import by_name, range_by_name
    from mofit.settings import Settings
    from mofit.terminal import progress_bar

    settings = Settings(
        bounds=range_by_name("--bounds", bounds),
        fixed=by_name("--fix", fix),
        seed=seed,
        jobs=jobs or os.cpu_count() or 1,
    )
    with progress_bar() as progress:
        folder, found = diagnose_file(file, model, effects, test, settings, out, progress)
    if as_json:
        print_json({**found, "folder": str(folder)})
    else:
        from mofit.terminal import show_diagnosis

        show_diagnosis(found, folder)
    return DONE
