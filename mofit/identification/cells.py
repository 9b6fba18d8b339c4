"""Every combination of conditions identified alone: here one after the other, or on the workers of a Dask cluster."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.errors import InputError
from mofit.identification.result import Located
from mofit.identification.search_registry import DEFAULT_SEARCH
from mofit.identification.settings import Settings
from mofit.identification.stages import locate_minima
from mofit.models import Model
from mofit.parameters import Parameter
from mofit.problem import adjusted_posterior
from mofit.runtime.cluster import on_workers
from mofit.runtime.progress import Progress, silent
from mofit.runtime.sending import Sendable, received, sendable
from mofit.sampling import laplace_covariance
from mofit.simulation.evaluation.evaluations import evaluations_of

#: Most evaluations of the default search for one combination. Its best minimum takes fewer; in the valleys of what it
#: does not determine alone a search spends whatever it has.
EVALUATIONS = 1000


@dataclass(frozen=True)
class Cell:
    """One combination of conditions."""

    name: str
    """As people read it: ``vertical_force = 3000``."""
    campaign: Campaign
    """Its tests, with those of calibration stages."""
    tests: tuple[str, ...]
    """Names of those of the main identification."""


@dataclass(frozen=True)
class CellEstimate:
    """What one combination says alone, of P parameters."""

    values: FloatArray
    """(P,), in SI units."""
    covariance: FloatArray
    """(P, P), of z, see `mofit.identification.law_fit.CellEstimates`."""
    evaluations: int
    """Of the search."""


def identify_cells(
    cells: Sequence[Cell],
    model: Model,
    settings: Settings,
    parameters: Sequence[Parameter],
    progress: Progress = silent,
    until: float = math.inf,
) -> list[CellEstimate]:
    """Identify every combination alone.

    With an address ``settings.dask`` they are identified on the workers of that cluster; the numbers are the same. A
    user's simulator stays here, and its simulations go to the cluster.

    Parameters
    ----------
    cells
        The combinations.
    model, settings
        Of the identification.
    parameters
        Those whose estimates are wanted.
    progress
        Called as each is done.
    until
        As for `mofit.identification.stages.locate_minima`.

    Raises
    ------
    InputError
        If one cannot be identified, or the cluster is lost.
    """
    default = settings.for_model(model).search == DEFAULT_SEARCH
    budget = settings.evaluations or (EVALUATIONS if default else None)
    limit = settings.time_limit and settings.time_limit / len(cells)  # one after the other
    alone = replace(settings, over=(), laws={}, evaluations=budget, time_limit=limit)
    progress("conditions", 0, len(cells), "")
    if settings.dask is None or evaluations_of(model) is not None:
        ended = _here(cells, model, alone, parameters, until)
    else:
        ended = _on_cluster(cells, model, replace(alone, dask=None, jobs=1), parameters, settings.dask, until)
    found: dict[int, CellEstimate] = {}
    for k, estimate in ended:
        found[k] = estimate
        progress("conditions", len(found), len(cells), cells[k].name)
    return [found[k] for k in range(len(cells))]


def identify_cell(
    cell: Cell, model: Model, settings: Settings, parameters: Sequence[Parameter], until: float = math.inf
) -> CellEstimate:
    """Identify one combination: search, refine, Laplace."""
    located = locate_minima(cell.campaign, model, settings, cell.tests, until=until)
    return CellEstimate(*_estimates(located, parameters), located.search.evaluations)


def _estimates(located: Located, parameters: Sequence[Parameter]) -> tuple[FloatArray, FloatArray]:
    """Values (P,) at the best minimum, and the covariance (P, P) of their z.

    The laws take the estimates as normal: the covariance is that of the normal distribution with the posterior's
    intervals.
    """
    posterior, minimum = located.posterior, located.minima[0]
    space = posterior.space
    values = space.from_unit(minimum.point)
    covariance = laplace_covariance(adjusted_posterior(posterior, minimum.point).normal_hessian)
    # what lies at an end of its range may be anywhere near: as wide as the range
    covariance = covariance + np.diag(((minimum.point <= 0) | (minimum.point >= 1)) / 12)
    log = np.array([one.scale == "log" for one in space.parameters])
    width = space.derivative(values) / np.where(log, values, 1.0)
    index = [space.index(one.name) for one in parameters]
    return values[index], (covariance * np.outer(width, width))[np.ix_(index, index)]


def _here(
    cells: Sequence[Cell], model: Model, settings: Settings, parameters: Sequence[Parameter], until: float
) -> Iterator[tuple[int, CellEstimate]]:
    for k, cell in enumerate(cells):
        yield k, identify_cell(cell, model, settings, parameters, until)


def _on_cluster(
    cells: Sequence[Cell],
    model: Model,
    settings: Settings,
    parameters: Sequence[Parameter],
    address: str,
    until: float,
) -> Iterator[tuple[int, CellEstimate]]:
    """The estimates as they come; what a lost worker had to do is repeated by another one."""
    common = sendable((model, settings, tuple(parameters)), "model")
    # clocks of `time.monotonic` differ between machines
    deadline = time.time() + until - time.monotonic()
    tasks = [(sendable(cell, cell.name), common, deadline) for cell in cells]
    for k, answer in on_workers("--dask", address, _received_cell, tasks):
        if answer.lost:
            hint = "Give the workers more memory, or narrow the ranges (--bounds)"
            raise InputError.of(cells[k].name, "worker after worker was lost with it", hint)
        yield k, answer.value()


# one thread of a worker works at a time: what is compiled is kept per process
_alone = threading.Lock()


def _received_cell(task: tuple[Sendable, Sendable, float]) -> CellEstimate:
    """On a worker: identify one combination."""
    cell, common, deadline = task
    with _alone:
        model, settings, parameters = received(common.content)
        until = time.monotonic() + deadline - time.time()
        return identify_cell(received(cell.content), model, settings, parameters, until)
