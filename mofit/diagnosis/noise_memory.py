"""Long memory of the noise of an output (1/f): told from all of its records.

A short record hardly tells noise with a long memory from noise with a short one, whose level changes less by far. So
what all records tell is added up, that of the calibration tests too: the noise has one exponent in all of them. Its
strength, and its colour beside the memory, each record tells for itself.

Records that do not repeat stay as they are, and tell nothing of the stages: their noise is what a regression has left.
Part of a gap may be in it, and part of the noise is not; what is slow there may be the model's. Beside others that
repeat they are records of the same noise, and a few of these hardly tell its memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit._typing import FloatArray
from mofit.diagnosis.whitening import Whitening
from mofit.identification.calibration import Calibration, summed_memory
from mofit.problem import Problem, join_priors

#: Indices of test and output, and the whitening of their record.
Record = tuple[int, int, Whitening]


def with_common_memory(
    problem: Problem, records: Sequence[Record], calibrations: Sequence[Calibration]
) -> tuple[Problem, tuple[Record, ...], tuple[Calibration, ...]]:
    """Records and stages with the memory that all of them together tell, and the problem with the stages' prior."""
    names, memory = [output.name for output in problem.model.outputs], summed_memory(calibrations)
    of_rest: dict[str, FloatArray] = {}
    for _, output, w in records:
        own = memory if w.periods else of_rest
        own[names[output]] = own.get(names[output], 0.0) + w.process.memory
    found = [
        (test, output, _beside(w, memory[names[output]] + of_rest.get(names[output], 0.0)) if w.periods else w)
        for test, output, w in records
    ]
    stages = tuple(one.with_memory(memory) for one in calibrations)
    if problem.prior.names:
        problem = replace(problem, prior=join_priors([one.prior(problem.space) for one in stages]))
    return problem, tuple(found), stages


def _beside(w: Whitening, memory: FloatArray) -> Whitening:
    """The record with what all of them tell of memory, itself included."""
    return replace(w, process=w.process.beside(memory - w.process.memory))
