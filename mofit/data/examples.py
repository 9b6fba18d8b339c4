"""The campaign that ships with mofit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mofit.errors import InputError

NAME = "paper_campaign.nc"
_HERE = Path(__file__).resolve().parent
#: A wheel carries the file beside this module; in a checkout it is in ``data/`` beside the package.
PLACES = (_HERE, _HERE.parents[1] / "data")


def bundled_campaign(places: Sequence[Path] = PLACES) -> Path:
    """Path of the bundled (simulated) campaign: the first place that has it.

    Raises
    ------
    InputError
        If no place has it.
    """
    for folder in places:
        if (folder / NAME).is_file():
            return folder / NAME
    raise InputError.of("bundled campaign", f"this installation has no {NAME}", "Name a campaign FILE, or install anew")
