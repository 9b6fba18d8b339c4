"""Which law each parameter follows over each condition: the one of most evidence (`mofit.identification.law_fit`)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from mofit.identification.law_fit import LEAST_GAIN, Assignment, CellEstimates, LawFit, fit_laws
from mofit.models import FREE

#: forms to choose from by parameter and condition, the plainest first; `FREE` is one of all conditions of a parameter
Candidates: TypeAlias = Mapping[tuple[str, str], Sequence[str]]

#: Standard deviation, over that of a uniform distribution over the range, above which an estimate says next to nothing.
UNINFORMED = 0.5


def of_informed(cells: CellEstimates, candidates: Candidates, said: Collection[tuple[str, str]]) -> Candidates:
    """Without a value per combination of parameters that half of the combinations say next to nothing of.

    Their estimates are not normal, and scatter by more than their covariances say; laws that are ``said`` stay.
    """
    width = [np.log(one.upper / one.lower) if log else one.upper - one.lower
             for one, log in zip(cells.parameters, cells.log, strict=True)]  # fmt: skip
    sd = np.sqrt(np.diagonal(cells.covariance, axis1=1, axis2=2))
    weak = np.median(sd, axis=0) > UNINFORMED * np.array(width) / np.sqrt(12)
    names = {one.name for one, own in zip(cells.parameters, weak, strict=True) if own}
    return {
        key: tuple(form for form in forms if form != FREE or key[0] not in names or key in said)
        for key, forms in candidates.items()
    }


def choose_laws(cells: CellEstimates, candidates: Candidates) -> LawFit:
    """The laws of most evidence, found by changing one at a time, from the plainest and from the richest."""
    plain = {key: forms[0] for key, forms in candidates.items()}
    rich = {key: [form for form in forms if form != FREE or len(forms) == 1][-1] for key, forms in candidates.items()}
    found = [_climbed(cells, start, candidates) for start in (plain, rich)]
    return max(found, key=lambda fit: fit.log_evidence)


def alternatives(cells: CellEstimates, best: LawFit, candidates: Candidates) -> dict[tuple[str, str], dict[str, float]]:
    """Log evidence of every candidate relative to that of the laws chosen, the other laws as chosen."""
    reference = fit_laws(cells, best.forms, best.values).log_evidence
    return {
        key: {
            form: fit_laws(cells, _changed(best.forms, key, form, candidates), best.values).log_evidence - reference
            for form in choices
        }
        for key, choices in candidates.items()
    }


def _climbed(cells: CellEstimates, start: Assignment, candidates: Candidates) -> LawFit:
    best = fit_laws(cells, start)
    while True:
        tried = [fit_laws(cells, forms, best.values) for forms in _changes(best.forms, candidates)]
        better = max(tried, key=lambda fit: fit.log_evidence, default=best)
        if not better.log_evidence > best.log_evidence + LEAST_GAIN:
            return best
        best = better


def _changes(forms: Assignment, candidates: Candidates) -> Iterator[Assignment]:
    """Assignments with one law changed; one parameter at least keeps a law."""
    seen = [dict(forms)]
    for key, choices in candidates.items():
        for form in choices:
            changed = _changed(forms, key, form, candidates)
            if changed not in seen and not all(one == FREE for one in changed.values()):
                seen.append(changed)
                yield changed


def _changed(forms: Assignment, key: tuple[str, str], form: str, candidates: Candidates) -> dict[tuple[str, str], str]:
    """With another form of one law; a parameter becomes free, or follows laws again, over all conditions."""
    own = [other for other in candidates if other[0] == key[0]]
    if form == FREE:
        return {**forms, **dict.fromkeys(own, FREE)}
    lawful = {other: candidates[other][0] for other in own if forms[other] == FREE}
    return {**forms, **lawful, key: form}
