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
    from mofit.errors import InputError, WriteError
    from mofit.identification.identify import identify
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
    from mofit.prediction.predict import predict
    from mofit.report import report_page
    from mofit.results.io import open_result as open
    from mofit.simulation.virtual_rig.rig import simulate

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
    "diagnose": ("mofit.diagnosis.diagnose", "diagnose"),
    "identify": ("mofit.identification.identify", "identify"),
    "open": ("mofit.results", "open_result"),
    "predict": ("mofit.prediction.predict", "predict"),
    "report_page": ("mofit.report", "report_page"),
    "simulate": ("mofit.simulation.virtual_rig", "simulate"),
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
    "Simulator",
    "Stage",
    "Symbols",
    "WriteError",
    "__version__",
    "diagnose",
    "find_effect",
    "find_model",
    "identify",
    "open",
    "predict",
    "read_campaign",
    "report_page",
    "simulate",
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
