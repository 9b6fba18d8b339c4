"""Campaigns: what was measured, its files, import from other formats, and the quality of the data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.runtime.late_imports import at_first_use

if TYPE_CHECKING:
    from mofit.data.campaign import Campaign, Experiment, Measurement, overview
    from mofit.data.campaign_file import bundled_campaign, read_campaign, write_campaign
    from mofit.data.importers.importer import import_files
    from mofit.data.importers.map_proposal import propose_map
    from mofit.data.join import joined, read_joined
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
    "read_joined",
    "write_campaign",
]

# the process that reads a binary file needs none of them
__getattr__ = at_first_use(
    __name__,
    {
        "Campaign": "campaign",
        "Experiment": "campaign",
        "Measurement": "campaign",
        "bundled_campaign": "campaign_file",
        "campaign_warnings": "quality",
        "check_campaign": "quality",
        "import_files": "importers.importer",
        "joined": "join",
        "overview": "campaign",
        "propose_map": "importers.map_proposal",
        "read_campaign": "campaign_file",
        "read_joined": "join",
        "write_campaign": "campaign_file",
    },
)
