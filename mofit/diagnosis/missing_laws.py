"""Laws of parameters that the model takes for constant over the conditions: what is missing may be one of these."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from mofit.data import Campaign
from mofit.data.join import SPECIMEN
from mofit.models import Effect, Law, Model, base_and_effects, laws_of
from mofit.models.law import LawEffect
from mofit.parameters import PER_CAMPAIGN
from mofit.quantities import known_unit, title_of


def missing_laws(
    model: Model, campaign: Campaign, conditions: Sequence[str], fixed: Collection[str] = ()
) -> list[Effect]:
    """A linear law, as an effect to try, of every parameter over every condition over which it is constant.

    Parameters
    ----------
    model
        With the laws that it has.
    campaign
        The tests that are used.
    conditions
        What the tests state and may matter; specimens have no order, so that there is none over them.
    fixed
        Parameters that are given.
    """
    known = {(law.parameter, law.condition) for law in laws_of(model)}
    own = {one.name for one in base_and_effects(model)[0].parameters}
    free = [one for one in model.parameters if one.name in own and one.name not in fixed and one.per == PER_CAMPAIGN]
    found = list[Effect]()
    for condition in (name for name in conditions if name != SPECIMEN):
        values = np.unique([one.experiment.conditions[condition] for one in campaign.measurements])
        middle, half = float(values[[0, -1]].mean()), float(np.ptp(values)) / 2
        unit = known_unit(condition) or campaign.units.get(condition, "1")
        for one in free if half > 0 else ():
            if (one.name, condition) not in known:
                found.append(_candidate(LawEffect(Law(one.name, condition, "linear", middle, half, unit), one)))
    return found


def _candidate(effect: LawEffect) -> Effect:
    effect.candidate, effect.family = True, f"dependence on the {title_of(effect.law.condition)}"
    return effect
