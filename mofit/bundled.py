"""Where the campaign that ships with mofit lies."""

from __future__ import annotations

from pathlib import Path

from mofit.errors import InputError

NAME = "paper_campaign.nc"


def bundled_campaign() -> Path:
    """Path of the bundled (simulated) campaign.

    A wheel carries the file as ``mofit/data/``; in a checkout it is ``data/`` beside the package.

    Raises
    ------
    InputError
        If the file is in neither place.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "data", package.parent / "data"):
        if (folder / NAME).is_file():
            return folder / NAME
    raise InputError.of("bundled campaign", f"this installation has no {NAME}", "Name a campaign FILE, or install anew")
