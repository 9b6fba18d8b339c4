"""Campaigns: what was measured, its files, import from other formats, and the quality of the data."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mofit.data.campaign import Campaign, Experiment, Measurement, overview
    from mofit.data.campaign_file import bundled_campaign, read_campaign, write_campaign
    from mofit.data.importers.importer import import_files
    from mofit.data.importers.map_proposal import propose_map
    from mofit.data.join import joined
    from mofit.data.quality import campaign_warnings, check_campaign

__all__ = [
    "Campaign",
    "Experiment",
    "Measurement",
    "bundled_campaign",
    "campaign_warnings",
    "check_campaign",
    "import_files",
    "joined",
    "overview",
    "propose_map",
    "read_campaign",
    "write_campaign",
]

#: modules of the names, which are imported at first use: the process that reads a binary file needs none
_HOMES = {
    "bundled_campaign": "campaign_file",
    "campaign_warnings": "quality",
    "check_campaign": "quality",
    "import_files": "importers.importer",
    "joined": "join",
    "propose_map": "importers.map_proposal",
    "read_campaign": "campaign_file",
    "write_campaign": "campaign_file",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'campaign')}"), name)
