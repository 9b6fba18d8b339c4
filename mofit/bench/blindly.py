"""One campaign diagnosed for the check on withheld effects, from its file alone."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from mofit.campaign_file import read_campaign
from mofit.diagnosis.candidates import choose_effects
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.summary import summary
from mofit.diagnosis.workshop import Workshop
from mofit.library import find_model
from mofit.posing import choose_tests
from mofit.settings import Settings

MODEL = "maxwell_tyre"


def diagnose_blindly(campaign: Path, removed: str | None, target: Path) -> None:
    """Write ``<name>.json``, what ``mofit diagnose --json`` prints, and ``<name>.npz``, the held-out predictions.

    Parameters
    ----------
    campaign
        Campaign file.
    removed
        Effect that is no candidate; None for all that there are.
    target
        Folder to write into.
    """
    model, measured = find_model(MODEL), read_campaign(campaign)
    names: tuple[str, ...] = ()
    if removed is not None:
        admitted, _ = choose_effects(model, measured.select(choose_tests(model, measured, ())))
        names = tuple(effect.name for effect in admitted if effect.name != removed)
    found = diagnose(measured, model, names, Settings(jobs=1), workshop=_workshop())
    if found.shrinkage is not None:
        arrays = {
            f"{one.test}/{key}": np.asarray(getattr(one, key))
            for one in found.shrinkage.held_out
            for key in ("start", "before", "after")
        }
        np.savez_compressed(target / f"{campaign.stem}.npz", allow_pickle=False, **arrays)
    # the JSON comes last and at once: a result that is there is whole
    torn = target / f"{campaign.stem}.json.partial"
    torn.write_text(json.dumps(summary(found)) + "\n", encoding="utf-8")
    torn.replace(target / f"{campaign.stem}.json")


@cache
def _workshop() -> Workshop:
    """Compiled models, kept within a process."""
    return Workshop()
