"""Models and effects: symbols in, one differentiable system out."""

from mofit.model.effect import UNIT_OF_TARGET, Applied, Effect
from mofit.model.extended import why_not, with_effects
from mofit.model.load import load_class
from mofit.model.model import Channel, Condition, Equations, Model, Stage
from mofit.model.symbols import Symbols
from mofit.model.system import System, build_system

__all__ = [
    "UNIT_OF_TARGET",
    "Applied",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "Model",
    "Stage",
    "Symbols",
    "System",
    "build_system",
    "load_class",
    "why_not",
    "with_effects",
]
