"""The tests of a declared space, ready to be judged: their signals, their time, and which the rig cannot run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mofit.campaign import Procedure
from mofit.identifiability.limits import Reach, asked, driven_input, refusal
from mofit.simulate.excitation import excitation
from mofit.simulate.plan import Plan, TestPlan
from mofit.simulate.setup import set_up


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be run.

    Parameters
    ----------
    plan
        As in a plan file.
    procedure
        Its signals.
    seconds
        What it costs: its duration and the rig's overhead.
    refused
        The limit that it breaks; empty if none.
    """

    plan: TestPlan
    procedure: Procedure
    seconds: float
    refused: str = ""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.plan.name


def candidates(
    base: Plan, plans: Sequence[TestPlan], limit: Reach, overhead: float, where: str = "space"
) -> tuple[Candidate, ...]:
    """Signals of all tests, and which of them break a limit of the input (of outputs: later, by simulation).

    Parameters
    ----------
    base
        The plan that the tests would join: model, conditions, and the seed of the phases of multisines (those that
        `mofit simulate` draws are others).
    plans
        The tests.
    limit
        What the rig can do to the model's driven input; tests that a calibration stage answers have an input of their
        own, and only their sampling rate and duration are judged.
    overhead
        Time per test beside its duration [s].
    where
        Names the space in errors.

    Raises
    ------
    InputError
        With every fault: values of the wrong unit, missing conditions.
    """
    setup = set_up(base.model_copy(update={"tests": tuple(plans)}), where)
    found = []
    for test in setup.tests:
        # the same phases for every multisine, whatever the other candidates are
        signal = excitation(test.plan.kind, test.settings, test.plan.lines, np.random.default_rng(base.seed))
        driven, unit = driven_input(test.source)
        procedure = Procedure(
            name=test.plan.name,
            kind=test.plan.kind,
            time=signal.time,
            inputs={driven: signal.values},
            conditions={**setup.conditions, **test.conditions},
            frequency=signal.frequency,
            amplitude=test.settings["amplitude"],
            hold=signal.hold,
        )
        wanted = asked(procedure, driven)
        found.append(Candidate(test.plan, procedure, wanted.duration + overhead, refusal(wanted, limit, unit)))
    return tuple(found)
