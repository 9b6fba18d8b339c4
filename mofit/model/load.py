"""Load a user's model or effect from ``path/to/file.py:Name``."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from pathlib import Path
from typing import TypeVar

from mofit.errors import InputError, did_you_mean

T = TypeVar("T")


def load_class(reference: str, kind: type[T]) -> type[T]:
    """The class ``Name`` of kind `Model` or `Effect` in a Python file.

    ``Name`` may be left out if the file defines just one.

    Raises
    ------
    InputError
        If the file is absent, cannot be run, or has no such class.
    """
    path_text, _, name = reference.partition(":")
    path = Path(path_text)
    if not path.is_file():
        raise InputError.of(reference, "no such file", "Give path/to/file.py:Name")
    spec = importlib.util.spec_from_file_location(f"mofit_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError.of(reference, "not a Python file", "Give path/to/file.py:Name")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError.of(reference, f"running it raised {type(error).__name__}: {error}", "Mend the file") from error
    found = {
        key: value
        for key, value in vars(module).items()
        if inspect.isclass(value)
        and issubclass(value, kind)
        and value.__module__ == module.__name__
        and not inspect.isabstract(value)
    }
    if name and name in found:
        return found[name]
    if not name and len(found) == 1:
        return next(iter(found.values()))
    if name:
        raise InputError.of(reference, f"the file has no {kind.__name__} '{name}'", did_you_mean(name, found))
    raise InputError.of(reference, f"the file defines {len(found)} classes of kind {kind.__name__}", "Append :Name")
