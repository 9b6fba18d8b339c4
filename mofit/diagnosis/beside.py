"""Candidates and refits computed by several processes.

What a process sends back is what the caller lacks: compiled models and effects of a user's file do not pickle. Results
are the same for any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.candidates import Candidate, effects_moving, prepare, prepared_at
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted, fit_to
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.refit import NotFittedError, refit, refit_from
from mofit.diagnosis.residual_tests import remember, residual_tests
from mofit.diagnosis.score_test import ScoreTest, score_tests
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.models import Effect
from mofit.models.model import TIME
from mofit.optimize import Minimum
from mofit.parameters import Parameter
from mofit.runtime.parallel import forked_map, shared_map
from mofit.runtime.progress import Progress
from mofit.simulation.ranges import with_parameters


@dataclass(frozen=True)
class _Sent:
    """A discrepancy without its effect, but with that one's parameters, the ranges of which a fit may widen."""

    point: Mapping[str, float]
    around: FloatArray
    shift: FloatArray
    sensitivity: FloatArray
    parameters: tuple[Parameter, ...]

    @classmethod
    def of(cls, one: Discrepancy) -> _Sent:
        """What is sent of it."""
        return cls(dict(one.point), one.around, one.shift, one.sensitivity, tuple(one.effect.parameters))

    def of_effect(self, effect: Effect) -> Discrepancy:
        """The discrepancy, its effect being this one in maybe wider ranges."""
        same = self.parameters == tuple(effect.parameters)
        own = effect if same else with_parameters(effect, self.parameters)
        return Discrepancy(own, self.point, self.around, self.shift, self.sensitivity)


def prepared(fitted: Fitted, effects: Sequence[Effect], progress: Progress) -> list[Candidate]:
    """What every effect adds to the fitted model, see `mofit.diagnosis.candidates.prepare`.

    The residual tests of the model, which are asked for next, are made along.
    """

    def sent(effect: Effect | None) -> tuple[Any, ...]:
        if effect is None:
            return (residual_tests(fitted),)
        one = prepare(fitted, effect)
        return [_Sent.of(part) for part in one.discrepancies], one.sensitivities, one.columns, one.steps

    def tell(number: int) -> None:
        if number < len(effects):
            progress("score test", number, len(effects), effects[number].name)

    # what has states of its own takes the most steps
    longest = [None, *(effect for effect in effects if effect.states)]
    count = fitted.hypothesis.observed.processes
    *found, (residuals,) = forked_map(sent, [*effects, None], count, longest, tell, _name)
    remember(fitted, residuals)
    return [
        Candidate(tuple(part.of_effect(effect) for part in parts), *rest)
        for effect, (parts, *rest) in zip(effects, found, strict=True)
    ]


def scored(models: Sequence[Fitted], candidates: Sequence[Candidate]) -> list[list[ScoreTest]]:
    """The score tests of candidates at every model; see `mofit.diagnosis.score_test.score_tests`."""
    known = {one.name: one for one in candidates}
    moving = [model for model in models if any(effects_moving(model, one.effect.needs) for one in candidates)]
    still = [model for model in models if model not in moving]

    def sent(model: Fitted) -> list[tuple[str, dict[str, Any]]]:
        found = [(one.name, dict(vars(one))) for one in score_tests(model, candidates)]
        for _, values in found:
            del values["candidate"]
        return found

    found = shared_map(sent, still, lambda model: " + ".join(map(_name, model.hypothesis.effects)))
    tests = {
        id(model): [ScoreTest(candidate=known[name], **values) for name, values in own]
        for model, own in zip(still, found, strict=True)
    }
    # a candidate that is prepared anew for a model stays where that was done
    own = {id(model): score_tests(model, prepared_at(model, candidates)) for model in moving}
    return [(tests | own)[id(model)] for model in models]


def refitted(
    extended: Sequence[tuple[Fitted, ScoreTest]], limit: float, progress: Progress, known: Sequence[float] = ()
) -> list[Fitted | str]:
    """The refit of every fitted model with an effect added, or why there is none; see `mofit.diagnosis.refit.refit`.

    ``known`` is a value for each of them.
    """
    wanted = [
        _Wanted((*base.hypothesis.effects, one.effect), partial(refit, base, one, limit, value))
        for (base, one), value in zip(extended, known or repeat(np.inf), strict=False)
    ]
    return _fits(extended[0][0].hypothesis.observed, wanted, progress) if extended else []


def refitted_from(
    models: Sequence[Fitted], other: Fitted, limit: float, progress: Progress, known: Sequence[float]
) -> list[Fitted | str]:
    """The models fitted again from where another one ended, or why not; see `mofit.diagnosis.refit.refit_from`."""
    wanted = [
        _Wanted(one.hypothesis.effects, partial(refit_from, one, other, limit, value))
        for one, value in zip(models, known, strict=True)
    ]
    return _fits(other.hypothesis.observed, wanted, progress)


def fitted_to(
    observed: WhitenedData, models: Sequence[Fitted], progress: Progress, limit: float = np.inf
) -> list[Fitted]:
    """The models fitted to the tests with another noise; see `mofit.diagnosis.fitting.fit_to`."""
    wanted = [_Wanted(one.hypothesis.effects, partial(fit_to, observed, one, limit)) for one in models]
    return [one for one in _fits(observed, wanted, progress) if isinstance(one, Fitted)]


@dataclass(frozen=True)
class _Wanted:
    """A fit, and its effects."""

    effects: tuple[Effect, ...]
    fit: Callable[[], Fitted]

    def name(self) -> str:
        """Of its effects."""
        return " + ".join(map(_name, self.effects))


def _fits(observed: WhitenedData, wanted: Sequence[_Wanted], progress: Progress) -> list[Fitted | str]:
    """The fits to the tests, or why there is none."""

    def sent(one: _Wanted) -> tuple[list[_Sent], int, Minimum, FloatArray, FloatArray] | str:
        try:
            found = one.fit()
        except NotFittedError as error:
            return str(error)
        parts = [_Sent.of(part) for part in found.hypothesis.discrepancies]
        return parts, found.hypothesis.steps, found.minimum, found.residual, found.jacobian

    def tell(number: int) -> None:
        progress("refit", number, len(wanted), wanted[number].name())

    models, longest = list[Fitted | str](), [one for one in wanted if any(map(_takes_long, one.effects))]
    fits = forked_map(sent, wanted, observed.processes, longest, tell, _Wanted.name)
    for one, found in zip(wanted, fits, strict=True):
        if isinstance(found, str):
            models.append(found)
            continue
        parts, steps, minimum, residual, jacobian = found
        discrepancies = [part.of_effect(effect) for part, effect in zip(parts, one.effects, strict=True)]
        model = hypothesis(observed, discrepancies).with_steps(steps)
        models.append(Fitted(model, minimum, residual, jacobian))
    return models


def _takes_long(effect: Effect) -> bool:
    """Whether it takes many steps, having states of its own, or changes over a test, so that all of it is simulated."""
    return bool(effect.states) or TIME.name in {channel.name for channel in effect.inputs}


def _name(effect: Effect | None) -> str:
    return effect.name if effect else "residual tests"
