"""Terms that a model may lack, in the field's forms, and effects that are made of them.

A form is a line of Python. The effect evaluates it, and the file of a proposal (`mofit.diagnosis.effect_file`) holds
the same line: what was fitted is what a user reads. Signals are relative to their largest magnitude in the data, so a
coefficient is what its term adds there at most or so, in the unit of the quantity that it acts on.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np

from mofit.diagnosis.inner_signals import Target, Variable
from mofit.models import TARGET_UNIT, Applied, Channel, Effect, Symbols
from mofit.parameters import Parameter


@dataclass(frozen=True)
class Shape:
    """A parameter that bends a form: its name, unit and range."""

    name: str
    unit: str
    lower: float
    upper: float
    description: str
    scale: Any = "linear"


@dataclass(frozen=True)
class Form:
    """What a term may look like.

    Parameters
    ----------
    title
        In words, with ``{x}`` and ``{y}`` for the signals.
    text
        The term per unit of its coefficient, with ``{p}`` for the shape parameter and ``{z}`` for the state.
    drives
        Derivative of the state; empty where the form has none.
    starts
        Initial value of the state.
    shape
        Of the parameter that bends it; None where nothing does.
    """

    title: str
    text: str
    drives: str = ""
    starts: str = "0"
    shape: Shape | None = None

    @property
    def length(self) -> int:
        """Of its text: how complicated it is."""
        return len(self.text) + len(self.drives)


@dataclass(frozen=True)
class Term:
    """A form of certain signals; ``point`` is its shape parameter, relative to a signal's scale or in s."""

    form: Form
    x: Variable
    y: Variable | None = None
    point: float | None = None

    @property
    def title(self) -> str:
        """In words."""
        return self._filled(self.form.title)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The signals that it reads."""
        return (self.x,) if self.y is None else (self.x, self.y)

    def acts_on(self, target: Target) -> bool:
        """Whether it may act there: what depends on an output acts on that output."""
        return all(one.name == target.name for one in self.variables if one.is_output)

    def line(self, template: str, parameter: str, state: str) -> str:
        """A line of the form for these signals, with the names of its shape parameter and its state."""
        return self._filled(template, p=parameter, z=state)

    def _filled(self, template: str, **names: str) -> str:
        x, y = self.x.name, self.y.name if self.y else ""
        return template.format(x=x, y=y, rate=self.x.rate, **names)


#: Near zero, relative to the largest magnitude, a power is rounded off: its slope may be infinite there.
_ROUND = "({x}**2 + 1e-6)"
#: Powers that are tried of an odd and of an even function.
_ODD, _EVEN = (0.5, 1.5, 2.0, 3.0, 5.0), (1.0, 2.0, 4.0)
#: Width over which a sign changes; thresholds within a signal's range; lengths of a hysteresis, relative to its span.
_WIDTHS, _THRESHOLDS, _LENGTHS = (0.02, 0.1), tuple(np.linspace(0.1, 0.9, 9)), (0.01, 0.03, 0.1, 0.3)
#: Largest coefficient, relative to the largest magnitude of the quantity or the largest estimate.
_REACH = 10.0
#: Number of time constants that are tried, from two sampling intervals to half a record.
_TIMES = 7


def static_terms(variables: Sequence[Variable]) -> list[Term]:
    """Functions of one signal, and products of two."""
    return [
        *(term for x in variables for term in functions_of(x)),
        *(term for x in variables for y in variables if x is not y for term in _of_two(x, y)),
        *(Term(Form("{x} times {y}", "{x} * {y}"), x, y) for x, y in combinations(variables, 2)),
    ]


def functions_of(x: Variable) -> Iterator[Term]:
    """Functions of one signal."""
    yield Term(Form("{x}", "{x}"), x)
    exponent = Shape("exponent", "1", 0.05, 8.0, "its exponent", "log")
    odd = Form("{x} times a power of its magnitude", f"{{x}} * {_ROUND} ** (({{p}} - 1) / 2)", shape=exponent)
    yield from (Term(odd, x, point=power) for power in _ODD)
    if x.signed:  # otherwise these are no others
        even = Form("a power of the magnitude of {x}", f"{_ROUND} ** ({{p}} / 2)", shape=exponent)
        yield from (Term(even, x, point=power) for power in _EVEN)
        width = Shape("width", "1", 1e-3, 1.0, "half the width over which it changes its sign, relative", "log")
        sign = Form("the sign of {x}", "ca.fmin(ca.fmax({x} / {p}, -1), 1)", shape=width)
        yield from (Term(sign, x, point=w) for w in _WIDTHS)
        beyond = Shape("threshold", "1", 1e-3, 2.0, "where it begins on both sides, relative", "log")
        form = Form("{x} beyond a threshold", "(ca.fmax({x} - {p}, 0) - ca.fmax(-{x} - {p}, 0))", shape=beyond)
        yield from (Term(form, x, point=share) for share in _THRESHOLDS)
    span = x.high - x.low
    # with the term the signal may go farther
    threshold = Shape("threshold", "1", x.low - span, x.high + span, "where it begins, relative")
    for side, text in (("above", "ca.fmax({x} - {p}, 0)"), ("below", "ca.fmax({p} - {x}, 0)")):
        form = Form(f"{{x}} {side} a threshold", text, shape=threshold)
        yield from (Term(form, x, point=x.low + share * span) for share in _THRESHOLDS)


def _of_two(x: Variable, y: Variable) -> Iterator[Term]:
    if x.signed:
        yield Term(Form("the magnitude of {x} times {y}", "ca.fabs({x}) * {y}"), x, y)
    yield Term(Form("the square of {x} times {y}", "{x} ** 2 * {y}"), x, y)


def memory_terms(variables: Sequence[Variable], shortest: float, longest: float) -> list[list[Term]]:
    """Signals and their magnitudes and squares behind a lag, also times a signal; one list per time constant in s."""
    points = np.geomspace(shortest, longest, _TIMES)
    # a lag below a sampling interval is none
    time = Shape("time", "s", shortest / 2, 20 * longest, "time constant of the memory", "log")
    return [[term for x in variables for term in _lagged(x, variables, time, float(point))] for point in points]


def _lagged(x: Variable, variables: Sequence[Variable], time: Shape, point: float) -> Iterator[Term]:
    drives = {"{x}": "{x}", "the magnitude of {x}": "ca.fabs({x})", "the square of {x}": "{x} ** 2"}
    for title, drive in drives.items():
        if title == "the magnitude of {x}" and not x.signed:
            continue
        lag, state = f"{title} behind a lag", f"({drive} - {{z}}) / {{p}}"
        yield Term(Form(lag, "{z}", state, drive, time), x, point=point)
        if title != "{x}":
            product = Form(f"({lag}) times {{y}}", "{z} * {y}", state, drive, time)
            yield from (Term(product, x, y, point) for y in variables)


def hysteresis_terms(variables: Sequence[Variable]) -> list[list[Term]]:
    """Hysteresis over a length (Dahl) of every signal whose rate is one too; one list per length."""
    moved = [x for x in variables if x.rate]
    found = []
    for share in _LENGTHS if moved else ():
        own = []
        for x in moved:
            length = Shape("length", x.unit, 1e-4 * x.scale, 10 * x.scale, "length over which it builds up", "log")
            state = "(s.{rate} - ca.fabs(s.{rate}) * {z}) / {p}"
            form = Form("a hysteresis of {x}", "{z}", state, shape=length)
            own.append(Term(form, x, point=share * (x.high - x.low) * x.scale))
        found.append(own)
    return found


@dataclass(frozen=True)
class PlacedTerm:
    """A term with the names of its coefficient, shape parameter and state in an effect, and its coefficient."""

    term: Term
    size: str
    shape: str = ""
    state: str = ""
    value: float = 0.0

    @property
    def text(self) -> str:
        """What it adds, as a line of Python."""
        return f"s.{self.size} * {self._line(self.term.form.text)}"

    @property
    def drives(self) -> str:
        """Derivative of its state as a line of Python."""
        return self._line(self.term.form.drives)

    @property
    def starts(self) -> str:
        """Initial value of its state as a line of Python."""
        return self._line(self.term.form.starts)

    def _line(self, template: str) -> str:
        return self.term.line(template, f"s.{self.shape}", f"s.{self.state}")

    def parameters(self, reach: float) -> tuple[Parameter, ...]:
        """Its coefficient, within plus and minus ``reach``, and its shape parameter."""
        size = Parameter(
            self.size, TARGET_UNIT, -reach, reach, float(np.clip(self.value, -reach, reach)),
            description=f"coefficient of {self.term.title}", neutral=0.0,
        )  # fmt: skip
        form, point = self.term.form, self.term.point
        if form.shape is None or point is None:
            return (size,)
        one = form.shape
        point = float(np.clip(point, one.lower, one.upper))
        shape = Parameter(self.shape, one.unit, one.lower, one.upper, point, one.scale, one.description, grid=(point,))
        return size, shape


class TermEffect(Effect):
    """Terms that act additively on a quantity."""

    def __init__(self, name: str, target: Target, terms: Sequence[PlacedTerm]) -> None:
        self.name, self.on = name, (target.name,)
        self.title = " and ".join(dict.fromkeys(placed.term.title for placed in terms))
        self.target, self.terms = target, tuple(terms)
        variables = {one.name: one for placed in terms for one in placed.term.variables}
        rates = {one.rate for placed in terms for one in placed.term.variables if "{rate}" in placed.term.form.drives}
        self.variables, self.signals = tuple(variables.values()), tuple(sorted({*variables, *rates}))
        self.inputs = tuple(one.channel for one in self.variables if one.derivative_of)
        inner = {one.name for one in self.variables if not (one.is_output or one.derivative_of)}
        self.needs = tuple(sorted(inner | rates))
        reach = _REACH * max([target.scale, *(abs(placed.value) for placed in terms)])
        own = {one.name: one for placed in terms for one in placed.parameters(reach)}
        self.parameters = tuple(own.values())
        with_state = {placed.state: placed for placed in terms if placed.state}
        self.stateful = tuple(with_state.values())
        self.states = tuple(Channel(one.state, "1", one.term.title) for one in self.stateful)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity with the terms."""
        terms, drives, starts = self.evaluated(s, value)
        states = [one.state for one in self.stateful]
        return Applied(
            value + sum(terms),
            dict(zip(states, drives, strict=True)),
            dict(zip(states, starts, strict=True)),
        )

    def evaluated(self, s: Any, value: ca.SX | None = None) -> tuple[list[ca.SX], list[ca.SX], list[ca.SX]]:
        """What every term adds; and of every state its derivative and its initial value.

        An output that it acts on is its ``value`` before; without one it is among the symbols.
        """
        names = {"ca": ca, "s": s}
        for one in self.variables:
            signal = value if one.is_output and value is not None else getattr(s, one.name)
            names[one.name] = signal / one.scale
        texts = (
            [placed.text for placed in self.terms],
            [one.drives for one in self.stateful],
            [one.starts for one in self.stateful],
        )
        # the lines are those of this module's forms
        terms, drives, starts = ([ca.SX(eval(line, names)) for line in lines] for lines in texts)
        return terms, drives, starts


