"""How far the gap shrinks, on every kind of hold-out that is at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit.data import Campaign
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.cross_validation import cross_validate
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.other_records import share_on_records
from mofit.diagnosis.shrinkage import Shrinkage


def measured_shrinkage(
    found: Attribution, candidates: Sequence[Candidate], records: Campaign | None, seed: int
) -> tuple[Shrinkage | None, str]:
    """On tests left out, groups of them, and records that were kept out of everything; or why on none of them."""
    shrinkage = cross_validate(found, candidates, seed)
    if records is not None:
        share = share_on_records(found.baseline, found.best.fitted, records, seed)
        if isinstance(share, str):
            shrinkage = replace(shrinkage, note=f"On the records held out no share is known: {share}.")
        else:
            shrinkage = replace(shrinkage, shares=(*shrinkage.shares, share))
    alike = shrinkage.of("test")
    tests = alike.evidence if alike else ()
    shrinkage = replace(shrinkage, shares=tuple(one.foretelling(tests, seed) for one in shrinkage.shares))
    return (shrinkage, "") if shrinkage.shares else (None, shrinkage.reason)
