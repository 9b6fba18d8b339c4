"""A small identification that mofit and its peers all run to the end, each with its own simulator.

Half a second of one sine test and two free parameters, on one core; with two seconds and the paper's Maxwell damper
free as well, a single peer takes more than an hour. The peers' searches and samplers are those of the benchmark
`pipeline`, where the whole job would take them hours.
"""

from __future__ import annotations

import platform
import time
from functools import partial
from typing import Any

from benchmarks.pipeline import EXPLAINED, PEERS
from benchmarks.pipelines import small
from benchmarks.pipelines.job import MODEL, Job, Recorded
from benchmarks.pipelines.peer import Peer, distinct_minima
from benchmarks.rows import KeptRows
from studies.report_page import versions

#: Effective draws of every parameter at which a peer stops.
TARGET = 400.0
_LIBRARIES = ("numpy", "scipy", "emcee", "pypesto", "jax", "diffrax", "numpyro", "pints")


def run(seed: int = 0) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All pipelines; what is finished is kept, so an interrupted run resumes.

    Returns
    -------
    rows
        One per pipeline: ``minima``, ``ess``, ``evaluations`` and how many of them ``in_sampling``, ``seconds`` in all
        and ``in_search``, ``times_mofit``; or ``skipped`` with the reason.
    settings
        What they were run with, and how each of them works.
    """
    rows = KeptRows("small_pipeline", {"seed": seed})
    rows.add({"name": "mofit"}, partial(_mofit, seed))
    job = small.job(seed)
    for peer in PEERS:
        rows.add({"name": peer.name}, partial(peer_row, peer, job, seed, rows.rows[0]["seconds"]))
    settings = {
        "model": MODEL,
        "test": f"{small.TEST}, {small.SECONDS:g} s from rest",
        "free parameters": list(small.FREE),
        "seed": seed,
        "cores": 1,
        "target ess": TARGET,
        "cpu": platform.processor() or platform.machine(),
        **versions(*_LIBRARIES),
        "mofit": "search, refinement, sampling, evidence, with default settings; the second run in a process",
        **{peer.name: peer.note for peer in PEERS},
        **{key: EXPLAINED[key] for key in ("minima", "ess", "posterior")},
    }
    return rows.done(), settings


def _mofit(seed: int) -> dict[str, Any]:
    """The second run: the first compiles."""
    small.identify(seed)
    begin = time.perf_counter()
    minima, ess, in_sampling = small.identify(seed)
    seconds = time.perf_counter() - begin
    return {
        "minima": minima, "ess": ess, "evaluations": None, "in_sampling": in_sampling, "seconds": seconds,
        "in_search": None, "times_mofit": 1.0,
    }  # fmt: skip


def peer_row(peer: Peer, job: Job, seed: int, unit: float, target: float = TARGET) -> dict[str, Any]:
    """A peer's search and sampler on its own simulator.

    Raises
    ------
    Absent
        If one of its packages is not installed.
    """
    own = peer.own(job.task)
    own(job.task.mean[None])  # compiled, where it compiles
    searched, sampled = Recorded(own), Recorded(own)
    begin = time.perf_counter()
    ends = peer.search(searched, len(job.task.mean), seed)
    in_search = time.perf_counter() - begin
    minima = distinct_minima(ends, job.whole, job.best)
    begin = time.perf_counter()
    ess = min(peer.sample(sampled, start, seed, target) for start in (minima if len(minima) else ends[:1]))
    seconds = in_search + time.perf_counter() - begin
    return {
        "minima": len(minima),
        "ess": ess,
        "evaluations": searched.points + sampled.points,
        "in_sampling": sampled.points,
        "seconds": seconds,
        "in_search": in_search,
        "times_mofit": seconds / unit,
    }
