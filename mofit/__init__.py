"""Identify dynamic models from rig data.

The names below are the public face. Each is imported at first use, so ``import mofit`` costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mofit.data.campaign import Campaign, Experiment, Measurement
    from mofit.data.campaign_file import read_campaign, write_campaign
    from mofit.data.importers.importer import import_files
    from mofit.data.importers.map_proposal import propose_map
    from mofit.data.quality import check_campaign
    from mofit.errors import InputError, WriteError
    from mofit.identification.settings import Settings
    from mofit.models import (
        Applied,
        Channel,
        Condition,
        Effect,
        Equations,
        Model,
        Record,
        Simulator,
        Stage,
        Symbols,
        find_effect,
        find_model,
        with_effects,
    )
    from mofit.parameters import Parameter, ParameterSpace
    from mofit.report import report_page
    from mofit.simulation.virtual_rig.rig import simulate
    from mofit.workflows.api import batch, diagnose, identify, predict, uncertainty
    from mofit.workflows.api import open_run as open
    from mofit.workflows.export import export
    from mofit.workflows.planning import compare, design
    from mofit.workflows.shown import summary

__version__ = "0.1.0"

#: public name -> (module, name there)
_HOMES = {
    **{name: ("mofit.data", name) for name in ("Campaign", "Measurement", "Experiment")},
    **{name: ("mofit.data", name) for name in ("read_campaign", "write_campaign")},
    **{name: ("mofit.parameters", name) for name in ("Parameter", "ParameterSpace")},
    **{
        name: ("mofit.models", name)
        for name in (
            "Applied",
            "Channel",
            "Condition",
            "Effect",
            "Equations",
            "Model",
            "Record",
            "Simulator",
            "Stage",
            "Symbols",
            "find_effect",
            "find_model",
            "with_effects",
        )
    },
    **{name: ("mofit.errors", name) for name in ("InputError", "WriteError")},
    **{name: ("mofit.data", name) for name in ("check_campaign", "import_files", "propose_map")},
    **{name: ("mofit.workflows.api", name) for name in ("batch", "diagnose", "identify", "predict", "uncertainty")},
    **{name: ("mofit.workflows.planning", name) for name in ("compare", "design")},
    "Settings": ("mofit.identification.settings", "Settings"),
    "export": ("mofit.workflows.export", "export"),
    "open": ("mofit.workflows.api", "open_run"),
    "report_page": ("mofit.report", "report_page"),
    "simulate": ("mofit.simulation.virtual_rig", "simulate"),
    "summary": ("mofit.workflows.shown", "summary"),
}

__all__ = [
    "Applied",
    "Campaign",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "Experiment",
    "InputError",
    "Measurement",
    "Model",
    "Parameter",
    "ParameterSpace",
    "Record",
    "Settings",
    "Simulator",
    "Stage",
    "Symbols",
    "WriteError",
    "__version__",
    "batch",
    "check_campaign",
    "compare",
    "design",
    "diagnose",
    "export",
    "find_effect",
    "find_model",
    "identify",
    "import_files",
    "open",
    "predict",
    "propose_map",
    "read_campaign",
    "report_page",
    "simulate",
    "summary",
    "uncertainty",
    "with_effects",
    "write_campaign",
]


def __getattr__(name: str) -> Any:
    try:
        module, original = _HOMES[name]
    except KeyError:
        raise AttributeError(f"module 'mofit' has no attribute '{name}'") from None
    value = getattr(import_module(module), original)
    setattr(sys.modules[__name__], name, value)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
