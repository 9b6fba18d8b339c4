"""Models and effects: symbols in, one differentiable system out."""

from mofit.models.black_box import Record, Simulator
from mofit.models.black_box_system import BlackBoxSystem
from mofit.models.effect import Addition, Effect, Scaling, incompatibility, with_effects
from mofit.models.model import TARGET_UNIT, Applied, Channel, Condition, Equations, MaxwellBranch, Model, Stage, Symbols
from mofit.models.part_drift import drifts_of
from mofit.models.registry import default_model, effect_names, find_effect, find_model, model_names
from mofit.models.system import build_system
from mofit.models.vector_form import System

__all__ = [
    "TARGET_UNIT",
    "Addition",
    "Applied",
    "BlackBoxSystem",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "MaxwellBranch",
    "Model",
    "Record",
    "Scaling",
    "Simulator",
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
