"""Records that begin in their steady state: the model is driven with their inputs until it is in its own.

Where a rig has settled before the record begins, a model that starts at rest rings up meanwhile. A lightly damped one
does so for many periods. So its inputs, which repeat, act on it for some time before the first sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data.signals import SignalAnalysis
from mofit.identification.descents import settings_for
from mofit.identification.problem_setup import ProblemSetup
from mofit.identification.widening import WORTH
from mofit.optimize import Minimum, merge, refine
from mofit.problem import CampaignPosterior, Problem
from mofit.simulation import objective_pairs
from mofit.simulation.experiment import LEADS

#: Change of the outputs by a start elsewhere that counts, in standard deviations of any parameter.
_CHANGE = 0.1
#: Steps per sampling interval that tell whether there is a change at all.
_STEPS = 4


def led_setup(setup: ProblemSetup, posterior: CampaignPosterior, minimum: Minimum) -> ProblemSetup | None:
    """The problem with the inputs led in where that fits better; None where it does not. See `led_in`."""
    found = led_in(setup, posterior, minimum)
    return None if found is None else found[0]


def led_in(
    setup: ProblemSetup, posterior: CampaignPosterior, minimum: Minimum
) -> tuple[ProblemSetup, FloatArray] | None:
    """The problem with the inputs led in where that fits better, by local descents, and its minimum (d,).

    Parameters
    ----------
    setup, posterior, minimum
        The problem, its posterior with noise estimated, and the best minimum.
    """
    steady, best = steady_from_start(posterior.main), setup
    point, value = minimum.point, float(posterior.evaluate(minimum.point[None])[0][0])
    for lengths in LEADS if steady else ():
        leads = {name: lengths * length for name, length in steady.items()}
        led = replace(setup, leads=leads, known=posterior.main.experiments)
        if not _depends_on_start(best.posterior.main.with_noise(posterior.main.noise), led.posterior.main, point):
            break
        target = led.posterior.with_noise(posterior.main.noise)
        if not np.isfinite(target.evaluate(point[None])[0]).all():  # from elsewhere the model runs away
            break
        (found, *_) = merge(refine(target.evaluate, point[None], settings_for(target.main))) or (None,)
        if found is None or not value - found.value > WORTH:
            break
        best, point, value = led, found.point, found.value
    if best is setup:
        return None
    longest = max(best.leads[name] / length for name, length in steady.items())
    # where some tests begin in the steady state others may, too: what looks like their transient may be a drift
    every = _lengths(posterior.main, lambda record: record.period is not None and record.periods >= 2)
    others = {name: longest * length for name, length in every.items() if name not in steady}
    best = replace(best, leads={**best.leads, **others})
    return _where_better(posterior.main, _shortened(best, point), point), point


def leads_said(before: ProblemSetup, after: ProblemSetup) -> Iterator[str]:
    """A sentence on the tests whose inputs are led in."""
    if after.leads and after.leads != before.leads:
        longest = max(after.leads.values())
        yield (
            f"{', '.join(after.leads)}: the record begins in its steady state, so its inputs, repeated, act on the "
            f"model for up to {longest:.4g} s before."
        )


def steady_from_start(problem: Problem) -> dict[str, float]:
    """Length [s] of every test that repeats from its first sample on, unless it says where its transient ends."""
    return _lengths(problem, lambda record: record.steady_from_start)


def _lengths(problem: Problem, wanted: Callable[[SignalAnalysis], bool]) -> dict[str, float]:
    """The same of every test whose record is wanted."""
    tests = zip(problem.measurements, problem.signals, strict=True)
    return {
        test.name: test.experiment.length + test.experiment.step
        for test, record in tests
        if wanted(record) and problem.model.dynamic and test.experiment.transient is None
    }


def _depends_on_start(now: Problem, led: Problem, point: FloatArray) -> bool:
    """Whether the earlier start changes the outputs by more than hardly anything."""
    quick, full = now.simulator.with_steps(_STEPS), now.layout.full(point[None])
    simulators = quick, quick.with_experiments(led.experiments)
    # test by test: the outputs of all of them are large
    both = zip(now.experiments, *(one.one_by_one(full, derivatives=False) for one in simulators), strict=True)
    seen = [
        experiment.weights[:, output] @ (there - here)[0, :, output, 0] ** 2
        for experiment, here, there in both
        for output in experiment.fitted
    ]
    return not float(now.noise.weights @ np.array(seen)) <= _CHANGE**2


def _shortened(led: ProblemSetup, point: FloatArray) -> ProblemSetup:
    """The problem with the least lead that leaves the outputs as they are: the model's memory, not the record, counts.

    Every simulation to come takes the lead along, and a record may be far longer than what a model remembers.
    """
    best, whole = led, led.posterior.main.with_noise_at(point)
    while max(best.leads.values()) > max(test.experiment.step for test in whole.measurements):
        shorter = replace(led, leads={name: lead / 2 for name, lead in best.leads.items()})
        if _depends_on_start(whole, shorter.posterior.main, point):
            break
        best = shorter
    return best


def _where_better(before: Problem, led: ProblemSetup, point: FloatArray) -> ProblemSetup:
    """The problem with the inputs led in only of those tests that it fits better then."""
    gains = before.objectives(point[None])[0] - led.posterior.main.objectives(point[None])[0]
    pairs = zip(objective_pairs(before.experiments), gains, strict=True)
    tests = {before.tests[test] for (test, _), gain in pairs if gain > 0}
    return replace(led, leads={name: lead for name, lead in led.leads.items() if name in tests}, known=())
