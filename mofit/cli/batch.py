"""The command on many campaigns: batch."""

from __future__ import annotations

from pathlib import Path

from mofit.cli.app import DONE, NOT_CONVERGED, UNUSABLE, app, print_json
from mofit.cli.options import Bounds, Fixed, Joint, Json, ModelName, Search, Seed, by_name, cores, range_by_name
from mofit.identification.search_registry import DEFAULT_SEARCH


@app.command
def batch(
    *places: Path,
    what: str = "identify",
    model: ModelName = None,
    effect: tuple[str, ...] = (),
    search: Search = DEFAULT_SEARCH,
    bounds: Bounds = (),
    fix: Fixed = (),
    joint: Joint = False,
    seed: Seed = 0,
    out: Path = Path("runs/batch"),
    jobs: int | None = None,
    scheduler: str | None = None,
    as_json: Json = False,
) -> int:
    """Identify or diagnose every campaign of some folders; called again, it resumes.

    Example: mofit batch campaigns/ --out runs/loads --jobs 2

    Parameters
    ----------
    places
        Folders of campaigns (files that end in .nc, .h5 or .hdf5), or campaigns.
    what
        What to do with each campaign: identify or diagnose.
    effect
        Effect to add to the model, or (diagnose) to consider: a shipped name, or path/to/file.py:Name; repeatable.
    out
        Folder for the runs, table.csv and batch.html.
    jobs
        Processes on this machine, one campaign each. By default one per core.
    scheduler
        Address of a Dask scheduler, tcp://host:port, whose workers do the work; they must see the same files.
    """
    from mofit.cli.output import progress_bar
    from mofit.identification.settings import Settings
    from mofit.workflows.batch import BatchJob, run_batch

    settings = Settings(
        search=search, bounds=range_by_name("--bounds", bounds), fixed=by_name("--fix", fix), joint=joint, seed=seed
    )
    job = BatchJob(places, out, what, model, effect, settings, cores(jobs), scheduler)
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
