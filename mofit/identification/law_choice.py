"""Which law each parameter follows over each condition: the one of most evidence (`mofit.identification.law_fit`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

from mofit.identification.law_fit import LEAST_GAIN, Assignment, CellEstimates, LawFit, fit_laws
from mofit.models import FREE

#: forms to choose from by parameter and condition, the plainest first; `FREE` is one of all conditions of a parameter
Candidates: TypeAlias = Mapping[tuple[str, str], Sequence[str]]


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
