"""Which effects, one or several, explain the gap: a forward search through candidate models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mofit.diagnosis.accounts import Account, accounts_of, promising
from mofit.diagnosis.beside import refitted, refitted_from, scored
from mofit.diagnosis.candidate_model import CandidateModel, doubt_of_constants, rated
from mofit.diagnosis.candidates import Candidate, effects_moving, prepared_at
from mofit.diagnosis.extensions import Extension, best_extensions
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.left_residual import Residuals
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.score_test import ScoreTest, score_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.identification.widening import WORTH
from mofit.runtime.progress import Progress, silent

#: Multiple of the expected size, and of the shift of the model's parameters, that a strong effect is fitted from.
_BEYOND = 2.0


@dataclass(frozen=True)
class Attribution:
    """All that was tried.

    Parameters
    ----------
    baseline, baseline_residuals
        The model without effects, and its residual tests.
    score_tests
        Of every candidate at the baseline, the most significant first.
    models
        Fitted candidate models, the best first; the baseline is one of them.
    best_residuals
        Residual tests of the best model.
    accounts
        What became of every candidate.
    """

    baseline: Fitted
    baseline_residuals: Residuals
    score_tests: tuple[ScoreTest, ...]
    models: tuple[CandidateModel, ...]
    best_residuals: Residuals
    accounts: tuple[Account, ...] = ()

    @property
    def best(self) -> CandidateModel:
        """The model with the smallest criterion."""
        return self.models[0]

    @property
    def p_value(self) -> float:
        """Of a gap: the smallest of the residual tests and the score tests at the baseline."""
        return min([self.baseline_residuals.p_value, *(one.p_holm for one in self.score_tests)])

    def has_gap(self, settings: DiagnosisSettings) -> bool:
        """Whether there is a gap: by the residual tests, or by score tests if the best model has effects.

        The largest of many scores is large by chance now and then; its effect then gains less than its penalty.
        """
        p_value = self.p_value if self.best.effects else self.baseline_residuals.p_value
        return p_value < settings.gap_p_value


@dataclass(frozen=True)
class _Search:
    """Models fitted so far, those that could not be, and candidates that were not tried; both with the reason.

    A model counts where its criterion comes down to the best one, or to what is ``needed``.
    """

    baseline: Fitted
    candidates: Sequence[Candidate]
    settings: DiagnosisSettings
    models: tuple[CandidateModel, ...]
    needed: float = np.inf
    failed: Mapping[tuple[str, ...], str] = field(default_factory=dict)
    passed_over: Mapping[str, str] = field(default_factory=dict)

    @property
    def best(self) -> CandidateModel:
        return self.models[0]

    @property
    def doubt(self) -> float:
        """By how much the squares of a model that counts may exceed its criterion, see `doubt_of_constants`."""
        return max(doubt_of_constants(self.baseline), 0.0)

    def tried(self, effects: Iterable[str]) -> bool:
        return tuple(sorted(effects)) in {one.effects for one in self.models} | {*self.failed}

    def score_tests_at(self, base: Fitted) -> list[ScoreTest]:
        return score_tests(base, prepared_at(base, self.candidates))

    def moved_by(self, base: Fitted) -> set[str]:
        """Candidates that need a condition of the tests which an effect of the fitted model moves."""
        return {one.name for one in self.candidates if effects_moving(base, one.effect.needs)}

    def extended(self, wanted: Iterable[Extension], progress: Progress) -> _Search:
        """With refits of models with an effect added each, the most promising one first."""
        fresh = {names: one for one in wanted if not self.tried(names := _names(one))}
        made: dict[tuple[str, ...], CandidateModel] = {}
        failed = dict(self.failed)
        lowest = min(self.best.criterion, self.needed)
        # far above the first the others need no exact fit
        for part in (list(fresh)[:1], list(fresh)[1:]):
            limit = lowest + self.doubt
            for names, found in zip(part, refitted([fresh[names] for names in part], limit, progress), strict=True):
                if isinstance(found, str):
                    failed[names] = found
                else:
                    made[names] = rated(found, len(self.candidates))
            lowest = min([lowest, *(one.criterion for one in made.values())])
        contenders = [names for names, one in made.items() if one.criterion < lowest + self.settings.contender]
        # close to the best it matters whether the effect was present in the calibration tests
        others = {
            names: (fresh[names][0], other)
            for names in contenders
            if (other := fresh[names][1].alternative) is not None
        }
        again = refitted(list(others.values()), lowest + self.doubt, progress)
        for names, found in zip(others, again, strict=True):
            if not isinstance(found, str):  # else the effect is fitted all the same
                better, worse = sorted((made[names], rated(found, len(self.candidates))), key=_order)
                made[names] = replace(better, alternative=worse)
        return replace(self, models=tuple(sorted((*self.models, *made.values()), key=_order)), failed=failed)

    def beyond(self, scores: Sequence[ScoreTest], progress: Progress) -> _Search:
        """With refits of the promising effects from sizes beyond those expected, where these end lower."""
        known = {one.effects: _worth(one) for one in self.models}
        kept, _ = promising(scores, self.settings.promising, self.settings.most_refits)
        farther = [one.farther(_BEYOND) for one in kept if (one.name,) in known]
        limit, values = self.best.criterion + self.doubt, [known[one.name,] for one in farther]
        return self._improved(refitted([(self.baseline, one) for one in farther], limit, progress, values))

    def elsewhere(self, progress: Progress) -> _Search:
        """With single effects fitted again from where a best model of several ended, where these end lower.

        They may have ended in another minimum of the model's own parameters: then a second effect only helped one of
        them out of there.
        """
        if len(self.best.effects) < 2:
            return self
        singles = [one for one in self.models if len(one.effects) == 1][: self.settings.most_refits]
        limit = self.best.criterion + self.doubt
        values = [_worth(one) for one in singles]
        again = refitted_from([one.fitted for one in singles], self.best.fitted, limit, progress, values)
        return self._improved(again)

    def _improved(self, again: Iterable[Fitted | str]) -> _Search:
        """With models of single effects that were fitted again, where these end lower."""
        better = dict[tuple[str, ...], CandidateModel]()
        known = {one.effects: one for one in self.models}
        for found in again:
            model = None if isinstance(found, str) else rated(found, len(self.candidates))
            if model is not None and model.criterion < known[model.effects].criterion - WORTH:
                better[model.effects] = model
        models = (better.get(one.effects, one) for one in self.models)
        return replace(self, models=tuple(sorted(models, key=_order)))

    def singly(self, scores: Sequence[ScoreTest], progress: Progress) -> _Search:
        """With refits of the baseline plus each of the candidates whose scores promise something."""
        kept, passed_over = promising(scores, self.settings.promising, self.settings.most_refits)
        return replace(self.extended([(self.baseline, one) for one in kept], progress), passed_over=passed_over)

    def all_singly(self, scores: Sequence[ScoreTest], progress: Progress) -> _Search:
        """With refits of the baseline plus each of the candidates, whatever its score."""
        return replace(self.extended([(self.baseline, one) for one in scores], progress), passed_over={})

    def with_parts(self, progress: Progress) -> _Search:
        """With refits of the best model's effects without each of them, added one by one."""
        best, state = self.best.effects, self
        parts = [tuple(name for name in best if name != left_out) for left_out in best]
        for count in range(1, len(best)):
            wanted = list[Extension]()
            for *first, last in dict.fromkeys(part[:count] for part in parts):
                if not state.tried((*first, last)):
                    bases = [one.fitted for one in state.models if one.effects == tuple(sorted(first))]
                    wanted += [(base, one) for base in bases for one in state.score_tests_at(base) if one.name == last]
            state = state.extended(wanted, progress)
        return state


