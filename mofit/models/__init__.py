"""Models and effects: symbols in, one differentiable system out."""

from mofit.models.effect import Addition, Effect, Scaling, incompatibility, with_effects
from mofit.models.model import TARGET_UNIT, Applied, Channel, Condition, Equations, MaxwellBranch, Model, Stage, Symbols
from mofit.models.part_drift import drifts_of
from mofit.models.registry import default_model, effect_names, find_effect, find_model, model_names
from mofit.models.system import System, build_system

__all__ = [
    "TARGET_UNIT",
    "Addition",
    "Applied",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "MaxwellBranch",
    "Model",
    "Scaling",
    "Stage",
    "Symbols",
    "System",
    "build_system",
    "default_model",
    "drifts_of",
    "effect_names",
    "find_effect",
    "find_model",
    "incompatibility",
    "model_names",
    "with_effects",
]
