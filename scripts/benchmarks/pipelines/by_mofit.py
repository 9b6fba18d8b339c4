"""mofit as its users run it, in a process of its own: from the campaign's file to the sampled modes."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.pipelines.job import MODEL
from mofit.data import bundled_campaign, read_campaign
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import find_model
from mofit.simulation import Simulator
from mofit.simulation.compiler.machine import CACHE_VARIABLE


@dataclass(frozen=True)
class Run:
    """What a run came to.

    Parameters
    ----------
    seconds
        From reading the file to the last mode.
    modes
        Minima that carry posterior weight, each sampled to the stop rule.
    ess
        Least effective number of draws of any parameter in any mode.
    evaluations, in_sampling
        Parameter sets that went through the tests, calibration included, and how many of them by the sampler.
    """

    seconds: float
    modes: int
    ess: float
    evaluations: int
    in_sampling: int


def first_and_later(seed: int, jobs: int) -> tuple[Run, Run]:
    """A run that compiles everything, and one that finds the machine code of the first on disk."""
    with TemporaryDirectory(prefix="mofit_bench_") as folder:
        runs = []
        for _ in range(2):
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                runs.append(pool.submit(_run, seed, jobs, folder).result())
    return runs[0], runs[1]


def _run(seed: int, jobs: int, folder: str) -> Run:
    os.environ[CACHE_VARIABLE] = folder
    with counted_parameter_sets() as counts:
        begin = time.perf_counter()
        modes = find_modes(read_campaign(bundled_campaign()), find_model(MODEL), Settings(seed=seed, jobs=jobs))
        seconds = time.perf_counter() - begin
    chains = [mode.chains for mode in modes]
    ess = min(c.effective_draws for c in chains)
    return Run(seconds, len(modes), ess, sum(counts), sum(c.evaluations for c in chains))


@contextmanager
def counted_parameter_sets() -> Iterator[list[int]]:
    """Parameter sets that any simulator evaluates meanwhile, per call."""
    former = {name: getattr(Simulator, name) for name in ("cost", "gauss_newton")}
    counts: list[int] = []

    def counting(method: Any) -> Any:
        def call(self: Simulator, p: Any) -> Any:
            counts.append(len(np.atleast_2d(p)))
            return method(self, p)

        return call

    for name, method in former.items():
        setattr(Simulator, name, counting(method))
    try:
        yield counts
    finally:
        for name, method in former.items():
            setattr(Simulator, name, method)
