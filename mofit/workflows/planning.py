"""What ``mofit compare`` and ``mofit design`` do, as functions of the same names and words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mofit.identification.inputs import as_names
from mofit.runtime.notebook import listener
from mofit.runtime.progress import Progress
from mofit.units import Quantity

if TYPE_CHECKING:
    from mofit.experimental_design.comparison_result import Comparison
    from mofit.experimental_design.design_job import Proposal


def compare(
    *files: str | Path,
    model: str | None = None,
    effects: str | Sequence[str] = (),
    parameters: str | Sequence[str] = (),
    groups: Mapping[str, Sequence[str]] | None = None,
    at: Mapping[str, float] | None = None,
    run: str | Path | None = None,
    samples: int = 16,
    posterior: int = 0,
    seed: int = 0,
    jobs: int = 1,
    simulations: int | None = None,
    timeout: float | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Compare experiments before anything is measured: the expected uncertainty of each parameter, and why.

    Parameters
    ----------
    files
        Campaigns, or plans of `mofit.simulate`. One file: each test, and all together. Several: file against file.
    model, effects
        Names; by default the plan or the channels decide.
    parameters
        Parameters to compare by; by default all that no calibration stage estimates.
    groups
        Experiments of some tests: name and names of its tests.
    at, run
        Reference values in SI units, or the folder of a run whose posterior gives the parameter samples.
    samples, posterior
        Number of parameter samples; number of experiments whose simulated data are identified.
    seed, jobs
        Seed of every random draw; threads.
    simulations, timeout, dask
        Of a simulator of your own: most simulations, 2000 by default; seconds that one may take, 60 by default; the
        address of a Dask scheduler whose workers make them.
    progress
        Called as ``progress(stage, done, total, note)``.

    Returns
    -------
    Comparison
        A notebook shows it as table and figure; `mofit.summary` makes a data frame of it.

    Raises
    ------
    InputError
        If files, names and numbers don't fit together.
    """
    from mofit.experimental_design.comparison import compare_files
    from mofit.experimental_design.prepare import Inputs
    from mofit.workflows.shown_experiments import ShownComparison

    inputs = Inputs(
        tuple(map(Path, files)), model, as_names(effects), at or {}, None if run is None else Path(run), samples, seed,
        jobs, simulations, timeout, dask,
    )  # fmt: skip
    found = compare_files(inputs, as_names(parameters), groups or {}, posterior, listener(progress))
    return ShownComparison.of(found)


def design(
    files: str | Path | Sequence[str | Path],
    *,
    space: str | Path | None = None,
    model: str | None = None,
    effects: str | Sequence[str] = (),
    parameters: str | Sequence[str] = (),
    criterion: str | None = None,
    combination: Mapping[str, float] | None = None,
    discriminate: str | Sequence[str] = (),
    budget: Quantity | None = None,
    robust: str = "mean",
    ignore_existing_tests: bool = False,
    target: Mapping[str, float] | None = None,
    at: Mapping[str, float] | None = None,
    run: str | Path | None = None,
    samples: int = 8,
    seed: int = 0,
    jobs: int = 1,
    simulations: int | None = None,
    timeout: float | None = None,
    dask: str | None = None,
    progress: Progress | None = None,
) -> Proposal:
    """Find the next tests: the most informative on parameters, or between effects, in the time there is.

    Parameters
    ----------
    files
        Campaign, or plan of `mofit.simulate`: the tests that exist, or are planned anyway. Several campaigns count as
        one; the laws of ``run`` over their conditions become part of the model.
    space
        Design space (TOML), see docs/design.md; by default the range that the tests cover.
    parameters, criterion, combination, discriminate, budget, robust, ignore_existing_tests, target
        As the options of ``mofit design``.
    model, effects, at, run, samples, seed, jobs, simulations, timeout, dask, progress
        As for `compare`.

    Returns
    -------
    Proposal
        A notebook shows its tests and what they give; `mofit.summary` makes a data frame of it.

    Raises
    ------
    InputError
        If files, names and numbers don't fit together.
    """
    from mofit.experimental_design.design_job import DesignJob, design_file
    from mofit.experimental_design.prepare import Inputs
    from mofit.workflows.shown_experiments import ShownProposal

    several = [files] if isinstance(files, str | Path) else files
    inputs = Inputs(
        tuple(map(Path, several)), model, as_names(effects), at or {}, None if run is None else Path(run), samples,
        seed, jobs, simulations, timeout, dask,
    )  # fmt: skip
    job = DesignJob(
        inputs, None if space is None else Path(space), as_names(parameters), criterion, combination or {},
        as_names(discriminate), budget, robust, ignore_existing_tests, target or {},
    )  # fmt: skip
    return ShownProposal.of(design_file(job, listener(progress)))
