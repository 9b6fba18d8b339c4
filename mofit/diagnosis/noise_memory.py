"""Long memory of the noise of an output (1/f): told from all of its records.

A short record hardly tells noise with a long memory from noise with a short one, whose level changes less by far. So
what all records tell is added up, that of the calibration tests too: the noise has one exponent in all of them. Its
strength, and its colour beside the memory, each record tells for itself.

The noise of a record that does not repeat is what a regression has left: part of a gap may be in it, and part of the
noise is not: colour of a gap looks like a short memory. Such a record tells the others of a long memory alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit.diagnosis.whitening import Whitening
from mofit.identification.calibration import Calibration, summed_memory
from mofit.problem import Problem, join_priors

#: Indices of test and output, and the whitening of their record.
Record = tuple[int, int, Whitening]


def with_common_memory(
    problem: Problem, records: Sequence[Record], calibrations: Sequence[Calibration]
) -> tuple[Problem, tuple[Record, ...], tuple[Calibration, ...]]:
    """Records and stages with the memory that all of them together tell, and the problem with the stages' prior."""
    names = [problem.model.outputs[output].name for _, output, _ in records]
    memory = summed_memory(calibrations)
    told = [w.process.memory * (w.periods > 0 or w.process.memory.max() > 0) for _, _, w in records]
    for name, own in zip(names, told, strict=True):
        memory[name] = memory.get(name, 0.0) + own
    found = [
        (test, output, replace(w, process=w.process.beside(memory[name] - own)))
        for name, own, (test, output, w) in zip(names, told, records, strict=True)
    ]
    stages = tuple(one.with_memory(memory) for one in calibrations)
    if problem.prior.names:
        problem = replace(problem, prior=join_priors([one.prior(problem.space) for one in stages]))
    return problem, tuple(found), stages
