"""FMUs as simulators: what they declare, how they map to a campaign, how they are simulated."""

import re

#: ``model.fmu``, ``model.fmu:map.toml``, ``model.fmu:map.toml:k,d``, ``model.fmu::k,d``
REFERENCE = re.compile(r"(?P<path>.*\.fmu)(?::(?P<map>[^:]*))?(?::(?P<free>.*))?", re.IGNORECASE | re.DOTALL)


def is_fmu(reference: str) -> bool:
    """Whether the reference of a model names an FMU."""
    return REFERENCE.fullmatch(reference) is not None
