"""The same identification by mofit and by the tools that people take for it: time, evaluations, minima, sample.

Peers would take hours. What each *needs* is therefore counted by running its own search and its own sampler, seeded, on
mofit's kernel in place of its simulator; what each of these evaluations *costs* is measured with its own simulator, on
points drawn from those that were visited. The time is the product.
"""

from __future__ import annotations

import platform
import time
from functools import partial
from typing import Any

from benchmarks.pipelines import by_diffrax, by_mofit, by_pints, by_pypesto, by_script
from benchmarks.pipelines.job import MODEL, Job, Recorded, make_job, pose
from benchmarks.pipelines.peer import FOUND, Peer, distinct_minima, price
from benchmarks.rows import KeptRows
from mofit.data import bundled_campaign, read_campaign
from mofit.identification.settings import Settings
from mofit.sampling import SampleSettings
from studies.report_page import versions

PEERS: tuple[Peer, ...] = (by_script.PEER, by_pypesto.PEER, by_diffrax.PEER, by_pints.PEER)
#: Effective draws of every parameter, for all alike; mofit's stop rule asks for more besides.
TARGET = SampleSettings.min_ess
_LIBRARIES = ("numpy", "scipy", "emcee", "pypesto", "jax", "diffrax", "numpyro", "pints")

EXPLAINED = {
    "minima": "mofit: modes that carry posterior weight; peers: reported points within "
    f"{FOUND:.1f} nats of the best minimum, those that no hill separates counted once",
    "ess": "least effective number of draws of any parameter; peers stop at the target, mofit at its own rule",
    "evaluations": "log posteriors, all tests each; of peers counted by running their search and sampler, settings and "
    "seed the same, on mofit's kernel; mofit's in sampling are of tests that it cuts to about a period",
    "seconds": "mofit: measured, with its machine code on disk, as from the second run on; peers: evaluations of each "
    "stage times what one takes their own simulator, the mean over points drawn from those visited; shared perfectly "
    "by all jobs, as none of them quite does; whatever else they do is left out",
    "build seconds": "compilation, not in seconds: mofit's first run beside a later one; a first call of the simulator",
    "ms to equal": "what one evaluation might take for the whole to take as long as mofit's, were the peer given "
    "another simulator (pyPESTO takes models compiled by AMICI, PINTS those by Myokit)",
    "deviation": "how far the peer's simulator and mofit's disagree on differences of the log posterior in the sample, "
    "within 20 nats of the best, in nats, at most",
    "posterior": "peers: Gaussian noise of mofit's levels; mofit: its own, wider one, that counts the model's gap too",
    "given to peers": "what mofit's job works out itself: prior of the calibration, noise levels",
}


def run(seed: int = 0, jobs: int = 2, limit: float = 60.0) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """All pipelines; what is finished is kept, so an interrupted run resumes.

    Parameters
    ----------
    seed
        Of every search and sampler.
    jobs
        Cores that mofit uses and that peers are taken to use.
    limit
        Seconds for which each peer's simulator is measured.

    Returns
    -------
    rows
        One per pipeline: ``minima``, ``ess``, ``evaluations`` and how many of them ``in_sampling``, ``seconds``,
        ``time`` (measured or computed), ``times_mofit``, ``build_seconds``, ``ms_search`` and ``ms_sampling`` of one
        evaluation, ``ms_to_equal``, ``deviation``; or ``skipped`` with the reason.
    settings
        What they were run with, how each of them works, and what the columns mean.
    """
    options = {"seed": seed, "jobs": jobs, "limit": limit}
    rows = KeptRows("pipeline", options)
    rows.add({"name": "mofit"}, lambda: mofit_row(*by_mofit.first_and_later(seed, jobs)))
    problem, minimum = pose(Settings(seed=seed, jobs=jobs), read_campaign(bundled_campaign()))
    job = make_job(problem, minimum)
    for peer in PEERS:
        rows.add({"name": peer.name}, partial(peer_row, peer, job, seed, jobs, limit, rows.rows[0]["seconds"]))
    settings = {
        "model": MODEL,
        "tests": len(problem.tests),
        "free parameters": len(problem.space),
        **options,
        "target ess": TARGET,
        "cpu": platform.processor() or platform.machine(),
        **versions(*_LIBRARIES),
        "mofit": "calibration, search, refinement, sampling, evidence and profiles, with default settings",
        **{peer.name: peer.note for peer in PEERS},
        **EXPLAINED,
    }
    return rows.done(), settings


def mofit_row(first: by_mofit.Run, later: by_mofit.Run) -> dict[str, Any]:
    """mofit's row from a run that compiles everything and a later one."""
    return {
        "minima": later.modes,
        "ess": later.ess,
        "evaluations": later.evaluations,
        "in_sampling": later.in_sampling,
        "seconds": later.seconds,
        "time": "measured",
        "times_mofit": 1.0,
        "build_seconds": max(first.seconds - later.seconds, 0.0),
        "ms_search": None,
        "ms_sampling": None,
        "ms_to_equal": None,
        "deviation": None,
    }


def peer_row(peer: Peer, job: Job, seed: int, jobs: int, limit: float, unit: float) -> dict[str, Any]:
    """A peer's row: its evaluations counted on mofit's kernel, times their price on its own simulator.

    Raises
    ------
    Absent
        If one of its packages is not installed.
    """
    own = peer.own(job.task)
    begin = time.perf_counter()
    own(job.task.mean[None])
    first = time.perf_counter() - begin
    searched = Recorded(job.whole.descent if peer.gradients else job.whole.log_posterior)
    ends = peer.search(searched, len(job.task.mean), seed)
    minima = distinct_minima(ends, job.whole, job.best)
    sampled = Recorded(job.near.descent if peer.gradients else job.near.log_posterior)
    # after a search that found nothing the sampler starts from the best end, as it would in its user's hands
    ess = min(peer.sample(sampled, start, seed, TARGET) for start in (minima if len(minima) else ends[:1]))
    in_search = price(own, searched, peer.gradients, limit / 2, seed)
    in_sample = price(own, sampled, peer.gradients, limit / 2, seed)
    seconds = (searched.points * in_search.seconds + sampled.points * in_sample.seconds) / jobs
    evaluations = searched.points + sampled.points
    return {
        "minima": len(minima),
        "ess": ess,
        "evaluations": evaluations,
        "in_sampling": sampled.points,
        "seconds": seconds,
        "time": "computed",
        "times_mofit": seconds / unit,
        "build_seconds": max(first - in_sample.seconds, 0.0) if peer.gradients else 0.0,
        "ms_search": 1e3 * in_search.seconds,
        "ms_sampling": 1e3 * in_sample.seconds,
        "ms_to_equal": 1e3 * unit * jobs / evaluations,
        "deviation": in_sample.deviation,
    }
