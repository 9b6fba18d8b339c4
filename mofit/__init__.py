"""Identify dynamic models from rig data.

The names below are the public face. Each is imported at first use, so ``import mofit`` costs next to nothing.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mofit.campaign import Campaign, Measurement, Procedure
    from mofit.campaign_file import read_campaign, write_campaign
    from mofit.identify import identify
    from mofit.library import find_effect, find_model
    from mofit.model import Applied, Channel, Condition, Effect, Equations, Model, Stage, Symbols, with_effects
    from mofit.parameters import Parameter, ParameterSpace
    from mofit.report.inline import report_page
    from mofit.result import open_result as open
    from mofit.simulate import simulate

__version__ = "0.1.0"

#: public name -> (module, name there)
_HOMES = {
    **{name: ("mofit.campaign", name) for name in ("Campaign", "Measurement", "Procedure")},
    **{name: ("mofit.campaign_file", name) for name in ("read_campaign", "write_campaign")},
    **{name: ("mofit.parameters", name) for name in ("Parameter", "ParameterSpace")},
    **{
        name: ("mofit.model", name)
        for name in (
            "Applied",
            "Channel",
            "Condition",
            "Effect",
            "Equations",
            "Model",
            "Stage",
            "Symbols",
            "with_effects",
        )
    },
    **{name: ("mofit.library", name) for name in ("find_effect", "find_model")},
    "diagnose": ("mofit.diagnosis.diagnose", "diagnose"),
    "identify": ("mofit.identify", "identify"),
    "open": ("mofit.result", "open_result"),
    "report_page": ("mofit.report.inline", "report_page"),
    "simulate": ("mofit.simulate", "simulate"),
}

__all__ = [
    "Applied",
    "Campaign",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "Measurement",
    "Model",
    "Parameter",
    "ParameterSpace",
    "Procedure",
    "Stage",
    "Symbols",
    "__version__",
    "diagnose",
    "find_effect",
    "find_model",
    "identify",
    "open",
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


class _Face(ModuleType):
    """Keeps ``mofit.identify`` the function when the module ``mofit/identify.py`` is imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Face
