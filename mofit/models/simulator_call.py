"""A call of a user's simulator, and what is wrong with its answer."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.models.black_box import Record
from mofit.models.users_code import users_code


class Response(NamedTuple):
    """What a simulator answered."""

    outputs: FloatArray | None
    """Shape (n, ny); None where it failed."""
    slopes: FloatArray | None
    """Derivatives by the free parameters, (n, ny, nf); None without any that are finite."""
    failure: str | None
    """Why there are no outputs."""


def call_simulator(
    function: Callable[..., Any],
    record: Record,
    parameters: Mapping[str, float],
    outputs: tuple[str, ...],
    free: tuple[str, ...],
) -> Response:
    """``function(record, parameters)``, or with ``free`` parameters its ``sensitivities`` where it offers them.

    What it raises, another shape than the record's, and values that are not finite are failures.
    """
    derive = getattr(function, "sensitivities", None) if free else None
    slopes = None
    try:
        with users_code("simulator", "it", "Correct the simulator", _file(function)):
            if derive is None:
                found = _columns(function(record, dict(parameters)), outputs)
            else:
                found, slopes = map(_array, derive(record, dict(parameters), free))
    except InputError as error:
        return Response(None, None, "; ".join(issue.message for issue in error.issues))
    failure = _failure(found, record, outputs)
    if failure is not None:
        return Response(None, None, failure)
    usable = slopes is not None and slopes.shape == (*found.shape, len(free)) and bool(np.all(np.isfinite(slopes)))
    return Response(found, slopes if usable else None, None)


def _columns(answer: Any, outputs: tuple[str, ...]) -> FloatArray:
    """Outputs side by side, (n, ny), from a mapping or from the samples of the only one."""
    if isinstance(answer, Mapping):
        missing = [name for name in outputs if name not in answer]
        if missing:
            raise InputError.of("simulator", f"it returned no {', '.join(missing)}", "Return every output")
    elif len(outputs) == 1:
        answer = {outputs[0]: answer}
    else:
        message = f"it returned a {type(answer).__name__}, not a mapping of {', '.join(outputs)}"
        raise InputError.of("simulator", message, "Return {output: samples}")
    columns = [_array(answer[name]) for name in outputs]
    shapes = {column.shape for column in columns}
    if len(shapes) != 1 or columns[0].ndim != 1:
        listed = ", ".join(f"{name} of shape {column.shape}" for name, column in zip(outputs, columns, strict=True))
        raise InputError.of("simulator", f"it returned {listed}", "Return one value per sample")
    return np.stack(columns, axis=1)


def _array(values: Any) -> FloatArray:
    return np.asarray(values, dtype=float)


def _failure(found: FloatArray, record: Record, outputs: tuple[str, ...]) -> str | None:
    """What makes outputs unusable."""
    expected = (len(record.time), len(outputs))
    if found.shape != expected:
        return f"it returned {found.shape[0] if found.ndim else 1} samples, not the record's {expected[0]}"
    finite = np.all(np.isfinite(found), axis=1)
    if finite.all():
        return None
    first = int(np.argmin(finite))
    return f"{'nan' if np.isnan(found[first]).any() else 'inf'} at {record.time[first]:g} s"


def _file(function: Callable[..., Any]) -> str:
    """Where a function, or the class of a callable object, is written; empty where that is unknown."""
    try:
        return inspect.getfile(function if inspect.isroutine(function) else type(function))
    except (TypeError, OSError):
        return ""