def _worth(known: CandidateModel) -> float:
    """The value that another minimum of the same model must fall below to count."""
    return known.fitted.minimum.value - 0.5 * WORTH


def _names(extension: Extension) -> tuple[str, ...]:
    """Names of all effects, sorted."""
    base, added = extension
    return tuple(sorted([*(effect.name for effect in base.hypothesis.effects), added.name]))


def attribute(
    baseline: Fitted,
    candidates: Sequence[Candidate],
    settings: DiagnosisSettings,
    progress: Progress = silent,
    *,
    promising_only: bool = False,
    explaining: float = 0.0,
) -> Attribution:
    """Search forwards: single effects first, then one more at a time as long as something significant is left.

    A model with more effects is best only if its information criterion is, and every part of the best set is tried too:
    so the search prunes backwards as well. With ``promising_only`` it ends with the single effects that score most. Of
    what explains less than the share ``explaining`` of the gap's whitened squares, no exact fit is needed.
    """
    scores, residuals = score_tests(baseline, candidates), residual_tests(baseline)
    model = rated(baseline, len(candidates))
    needed = model.criterion - explaining * (_whole(baseline) - baseline.hypothesis.observed.explainable.sum())
    state = _Search(baseline, candidates, settings, (model,), float(needed))
    nothing = Attribution(baseline, residuals, tuple(scores), state.models, residuals)
    if nothing.p_value >= settings.gap_p_value:
        reasons = dict.fromkeys((one.name for one in scores), "there is no gap")
        return replace(nothing, accounts=accounts_of(scores, state.models, {}, reasons))
    state = state.singly(scores, progress)
    if promising_only:
        return _attribution(nothing, state)
    # the little that one effect leaves is what its law misses
    explained = not _leaves_more(state, settings.residual_share)
    left = residual_tests(state.best.fitted).p_value < settings.residual_p_value
    if not explained and (left or _leaves_more(state, 1 - settings.partly, settings.doubt)):
        # a strong effect bends its own direction: what looked hopeless at neutral size may be right, and the minimum
        # may lie far beyond the size that its score lets expect
        state = state.all_singly(scores, progress).beyond(scores, progress)
    for count in range(1, 2 if explained else settings.most_effects):
        # of two effects one would have explained more, and of three two, unless one moves the other
        share, doubt = settings.unexplained[count - 1], settings.doubt if count == 1 else 0.0
        state = _one_more(state, count, progress, only_moved=_leaves_more(state, share, doubt))
    state = state.elsewhere(progress)
    return _attribution(nothing, state)


