"""Shipped models and effects, found by name and imported when asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TypeVar, cast

from mofit.errors import InputError, did_you_mean, raise_errors
from mofit.model import Effect, Model, load_class, why_not

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
    "contact_patch_lag": "effects.contact_patch_lag:ContactPatchLag",
    "delay": "effects.delay:Delay",
    "sensor_lowpass": "effects.sensor_lowpass:SensorLowpass",
    "inertia": "effects.inertia:Inertia",
    "second_branch": "effects.second_branch:SecondBranch",
    "springpot": "effects.springpot:Springpot",
    "relaxation_spectrum": "effects.relaxation_spectrum:RelaxationSpectrum",
    "dry_friction": "effects.dry_friction:DryFriction",
    "quadratic_damping": "effects.quadratic_damping:QuadraticDamping",
    "cubic_stiffness": "effects.cubic_stiffness:CubicStiffness",
    "payne": "effects.payne:Payne",
    "asymmetric_stiffness": "effects.asymmetric_stiffness:AsymmetricStiffness",
    "slip_offset": "effects.slip_offset:SlipOffset",
    "force_offset": "effects.force_offset:ForceOffset",
    "force_gain": "effects.force_gain:ForceGain",
    "cornering_stiffness": "effects.cornering_stiffness:CorneringStiffness",
    "friction_level": "effects.friction_level:FrictionLevel",
    "carcass_stiffness": "effects.carcass_stiffness:CarcassStiffness",
    "speed": "effects.speed:Speed",
    "steering_compliance": "effects.steering_compliance:SteeringCompliance",
    "load_coupling": "effects.load_coupling:LoadCoupling",
    "wheel_order": "effects.wheel_order:WheelOrder",
    "drum_runout": "effects.drum_runout:DrumRunout",
    "drift": "effects.drift:Drift",
    "warm_up": "effects.warm_up:WarmUp",
    "backlash": "effects.backlash:Backlash",
    "turn_slip": "effects.turn_slip:TurnSlip",
    "camber": "effects.camber:Camber",
    "cross_talk": "effects.cross_talk:CrossTalk",
    "coulomb_friction": "effects.coulomb_friction:CoulombFriction",
    "bouc_wen": "effects.bouc_wen:BoucWen",
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
        If there is none (names the closest one), or with everything that the user's own lacks.
    """
    effect = _find(reference, "effect", _EFFECTS, Effect)
    raise_errors(effect.faults())
    return effect


def candidates(model: Model) -> tuple[tuple[Effect, ...], dict[str, str]]:
    """The shipped effects that a model may leave out, and why it does not admit the others.

    Effects that are taken into account only when asked for (`Effect.candidate`) are in neither.
    """
    effects = [effect for effect in map(find_effect, effect_names()) if effect.candidate]
    refused = {effect.name: why_not(effect, model) for effect in effects}
    admitted = tuple(effect for effect in effects if refused[effect.name] is None)
    return admitted, {name: reason for name, reason in refused.items() if reason is not None}


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