def block(target: Target, terms: Sequence[Term]) -> TermEffect:
    """An effect of many terms, all absent; those with the same memory share its state."""
    states: dict[tuple[str, float | None], str] = {}
    placed = []
    for k, term in enumerate(terms):
        state, shape = "", f"shape_of_{k}"
        if term.form.drives:
            key = term.line(term.form.drives, "", ""), term.point
            state = states.setdefault(key, f"state_{len(states)}")
            shape = f"shape_of_{state}"
        placed.append(PlacedTerm(term, f"trial_{k}", shape, state))
    return TermEffect("trial", target, placed)


def proposed(target: Target, terms: Sequence[Term], sizes: Sequence[float], taken: Collection[str]) -> TermEffect:
    """An effect of a few terms with these coefficients, under names that are not taken."""
    placed, number = [], 0
    for term, size in zip(terms, sizes, strict=True):
        number += 1
        while f"size_{number}" in taken:
            number += 1
        shape, state = term.form.shape, f"memory_{number}" if term.form.drives else ""
        bent = f"{shape.name}_{number}" if shape else ""
        placed.append(PlacedTerm(term, f"size_{number}", bent, state, float(size)))
    name = next(name for k in range(1, len(taken) + 2) if (name := "proposed" + f"_{k}" * (k > 1)) not in taken)
    return TermEffect(name, target, placed)