def _attribution(begun: Attribution, state: _Search) -> Attribution:
    """All that was tried, with what it ended with."""
    accounts = accounts_of(begun.score_tests, state.models, state.failed, state.passed_over)
    return replace(begun, models=state.models, best_residuals=residual_tests(state.best.fitted), accounts=accounts)


def _leaves_more(state: _Search, share: float, doubt: float = 0.0) -> bool:
    """Whether the best model leaves more than this share of the baseline's whitened squares beyond the noise.

    The gain is known well, the whole only as far as the noise's own squares are: it may be less by ``doubt`` of their
    standard deviations.
    """
    where = state.baseline.hypothesis.observed.explainable
    noise = where.sum() + doubt * np.sqrt(2 * where.sum())
    left, whole = _whole(state.best.fitted), _whole(state.baseline)
    return bool(whole - left < (1 - share) * (whole - noise))


def _whole(fitted: Fitted) -> float:
    """Whitened squares of all rows that may hold a gap."""
    where = fitted.hypothesis.observed.explainable
    return float(np.sum(fitted.residual[: len(where)][where] ** 2))


def _one_more(state: _Search, count: int, progress: Progress, only_moved: bool) -> _Search:
    """Extend models of ``count`` effects by one more where something is left, the most promising sets first.

    Maybe only by what an effect of theirs moves: at a wrong speed a wheel turns with a wrong frequency, and neither
    explains anything alone.
    """
    settings = state.settings
    level = [one for one in state.models if len(one.effects) == count][: settings.most_refits]
    if only_moved:
        level = [one for one in level if state.moved_by(one.fitted)]
    if not level:
        return state
    scores = [state.score_tests_at(level[0].fitted)]
    left = min([residual_tests(level[0].fitted).p_value, *(one.p_holm for one in scores[0])])
    if left < settings.one_more_p_value:
        scores += scored([one.fitted for one in level[1:]], state.candidates)
        if only_moved:
            moved = [state.moved_by(one.fitted) for one in level]
            scores = [[one for one in own if one.name in names] for own, names in zip(scores, moved, strict=True)]
        state = state.extended(best_extensions(level, scores, settings), progress)
    return state.with_parts(progress) if len(state.best.effects) > count else state


def _order(model: CandidateModel) -> float:
    return model.criterion if np.isfinite(model.criterion) else np.inf
