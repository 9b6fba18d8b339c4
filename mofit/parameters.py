"""Parameters with units and bounds, the unit cube of the free ones, and their place among all of a system."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors, repeated

#: scopes of a parameter; any other is the name of a condition, or several with commas
PER_CAMPAIGN, PER_TEST = "campaign", "test"


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model or an effect, in SI units."""

    name: str
    """Identifier, as in the model's equations."""
    unit: str
    """SI unit, e.g. ``"N s/m"``; ``"1"`` if it has none."""
    lower: float
    upper: float
    """Bounds of the box that is searched: a range, which an identification widens where the best fit lies at it."""
    nominal: float
    """A typical value inside the bounds; used where nothing was identified."""
    scale: Literal["linear", "log"] = "linear"
    """``"log"`` for a positive scale parameter (its logarithm is searched), else ``"linear"``."""
    description: str = ""
    """A few words for tables and reports."""
    neutral: float | None = None
    """For effects: the value at which the effect vanishes."""
    grid: tuple[float, ...] = ()
    """For effects: values to try of a parameter that means nothing while the effect is not there."""
    limits: tuple[float, float] | None = None
    """Values that are possible at all; the range is never widened beyond them. By default a bound at zero is one, and a
    log scale stays positive."""
    scales: tuple[tuple[str, float], ...] = ()
    """How range, nominal value and grid grow with the data: powers of channels, see `powers` and `Model.typical`;
    ``"one or another"`` where a model has either."""
    per: str = PER_CAMPAIGN
    """What it has one value of: the ``"campaign"``, every ``"test"``, or every value of a condition, by its name; by
    several names, with commas, every combination of their values."""
    pooled: bool = False
    """Whether the values of its tests or conditions are drawn from a normal, whose spread is estimated along."""

    @property
    def possible(self) -> tuple[float, float]:
        """The limits, given or by default."""
        if self.limits is not None:
            return self.limits
        return (0.0 if self.scale == "log" or self.lower == 0 else -math.inf, 0.0 if self.upper == 0 else math.inf)

    def times(self, factor: float) -> Parameter:
        """The parameter with range, nominal and special values times a factor above 0."""
        return replace(
            self,
            lower=self.lower * factor,
            upper=self.upper * factor,
            nominal=self.nominal * factor,
            neutral=None if self.neutral is None else self.neutral * factor,
            grid=tuple(value * factor for value in self.grid),
            limits=None if self.limits is None else (self.limits[0] * factor, self.limits[1] * factor),
        )

    def farther(self, side: int, factor: float = 10.0) -> Parameter:
        """The range widened at its lower (-1) or upper end (1), as far as the limits allow; itself if they don't.

        By that factor on a log scale, else so that the range is that many times as wide.
        """
        ends, room = [self.lower, self.upper], (factor - 1) * (self.upper - self.lower)
        k = 0 if side < 0 else 1
        wider = ends[k] * factor**side if self.scale == "log" else ends[k] + side * room
        ends[k] = float(np.clip(wider, *self.possible))
        return replace(self, lower=ends[0], upper=ends[1])

    def wider(self) -> Parameter:
        """The range widened at both ends, see `farther`: where a wide range costs nothing."""
        return replace(self.farther(1), lower=self.farther(-1).lower)

    def scoped(self, per: str | None = None, pooled: bool = False) -> Parameter:
        """The parameter with another scope, or pooled, if asked for; what is pooled has a value per test at least."""
        pooled, own = pooled or self.pooled, per or self.per
        return replace(self, per=PER_TEST if pooled and own == PER_CAMPAIGN else own, pooled=pooled)

    def issues(self) -> list[Issue]:
        """Everything that makes this parameter unusable."""
        box, found = f"[{self.lower:g}, {self.upper:g}]", []
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            found.append((f"bounds {box} are not finite", "Give finite bounds"))
        elif not self.lower < self.upper:
            message = f"lower bound {self.lower:g} is not below upper bound {self.upper:g}"
            found.append((message, "Swap or widen them"))
        elif not self.lower <= self.nominal <= self.upper:
            found.append((f"nominal value {self.nominal:g} lies outside {box}", "Move it inside the bounds"))
        if self.scale == "log" and not self.lower > 0:
            message = f"a log scale needs a lower bound above 0, got {self.lower:g}"
            found.append((message, "Raise it or use 'linear'"))
        special = [("grid value", value) for value in self.grid]
        if self.neutral is not None:
            special.insert(0, ("neutral value", self.neutral))
        for what, value in special:
            if not self.lower <= value <= self.upper:
                found.append((f"{what} {value:g} lies outside {box}", "Move it inside the bounds"))
        return [Issue(f"parameter '{self.name}'", message, hint) for message, hint in found]


