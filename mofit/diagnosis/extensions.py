"""Fitted models with one more effect each: which of them are worth a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from mofit.diagnosis.candidate_model import CandidateModel
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.score_test import ScoreTest
from mofit.diagnosis.settings import DiagnosisSettings

#: A fitted model, and the score test there of an effect to be added to it.
Extension: TypeAlias = tuple[Fitted, ScoreTest]


def best_extensions(
    level: Sequence[CandidateModel], scores: Sequence[Sequence[ScoreTest]], settings: DiagnosisSettings
) -> list[Extension]:
    """What to add to which model: the sets for which the score tests promise the best criteria, the best first.

    ``level`` are models, the best first, and ``scores`` the score tests at each of them.
    """
    promised: dict[tuple[str, ...], tuple[float, CandidateModel, ScoreTest]] = {}
    for base, own in zip(level, scores, strict=True):
        for one in own:
            effects = tuple(sorted((*base.effects, one.name)))
            criterion = base.criterion - one.promise
            if one.promise > 0 and criterion < promised.get(effects, (np.inf,))[0]:
                promised[effects] = criterion, base, one
    best = sorted(promised.values(), key=lambda found: found[0])[: settings.most_extensions]
    gain = level[0].criterion - best[0][0] if best else 0.0
    limit = level[0].criterion - settings.extension_promising * gain
    return [(base.fitted, one) for criterion, base, one in best if criterion < limit]
