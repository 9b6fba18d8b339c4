"""Models and effects by name: shipped ones, found in their folders, and users' own."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from mofit.errors import InputError, did_you_mean, raise_errors
from mofit.models.black_box import Simulator
from mofit.models.effect import Effect
from mofit.models.fmu import is_fmu
from mofit.models.initial_state import PREFIX, InitialState
from mofit.models.model import Model
from mofit.models.part_drift import DRIFT_PREFIX, PartDrift
from mofit.models.users_code import users_code
from mofit.runtime.sending import run_file

T = TypeVar("T", Model, Effect)

#: folders of the shipped ones
_FOLDERS: dict[type, str] = {Model: "library", Effect: "effects"}


def model_names() -> tuple[str, ...]:
    """Names of the shipped models."""
    return tuple(_shipped(Model))


def effect_names() -> tuple[str, ...]:
    """Names of the shipped effects, ordered by file, then as the file defines them."""
    return tuple(_shipped(Effect))


def find_model(reference: str) -> Model:
    """The shipped model of that name, or the user's own from ``path/to/file.py:Name``: a class or a `Simulator`.

    ``path/to/model.fmu`` is a simulator, too, with a map and free parameters if need be: ``model.fmu:MAP.toml:k,d``.
    Its description is read; its native code is not loaded before the first simulation.

    Raises
    ------
    InputError
        If there is none; names the closest one.
    """
    if is_fmu(reference):
        from mofit.models.fmu.fmu_model import fmu_model

        return fmu_model(reference)
    return _find(reference, Model)


def find_effect(reference: str) -> Effect:
    """The shipped effect of that name, or the user's own from ``path/to/file.py:Name``.

    ``start:STATE`` makes the initial value of a state a parameter (`mofit.models.initial_state`), and ``drift:NAME``
    lets a part or a parameter of a model drift (`mofit.models.part_drift`).

    Raises
    ------
    InputError
        If there is none (names the closest one), or with everything that the user's own lacks.
    """
    effect = _find_effect(reference)
    raise_errors(effect.issues())
    return effect


def _find_effect(reference: str) -> Effect:
    for prefix, kind in ((PREFIX, InitialState), (DRIFT_PREFIX, PartDrift)):
        if reference.startswith(prefix):
            return kind(reference.removeprefix(prefix))
    return _find(reference, Effect)


def default_model(channels: Iterable[str]) -> Model:
    """The shipped model for a campaign with these channels.

    Raises
    ------
    InputError
        If no model that is a default has all its inputs and outputs among them, or several have.
    """
    have = set(channels)
    fitting = {
        kind: needed for kind in _shipped(Model).values() if kind.default and (needed := _channels(kind)) <= have
    }
    # one that takes all channels of another, and more, goes before it
    found = [kind for kind, own in fitting.items() if not any(own < other for other in fitting.values())]
    if len(found) != 1:
        message = f"models {', '.join(kind.name for kind in found)} fit" if found else "no model is known for them"
        raise InputError.of(f"channels {', '.join(sorted(have))}", message, "Name --model")
    return found[0]()


def _channels(kind: type[Model]) -> set[str]:
    """Names of what is measured for a model."""
    return {channel.name for channel in (*kind.inputs, *kind.outputs) if not channel.derivative_of}


@cache
def _shipped(kind: type[T]) -> dict[str, type[T]]:
    """Every class of a kind that a module of its folder defines, by the name it gives itself."""
    package = import_module(f"{__package__}.{_FOLDERS[kind]}")
    modules = [import_module(f"{package.__name__}.{found.name}") for found in pkgutil.iter_modules(package.__path__)]
    return {value.name: value for module in modules for value in _classes(module, kind).values()}


def _classes(module: ModuleType, kind: type[T]) -> dict[str, type[T]]:
    """Classes of a kind that a module defines itself, in its order."""
    return {
        name: value
        for name, value in vars(module).items()
        if inspect.isclass(value)
        and issubclass(value, kind)
        and value.__module__ == module.__name__
        and not inspect.isabstract(value)
    }


def _find(reference: str, kind: type[T]) -> T:
    shipped, what = _shipped(kind), kind.__name__.lower()
    if reference in shipped:
        return shipped[reference]()
    if reference.partition(":")[0].endswith(".py"):
        own = _own(reference, kind)
        if not inspect.isclass(own):
            return own
        with users_code(reference, f"making {own.__name__}", "Correct the file", inspect.getfile(own)):
            return own()
    hint = f"{did_you_mean(reference, shipped)} Name one of your own as path/to/file.py:Name"
    raise InputError.of(f"{what} '{reference}'", "unknown name", hint)


def _own(reference: str, kind: type[T]) -> type[T] | T:
    """The class ``Name`` of a kind in a user's file, or a simulator of that name.

    ``:Name`` may be left out if the file defines just one.
    """
    place, _, name = reference.partition(":")
    path = Path(place)
    if not path.is_file():
        raise InputError.of(reference, "no such file", "Give path/to/file.py:Name")
    with users_code(reference, "running it", "Correct the file", str(path)):
        module = run_file(f"mofit_user_{path.stem}", path)
    made = {
        key: value for key, value in vars(module).items() if isinstance(value, kind) and isinstance(value, Simulator)
    }
    found: dict[str, type[T] | T] = {**_classes(module, kind), **made}
    if name in found:
        return found[name]
    if name:
        raise InputError.of(reference, f"the file has no {kind.__name__} '{name}'", did_you_mean(name, found))
    if len(found) != 1:
        raise InputError.of(reference, f"the file defines {len(found)} classes of kind {kind.__name__}", "Append :Name")
    return next(iter(found.values()))