def powers(**exponents: float) -> tuple[tuple[str, float], ...]:
    """``powers(force=1, displacement=-1)``: `Parameter.scales` of a stiffness."""
    return tuple(exponents.items())


@dataclass(frozen=True)
class ParameterSpace:
    r"""An ordered set of parameters, and the map between their values and the unit cube.

    With :math:`u \in [0, 1]`: linear scale :math:`p = l + u (h - l)`,
    log scale :math:`p = l (h / l)^u`.

    Raises
    ------
    InputError
        With every issue of every parameter (bounds, nominal value, names used twice).
    """

    parameters: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        issues = [issue for parameter in self.parameters for issue in parameter.issues()]
        issues += [
            Issue(f"parameter '{name}'", "the name is used twice", "Rename one of them")
            for name in repeated(self.names)
        ]
        raise_errors(issues)

    def __len__(self) -> int:
        return len(self.parameters)

    def __getitem__(self, name: str) -> Parameter:
        return self.parameters[self.index(name)]

    @property
    def names(self) -> tuple[str, ...]:
        """Names in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def units(self) -> tuple[str, ...]:
        """SI units in order."""
        return tuple(parameter.unit for parameter in self.parameters)

    @cached_property
    def lower(self) -> FloatArray:
        """Lower bounds, shape (d,)."""
        return np.array([parameter.lower for parameter in self.parameters], dtype=float)

    @cached_property
    def upper(self) -> FloatArray:
        """Upper bounds, shape (d,)."""
        return np.array([parameter.upper for parameter in self.parameters], dtype=float)

    @cached_property
    def nominal(self) -> FloatArray:
        """Nominal values, shape (d,)."""
        return np.array([parameter.nominal for parameter in self.parameters], dtype=float)

    @cached_property
    def _is_log(self) -> NDArray[np.bool_]:
        return np.array([parameter.scale == "log" for parameter in self.parameters], dtype=bool)

    @cached_property
    def _base(self) -> tuple[FloatArray, FloatArray]:
        """Origin and width of the box in scaled coordinates (log where the scale is log)."""
        low, high = self.lower.copy(), self.upper.copy()
        low[self._is_log], high[self._is_log] = np.log(low[self._is_log]), np.log(high[self._is_log])
        return low, high - low

    @property
    def log_width(self) -> FloatArray:
        """Natural logarithm of upper over lower bound where the scale is logarithmic, else 0; shape (d,)."""
        return np.where(self._is_log, self._base[1], 0.0)

    def index(self, name: str) -> int:
        """Position of a parameter.

        Raises
        ------
        InputError
            If there is none of that name; names the closest one.
        """
        try:
            return self.names.index(name)
        except ValueError:
            raise InputError.of(f"parameter '{name}'", "unknown name", did_you_mean(name, self.names)) from None

    def subset(self, names: Iterable[str]) -> ParameterSpace:
        """The space of the named parameters, in the order given."""
        return ParameterSpace(tuple(self[name] for name in names))

    def with_bounds(self, name: str, lower: float, upper: float) -> ParameterSpace:
        """The space with other bounds for one parameter, which are its limits too; its nominal value is clipped."""
        one = self[name]
        nominal = min(max(one.nominal, lower), upper)
        changed = replace(one, lower=lower, upper=upper, nominal=nominal, limits=(lower, upper))
        return ParameterSpace(tuple(changed if own.name == name else own for own in self.parameters))

    def farther(self, sides: ArrayLike) -> ParameterSpace:
        """The space with wider ranges where sides (d,) are -1 (at the lower end) or 1, see `Parameter.farther`."""
        ends = zip(self.parameters, np.asarray(sides).tolist(), strict=True)
        return ParameterSpace(tuple(one.farther(side) if side else one for one, side in ends))

    def to_unit(self, values: ArrayLike) -> FloatArray:
        """Map values, shape (..., d), to the unit cube."""
        scaled = np.array(values, dtype=float)
        scaled[..., self._is_log] = np.log(scaled[..., self._is_log])
        origin, width = self._base
        return (scaled - origin) / width

    def from_unit(self, unit: ArrayLike) -> FloatArray:
        """Map points of the unit cube, shape (..., d), to values."""
        origin, width = self._base
        values = origin + np.asarray(unit, dtype=float) * width
        values[..., self._is_log] = np.exp(values[..., self._is_log])
        return np.clip(values, self.lower, self.upper)

    def derivative(self, values: ArrayLike) -> FloatArray:
        """Derivative of value with respect to unit coordinate, shape (..., d)."""
        values = np.asarray(values, dtype=float)
        _, width = self._base
        return np.where(self._is_log, values * width, np.broadcast_to(width, values.shape))


@dataclass(frozen=True)
class ParameterLayout:
    """All parameters of a system in its order: free ones with their unit cube, the others at fixed values.

    Raises
    ------
    InputError
        With every parameter that is neither free nor fixed.
    """

    names: tuple[str, ...]
    """All p parameters, in the order in which the system takes them."""
    space: ParameterSpace
    """The d free ones."""
    fixed: Mapping[str, float]
    """Value of every other one; names that the system does not have are ignored."""

    def __post_init__(self) -> None:
        known = {*self.space.names, *self.fixed}
        raise_errors(
            Issue(f"parameter '{name}'", "it is neither free nor fixed", "Free it, or give its value")
            for name in self.names
            if name not in known
        )

    @classmethod
    def of_model(
        cls,
        parameters: Sequence[Parameter],
        space: ParameterSpace | None = None,
        fixed: Mapping[str, float] | None = None,
    ) -> ParameterLayout:
        """The layout of a model's parameters: all free by default; one that is not free is nominal by default."""
        space = ParameterSpace(tuple(parameters)) if space is None else space
        nominal = {p.name: p.nominal for p in parameters if p.name not in space.names}
        return cls(tuple(p.name for p in parameters), space, nominal | dict(fixed or {}))

    def values(self, u: FloatArray, names: Sequence[str]) -> FloatArray:
        """Values of named parameters, shape (N, len(names)), at points u (N, d) of the unit cube."""
        free = self.space.from_unit(u)
        columns = [
            free[:, self.space.index(name)] if name in self.space.names else np.full(len(u), self.fixed[name])
            for name in names
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((len(u), 0))

    def full(self, u: FloatArray) -> FloatArray:
        """Values of all parameters, shape (N, p), at points u (N, d) of the unit cube."""
        return self.values(u, self.names)

    def box(self, corners: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Lower and upper values of all parameters, (p,) each, over a part of the unit cube from corners (2, d)."""
        whole = np.array([[0.0], [1.0]]) * np.ones(len(self.space))
        lower, upper = self.full(whole if corners is None else corners)
        return lower, upper

    def with_fixed(self, values: Mapping[str, float]) -> ParameterLayout:
        """The layout with other values of parameters that are not free; those of free ones are ignored."""
        return replace(self, fixed={name: float(values.get(name, value)) for name, value in self.fixed.items()})
