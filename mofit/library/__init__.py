"""Shipped models and effects, found by name and imported when asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TypeVar, cast

from mofit.errors import InputError, did_you_mean
from mofit.model import Effect, Model, load_class

T = TypeVar("T", Model, Effect)

_MODELS = {
    "maxwell_tyre": "maxwell_tyre:MaxwellTyre",
    "kelvin_voigt_tyre": "kelvin_voigt_tyre:KelvinVoigtTyre",
    "tmeasy_curve": "tmeasy:TMeasyCurve",
    "quasi_static_spring": "quasi_static_spring:QuasiStaticSpring",
    "maxwell_damper": "damper:MaxwellDamper",
    "kelvin_voigt_damper": "damper:KelvinVoigtDamper",
    "bouc_wen_damper": "bouc_wen_damper:BoucWenDamper",
    "oscillator": "oscillator:Oscillator",
    "duffing_oscillator": "oscillator:DuffingOscillator",
}

_EFFECTS = {
    "second_branch": "effects.second_branch:SecondBranch",
    "relaxation_spectrum": "effects.relaxation_spectrum:RelaxationSpectrum",
    "dry_friction": "effects.dry_friction:DryFriction",
    "quadratic_damping": "effects.quadratic_damping:QuadraticDamping",
    "cubic_stiffness": "effects.cubic_stiffness:CubicStiffness",
    "asymmetric_stiffness": "effects.asymmetric_stiffness:AsymmetricStiffness",
    "slip_offset": "effects.slip_offset:SlipOffset",
    "force_offset": "effects.force_offset:ForceOffset",
    "force_gain": "effects.force_gain:ForceGain",
}


def model_names() -> tuple[str, ...]:
    """Names of the shipped models."""
    return tuple(_MODELS)


def effect_names() -> tuple[str, ...]:
    """Names of the shipped effects."""
    return tuple(_EFFECTS)


def find_model(reference: str) -> Model:
    """The shipped model of that name, or the user's own from ``path/to/file.py:Name``.

    Raises
    ------
    InputError
        If there is none; names the closest one.
    """
    return _find(reference, "model", _MODELS, Model)


def find_effect(reference: str) -> Effect:
    """The shipped effect of that name, or the user's own from ``path/to/file.py:Name``.

    Raises
    ------
    InputError
        If there is none; names the closest one.
    """
    return _find(reference, "effect", _EFFECTS, Effect)


def _find(reference: str, what: str, table: dict[str, str], kind: type[T]) -> T:
    if reference in table:
        module, _, name = table[reference].partition(":")
        return cast(T, getattr(import_module(f"{__name__}.{module}"), name)())
    if reference.partition(":")[0].endswith(".py"):
        return load_class(reference, kind)()
    raise InputError.of(
        f"{what} '{reference}'",
        "unknown name",
        f"{did_you_mean(reference, table)} An own {what} is given as path/to/file.py:Name",
    )
