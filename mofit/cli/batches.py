"""The command on many campaigns: batch."""

from __future__ import annotations

import os
from pathlib import Path

from mofit.cli.app import DONE, NOT_CONVERGED, UNUSABLE, Json, app, print_json


@app.command
def batch(
    *places: Path,
    what: str = "identify",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    search: str = "niching",
    bounds: tuple[str, ...] = (),
    fix: tuple[str, ...] = (),
    joint: bool = False,
    seed: int = 0,
    out: Path = Path("runs/batch"),
    jobs: int | None = None,
    scheduler: str | None = None,
    as_json: Json = False,
) -> int:
    """Identify or diagnose every campaign of some folders; called again, it goes on where it was interrupted.

    Example: mofit batch campaigns/ --out runs/loads --jobs 2

    Parameters
    ----------
    places
        Folders of campaigns (files that end in .nc, .h5 or .hdf5), or campaigns.
    what
        identify or diagnose.
    model
        Name of a shipped model, or path/to/file.py:Name. Found from the channels if left out.
    effect
        Effect to add to the model, or (diagnose) to consider: a shipped name, or path/to/file.py:Name; repeatable.
    search
        As of identify.
    bounds
        Other bounds for a parameter, NAME=LOWER:UPPER in SI units; repeatable.
    fix
        Hold a parameter, NAME=VALUE in SI units; repeatable.
    joint
        Identify calibration and dynamic parameters at once.
    seed
        Seed of every random draw.
    out
        Folder for the runs, table.csv and batch.html.
    jobs
        Processes on this machine, one campaign each; all cores by default.
    scheduler
        Address of a Dask scheduler, tcp://host:port, whose workers do the work; they must see the same files.
    """
    from mofit.batch import BatchJob, run_batch
    from mofit.options import by_name, range_by_name
    from mofit.settings import Settings
    from mofit.terminal import progress_bar

    settings = Settings(
        search=search, bounds=range_by_name("--bounds", bounds), fixed=by_name("--fix", fix), joint=joint, seed=seed
    )
    job = BatchJob(places, out, what, model, effect, settings, jobs or os.cpu_count() or 1, scheduler)
    with progress_bar() as progress:
        rows = run_batch(job, progress)
    states = [row.state for row in rows]
    if as_json:
        print_json({
            "out": str(out),
            "campaigns": [
                {"name": row.name, "state": row.state, "message": row.message, **row.summary} for row in rows
            ],
        })  # fmt: skip
    else:
        for row in rows:
            print(f"{row.name}: {row.state}{f' ({row.message})' if row.message else ''}")
        print(f"{states.count('done')} of {len(rows)} done; page: {out / 'batch.html'}")
    if "failed" in states:
        return UNUSABLE
    return NOT_CONVERGED if "not converged" in states else DONE
