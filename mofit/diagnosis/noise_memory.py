"""Whether the noise of an output has a long memory (1/f): one question to all of its records.

A short record hardly tells noise with a long memory from noise with a short one, whose level and slow changes are
smaller by far. So the log odds of all records are added up, those of the calibration tests among them. How strong the
noise is, and how coloured beside its memory, each record tells for itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit.diagnosis.whitening import Whitening
from mofit.identification.calibration import Calibration, summed_log_odds
from mofit.problem import Problem, join_priors

#: Indices of test and output, and the whitening of their record.
Record = tuple[int, int, Whitening]


def with_common_memory(
    problem: Problem, records: Sequence[Record], calibrations: Sequence[Calibration]
) -> tuple[Problem, tuple[Record, ...], tuple[Calibration, ...]]:
    """Records and stages with the memory that all of them together tell, and the problem with the stages' prior."""
    odds = summed_log_odds(calibrations)
    for _, output, w in records:
        name = problem.model.outputs[output].name
        odds[name] = odds.get(name, 0.0) + w.process.log_odds
    found = []
    for test, output, w in records:
        others = odds[problem.model.outputs[output].name] - w.process.log_odds
        found.append((test, output, replace(w, process=w.process.beside(others))))
    stages = tuple(one.beside(odds) for one in calibrations)
    if problem.prior.names:
        problem = replace(problem, prior=join_priors([one.prior(problem.space) for one in stages]))
    return problem, tuple(found), stages
