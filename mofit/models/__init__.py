"""Models and effects: symbols in, one differentiable system out."""

from mofit.models.black_box import Record, Simulator
from mofit.models.black_box_system import BlackBoxSystem
from mofit.models.effect import Addition, Effect, Scaling
from mofit.models.extended_model import apart, base_and_effects, incompatibility, with_effects
from mofit.models.law import (
    CONSTANT,
    FORMS,
    FREE,
    SHARED,
    Law,
    as_laws,
    law_issues,
    law_parameters,
    laws_of,
    values_under,
    with_laws,
)
from mofit.models.model import TARGET_UNIT, Applied, Channel, Condition, Equations, MaxwellBranch, Model, Stage, Symbols
from mofit.models.part_drift import drifts_of
from mofit.models.registry import default_model, effect_names, find_effect, find_model, model_names
from mofit.models.system import build_system
from mofit.models.vector_form import System

__all__ = [
    "CONSTANT",
    "FORMS",
    "FREE",
    "SHARED",
    "TARGET_UNIT",
    "Addition",
    "Applied",
    "BlackBoxSystem",
    "Channel",
    "Condition",
    "Effect",
    "Equations",
    "Law",
    "MaxwellBranch",
    "Model",
    "Record",
    "Scaling",
    "Simulator",
    "Stage",
    "Symbols",
    "System",
    "apart",
    "as_laws",
    "base_and_effects",
    "build_system",
    "default_model",
    "drifts_of",
    "effect_names",
    "find_effect",
    "find_model",
    "incompatibility",
    "law_issues",
    "law_parameters",
    "laws_of",
    "model_names",
    "values_under",
    "with_effects",
    "with_laws",
]
