"""Inputs as people give them: a campaign or its file, a model or its name, one name or several."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mofit.data import Campaign, read_campaign
from mofit.errors import InputError
from mofit.models import Effect, Model, find_effect, find_model


def as_campaign(given: Campaign | str | Path) -> Campaign:
    """A campaign, or the one in a file.

    Raises
    ------
    InputError
        If the file cannot be used, or this is neither.
    """
    if isinstance(given, Campaign):
        return given
    if isinstance(given, str | Path):
        return read_campaign(given)
    raise InputError.of("campaign", f"is a {type(given).__name__}", "Give a campaign, or the path of its file")


def as_model(given: Model | type[Model] | str) -> Model:
    """A model, or the one of a name: a shipped one's, or ``path/to/file.py:Name``.

    Raises
    ------
    InputError
        If there is none of that name, or this is neither.
    """
    if isinstance(given, Model):
        return given
    if isinstance(given, str):
        return find_model(given)
    if isinstance(given, type) and issubclass(given, Model):
        return given()
    raise InputError.of("model", f"is a {type(given).__name__}", "Give a model, its name, or path/to/file.py:Name")


def as_effect(given: Effect | type[Effect] | str) -> Effect:
    """An effect, or the one of a name: a shipped one's, ``path/to/file.py:Name``, or ``start:STATE``.

    Raises
    ------
    InputError
        If there is none of that name, or this is neither.
    """
    if isinstance(given, Effect):
        return given
    if isinstance(given, str):
        return find_effect(given)
    if isinstance(given, type) and issubclass(given, Effect):
        return given()
    raise InputError.of("effect", f"is a {type(given).__name__}", "Give an effect, its name, or path/to/file.py:Name")


def as_effects(given: Effect | type[Effect] | str | Sequence[Effect | str]) -> tuple[Effect | str, ...]:
    """One effect or several, or their names, each once."""
    one = isinstance(given, str | Effect | type)
    return (given,) if one else tuple(dict.fromkeys(given))  # type: ignore[return-value, arg-type]


def as_names(given: str | Sequence[str]) -> tuple[str, ...]:
    """One name or several, each once."""
    return (given,) if isinstance(given, str) else tuple(dict.fromkeys(map(str, given)))
