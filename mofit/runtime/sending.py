"""Objects for other processes: pickled once, with the user's file that they are from."""

from __future__ import annotations

import pickle
import sys
from dataclasses import dataclass
from hashlib import sha256
from importlib.util import decode_source
from pathlib import Path
from types import ModuleType
from typing import Any

import cloudpickle

from mofit.errors import InputError

#: attribute of a module that `run_file` made: what it ran
_SOURCE = "__mofit_source__"


@dataclass(frozen=True)
class Sendable:
    """An object as bytes, for `received`."""

    key: str
    """Hash of the content."""
    content: bytes


def sendable(value: Any, where: str) -> Sendable:
    """An object as bytes that any process can read that has mofit and the packages that the object uses.

    What a script, a notebook or a function defines goes along as it is (by cloudpickle); what a user's file defines is
    named, and the file goes along.

    Raises
    ------
    InputError
        If the object, named by ``where`` in the message, cannot be sent.
    """
    try:
        pickled = cloudpickle.dumps(value)
    except Exception as error:  # whatever an object's own __reduce__ raises
        message = f"cannot be sent to another process ({type(error).__name__}: {error})"
        raise InputError.of(where, message, "Open files, libraries and connections inside of the function") from error
    files = [
        (name, found["__file__"], found[_SOURCE])
        for name, module in list(sys.modules.items())
        if name.encode() in pickled and _SOURCE in (found := getattr(module, "__dict__", {}))
    ]
    content = pickle.dumps((files, pickled))
    return Sendable(sha256(content).hexdigest(), content)


def received(content: bytes) -> Any:
    """The object of a `Sendable`; files of users that it is from are run once per process."""
    files, pickled = pickle.loads(content)
    for name, path, source in files:
        if getattr(sys.modules.get(name), _SOURCE, None) != source:
            run_file(name, Path(path), source)
    return pickle.loads(pickled)


def run_file(name: str, path: Path, source: str | None = None) -> ModuleType:
    """A file of Python, or the source that it had, as a module of that name. Its objects can be sent."""
    if source is None:
        source = decode_source(path.read_bytes())
    module = ModuleType(name)
    module.__file__ = str(path)
    vars(module)[_SOURCE] = source
    sys.modules[name] = module
    exec(compile(source, str(path), "exec"), vars(module))
    return module
