"""A simulator of one's own: a function in place of equations, known by what it returns alone."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import casadi as ca
import numpy as np
from scipy.interpolate import PPoly

from mofit._typing import FloatArray
from mofit.errors import Issue, raise_errors
from mofit.models.interpolation import input_curve
from mofit.models.model import TIME, Channel, Condition, Equations, Model, Symbols
from mofit.parameters import Parameter

T = TypeVar("T")

#: ``function(record, parameters)``: the output over time (n,), or a mapping of the outputs' names to theirs
Function: TypeAlias = Callable[..., Any]


@dataclass(frozen=True)
class Record:
    """One test as a user's simulator sees it."""

    name: str
    time: FloatArray
    """Uniform, from 0 on, s; shape (n,)."""
    inputs: Mapping[str, FloatArray]
    """Every input over time by name, each (n,)."""
    conditions: Mapping[str, float]
    """Constants of the test by name."""
    interpolation: str = "cubic"
    """Of the inputs between samples: "cubic", "linear" or "hold", as the campaign says."""

    def curve(self, name: str) -> PPoly:
        """An input over time: ``record.curve("displacement")(t)`` is its value at t, s, between samples too."""
        return self._curves[name]

    @cached_property
    def _curves(self) -> dict[str, PPoly]:
        step = float(self.time[1] - self.time[0]) if len(self.time) > 1 else 1.0
        return {
            name: input_curve(step, np.asarray(values)[:, None], self.interpolation)
            for name, values in self.inputs.items()
        }

    @cached_property
    def digest(self) -> bytes:
        """Hash of all that a simulation can depend on."""
        found = sha256(self.interpolation.encode() + np.ascontiguousarray(self.time).tobytes())
        for name, values in sorted(self.inputs.items()):
            found.update(name.encode() + np.ascontiguousarray(values).tobytes())
        for name, value in sorted(self.conditions.items()):
            found.update(f"{name}={float(value)!r}".encode())
        return found.digest()


class Simulator(Model):
    """A model whose outputs a function computes: an ODE solver, a program, a table.

    Effects act on its inputs, outputs, parameters and conditions; what happens inside is out of their reach.

    Parameters
    ----------
    function
        ``function(record, parameters)`` returns the output over time, (n,), or a mapping from names of outputs to
        these. ``record`` is a `Record`, ``parameters`` maps names to numbers. What it raises, and what is not finite,
        counts as a failed simulation. ``function.sensitivities(record, parameters, free)`` may offer outputs (n, ny)
        and their derivatives (n, ny, nf) by the parameters of the names ``free``; else differences give them.
    parameters, inputs, outputs, conditions
        As those of a `Model`. The first input excites the tests.
    name, title
        By default the function's name.
    many
        Whether the function takes arrays (N,) of every parameter and returns outputs (N, n).
    fingerprint
        Text that changes whenever the function does; by default a hash of the file that it is written in.

    Raises
    ------
    InputError
        If something that it needs is missing or of another kind.

    Examples
    --------
    >>> def spring(record, parameters):
    ...     return parameters["k"] * record.inputs["displacement"]
    >>> model = Simulator(
    ...     spring,
    ...     parameters=[Parameter("k", "N/m", 1.0, 1e6, 1e3, "log")],
    ...     inputs=[Channel("displacement", "m")],
    ...     outputs=[Channel("force", "N")],
    ... )
    """

    def __init__(
        self,
        function: Function,
        parameters: Sequence[Parameter],
        inputs: Sequence[Channel],
        outputs: Sequence[Channel],
        *,
        name: str = "",
        title: str = "",
        conditions: Sequence[Condition] = (),
        many: bool = False,
        fingerprint: str | None = None,
    ) -> None:
        named = name or str(getattr(function, "__name__", type(function).__name__))
        _check(named, function, parameters=parameters, inputs=inputs, outputs=outputs, conditions=conditions)
        self.name, self.title = named, title or named.replace("_", " ")
        self.function, self.many = function, many
        self.parameters, self.inputs = tuple(parameters), tuple(inputs) or (TIME,)
        self.outputs, self.conditions = tuple(outputs), tuple(conditions)
        self.fingerprint = _fingerprint(function) if fingerprint is None else fingerprint
        self._shared: dict[Callable[..., Any], Any] = {}

    @property
    def dynamic(self) -> bool:
        """It may remember its past: nobody knows."""
        return True

    def equations(self, s: Symbols) -> Equations:
        """None but a symbol for each output, which effects act on; those on what goes in act first."""
        for group in (self.inputs, self.parameters, self.conditions):
            for one in group:
                getattr(s, one.name)
        return Equations(outputs={channel.name: ca.SX.sym(f"simulated_{channel.name}") for channel in self.outputs})

    def once(self, make: Callable[[Simulator], T]) -> T:
        """What ``make(simulator)`` gives, made at first use; copies with other ranges share it."""
        if make not in self._shared:
            self._shared[make] = make(self)
        found: T = self._shared[make]
        return found

    def with_shared(self, make: Callable[[Simulator], T], value: T) -> Simulator:
        """A copy that shares nothing with this one, and where `once` gives this value."""
        other = type(self).__new__(type(self))
        vars(other).update(vars(self))
        other._shared = {make: value}
        return other

    def __getstate__(self) -> dict[str, Any]:
        """What is shared stays where it is."""
        return {**vars(self), "_shared": {}}


def _check(name: str, function: Any, **declared: Sequence[Any]) -> None:
    """Raise what is wrong with the parts of a simulator."""
    where = f"simulator '{name}'"
    kinds = {"parameters": Parameter, "inputs": Channel, "outputs": Channel, "conditions": Condition}
    issues = []
    if not callable(function):
        issues.append(Issue(where, f"its function is a {type(function).__name__}", "Give function(record, parameters)"))
    for what, items in declared.items():
        wrong = [item for item in items if not isinstance(item, kinds[what])]
        if wrong:
            message = f"{what} hold a {type(wrong[0]).__name__}"
            issues.append(Issue(where, message, f"Give a list of mofit.{kinds[what].__name__}(…)"))
        elif not items and what in ("parameters", "outputs"):
            issues.append(Issue(where, f"it has no {what}", f"Give at least one of the {what}"))
    raise_errors(issues)


def _fingerprint(function: Function) -> str:
    """Hash of the file that a function, or the class of a callable object, is written in."""
    plain = inspect.unwrap(function)
    if not inspect.isroutine(plain):
        plain = getattr(plain, "func", type(plain))  # functools.partial
    try:
        text = Path(inspect.getsourcefile(plain) or "").read_bytes()
    except (OSError, TypeError):
        code = getattr(plain, "__code__", None)
        text = repr(plain).encode() if code is None else code.co_code + repr(code.co_consts).encode()
    return sha256(text).hexdigest()[:16]
