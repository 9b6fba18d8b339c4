"""FMUs as simulators: what they declare, how they map to a campaign, how they are simulated."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from mofit.errors import InputError

#: ``model.fmu``, ``model.fmu:map.toml``, ``model.fmu:map.toml:k,d``, ``model.fmu::k,d``
REFERENCE = re.compile(r"(?P<path>.*\.fmu)(?::(?P<map>[^:]*))?(?::(?P<free>.*))?", re.IGNORECASE | re.DOTALL)


def is_fmu(reference: str) -> bool:
    """Whether the reference of a model names an FMU."""
    return REFERENCE.fullmatch(reference) is not None


def fmu_reference(model: str | None, map_file: Path | None, free: Iterable[str]) -> str | None:
    """The reference of a model with the map and the free parameters that options name; without these the model's own.

    Raises
    ------
    InputError
        If there are such options and the model is no FMU, or names a map itself.
    """
    names = [name.strip() for text in free for name in text.split(",") if name.strip()]
    given = [option for option, is_there in (("--map", map_file is not None), ("--free", bool(names))) if is_there]
    if not given:
        return model
    parts = REFERENCE.fullmatch(model or "")
    if parts is None:
        raise InputError.of(" and ".join(given), "say something of an FMU alone", "Give --model path/to/model.fmu")
    if (map_file and parts["map"]) or (names and parts["free"]):
        raise InputError.of(f"--model {model}", f"says what {' and '.join(given)} says", "Leave one of them out")
    return f"{parts['path']}:{map_file or parts['map'] or ''}:{','.join(names) or parts['free'] or ''}"
