"""Tests cut to a few periods: of a model that repeats they tell the same, at a fraction of the cost."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.simulation import Simulator

#: Share of the samples that must be left out for this to pay.
_WORTH = 0.5


@dataclass(frozen=True)
class FewPeriods:
    """A hypothesis on tests cut to a few periods, and half the squares of what does not repeat in the whole ones."""

    hypothesis: Hypothesis
    left_out: float


def few_periods(model: Hypothesis) -> FewPeriods | None:
    """The hypothesis on tests `cut`; None where they cannot be."""
    found = cut(model.observed, model.simulator)
    if found is None:
        return None
    observed, simulator = found
    return FewPeriods(replace(model, observed=observed, simulator=simulator), 0.5 * model.observed.few_periods[1])


def at_steps_for(model: Hypothesis, u: FloatArray, fewest: int = 1) -> Hypothesis:
    """`Hypothesis.at_steps_for`, judged by a few periods where the inputs repeat."""
    few = few_periods(model)
    return model.with_steps((few.hypothesis if few else model).at_steps_for(u, fewest).steps)


def cut(observed: WhitenedData, simulator: Simulator) -> tuple[WhitenedData, Simulator] | None:
    """Tests with the fewest periods that fill whole samples, and a simulator on them.

    None where that saves little, where inputs do not repeat, or of a user's simulator.
    """
    experiments = simulator.experiments
    if observed.problem.evaluations is not None:
        return None
    if not all(w.repeats(experiments[test].inputs[experiments[test].lead :]) for test, _, w in observed.records):
        return None
    short, _ = observed.few_periods
    ends = [0] * len(experiments)
    for test, _, few in short.records:
        ends[test] = max(ends[test], few.start + few.count)
    brief = [experiment.first(end) for experiment, end in zip(experiments, ends, strict=True)]
    if sum(one.samples for one in brief) > _WORTH * sum(one.samples for one in experiments):
        return None
    return short, simulator.without_tables().with_experiments(brief)
