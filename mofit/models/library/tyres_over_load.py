"""Tyre models over vertical load and inflation pressure: Rill's interpolation of the TMeasy quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import MappingProxyType

import casadi as ca

from mofit.models.library.aligning_torque import MaxwellTyreAligning
from mofit.models.library.combined_slip import MaxwellTyreCombined
from mofit.models.library.longitudinal_tyres import (
    KelvinVoigtTyreLongitudinal,
    MaxwellTyreLongitudinal,
    QuasiStaticSpringLongitudinal,
    TMeasyCurveLongitudinal,
)
from mofit.models.library.steady_state import QuasiStaticSpring, TMeasyCurve
from mofit.models.library.turn_slip import MaxwellTyreTurning
from mofit.models.library.tyres import KelvinVoigtTyre, MaxwellTyre
from mofit.models.model import Condition, Equations, Model, Symbols
from mofit.parameters import Parameter, powers

LOADED_CONDITIONS = (
    Condition("vertical_force", "N", None, "vertical load"),
    Condition("nominal_vertical_force", "N", None, "load of the nominal values; the others are at twice that"),
    Condition("inflation_pressure", "Pa", 2.5e5, "inflation pressure"),
    Condition("nominal_inflation_pressure", "Pa", 2.5e5, "pressure of the nominal values"),
)
#: share of the nominal value that a law never falls below: far off its loads a parabola turns round
LEAST = 0.01
#: what the name of such a model ends with
SUFFIX = "_over_load"
_NOMINAL = powers(nominal_vertical_force=1)


def quadratic(ratio: ca.SX, nominal: ca.SX, twice: ca.SX) -> ca.SX:
    r"""Parabola through zero load, for slopes and forces.

    .. math::
        Y(q) = q \left(2 Y_N - \tfrac12 Y_{2N} - (Y_N - \tfrac12 Y_{2N}) \, q\right), \qquad q = F_z / F_{zN}
    """
    return ratio * (2 * nominal - 0.5 * twice - (nominal - 0.5 * twice) * ratio)


def linear(ratio: ca.SX, nominal: ca.SX, twice: ca.SX) -> ca.SX:
    r"""Straight line, for slips, the trail and the stiffness of the carcass: :math:`Y_N + (Y_{2N} - Y_N) (q - 1)`."""
    return nominal + (twice - nominal) * (ratio - 1)


#: of a parameter its law, its usual ratio between twice the load and the load, and whether pressure changes it
LAWS: dict[str, tuple[Callable[[ca.SX, ca.SX, ca.SX], ca.SX], float, bool]] = {
    **dict.fromkeys(("dF0", "dF0_x"), (quadratic, 1.7, True)),
    **dict.fromkeys(("F_M", "F_Mx"), (quadratic, 1.9, True)),
    **dict.fromkeys(("s_M", "s_Mx"), (linear, 1.1, False)),
    **dict.fromkeys(("c_y", "c_x"), (linear, 1.1, True)),
    "n_0": (linear, 1.4, True),
    "s_0": (linear, 1.1, False),
    "l_phi": (linear, 1.4, False),
    "m_phi": (quadratic, 2.4, False),
}


def over_load(parameters: tuple[Parameter, ...]) -> Iterator[Parameter]:
    """The parameters with those that have a law at two loads, and their change with pressure."""
    for one in parameters:
        if one.name not in LAWS:
            yield one
            continue
        _, ratio, with_pressure = LAWS[one.name]
        scales = _NOMINAL if one.scales else ()
        yield replace(one, name=f"{one.name}_N", description=f"{one.description}, at the nominal load", scales=scales)
        twice = replace(one.times(ratio), limits=one.limits)
        yield replace(
            twice, name=f"{one.name}_2N", description=f"{one.description}, at twice the nominal load", scales=scales
        )
        if with_pressure:
            meaning = f"relative change of {one.name} per relative change of pressure"
            yield Parameter(f"{one.name}_p", "1", -2.0, 2.0, 0.0, description=meaning)


class OverLoad:
    r"""A tyre model whose parameters depend on vertical force :math:`F_z` and inflation pressure :math:`p` of a test.

    A parameter :math:`Y` with a law is given at the nominal load (``Y_N``) and at twice that (``Y_2N``):

    .. math::
        Y(F_z, p) = Y(F_z / F_{zN}) \left(1 + Y_p \, (p / p_N - 1)\right)

    Quadratic through zero for slopes and forces (`quadratic`), linear for slips, trail and carcass (`linear`).
    Equations and effects see ``Y`` at the conditions of the test. A subclass names this class and the model at one
    load.

    References
    ----------
    Rill, "Road Vehicle Dynamics", 2nd ed. (2020), section 3.3 (wheel load influence).
    """

    def __init_subclass__(cls) -> None:
        """What the model at one load declares, over load and pressure."""
        super().__init_subclass__()
        assert issubclass(cls, Model)
        cls.name, cls.title = f"{cls.name}{SUFFIX}", f"{cls.title} over load and pressure"
        cls.parameters = tuple(over_load(cls.parameters))
        cls.conditions = (*cls.conditions, *LOADED_CONDITIONS)
        # the ranges are written for a load, which is the nominal one here
        cls.typical = MappingProxyType({**cls.typical, "nominal_vertical_force": cls.typical["vertical_force"]})
        cls.baseline = cls.baseline and f"{cls.baseline}{SUFFIX}"
        cls.stages = tuple(replace(stage, model=f"{stage.model}{SUFFIX}") for stage in cls.stages)
        cls.default = False

    def equations(self, s: Symbols) -> Equations:
        """The equations of the model at the load and pressure of the test."""
        ratio = s.vertical_force / s.nominal_vertical_force
        overpressure = s.inflation_pressure / s.nominal_inflation_pressure - 1
        for name, (law, _, with_pressure) in LAWS.items():
            if f"{name}_N" not in s:
                continue
            nominal = getattr(s, f"{name}_N")
            value = law(ratio, nominal, getattr(s, f"{name}_2N"))
            if with_pressure:
                value *= 1 + getattr(s, f"{name}_p") * overpressure
            s.define(name, ca.fmax(value, LEAST * nominal))
        return super().equations(s)  # type: ignore[misc]


class TMeasyCurveOverLoad(OverLoad, TMeasyCurve):
    """Steady-state lateral force over slip, load and pressure: curves of many loads and pressures identified at once.

    See `OverLoad` for the laws and `TMeasyCurve` for the equations.
    """


class QuasiStaticSpringOverLoad(OverLoad, QuasiStaticSpring):
    """Non-linear lateral spring of the standing tyre over load and pressure.

    See `OverLoad` for the laws and `QuasiStaticSpring` for the equations.
    """


class KelvinVoigtTyreOverLoad(OverLoad, KelvinVoigtTyre):
    """Lateral Kelvin–Voigt tyre whose curve and carcass depend on load and pressure.

    See `OverLoad` for the laws and `KelvinVoigtTyre` for the equations.
    """


class MaxwellTyreOverLoad(OverLoad, MaxwellTyre):
    """Lateral Maxwell tyre whose curve and carcass depend on load and pressure; damper and branch are the same for all.

    See `OverLoad` for the laws and `MaxwellTyre` for the equations.
    """


class MaxwellTyreAligningOverLoad(OverLoad, MaxwellTyreAligning):
    """Lateral force and self-aligning torque over slip angle, load and pressure.

    See `OverLoad` for the laws and `MaxwellTyreAligning` for the equations.
    """


class MaxwellTyreTurningOverLoad(OverLoad, MaxwellTyreTurning):
    """Lateral force and self-aligning torque over slip angle, turn slip, load and pressure.

    See `OverLoad` for the laws and `MaxwellTyreTurning` for the equations.
    """


class TMeasyCurveLongitudinalOverLoad(OverLoad, TMeasyCurveLongitudinal):
    """Steady-state longitudinal force over slip, load and pressure.

    See `OverLoad` for the laws and `TMeasyCurveLongitudinal` for the equations.
    """


class QuasiStaticSpringLongitudinalOverLoad(OverLoad, QuasiStaticSpringLongitudinal):
    """Non-linear longitudinal spring of the standing tyre over load and pressure.

    See `OverLoad` for the laws and `QuasiStaticSpringLongitudinal` for the equations.
    """


class KelvinVoigtTyreLongitudinalOverLoad(OverLoad, KelvinVoigtTyreLongitudinal):
    """Longitudinal Kelvin–Voigt tyre whose curve and carcass depend on load and pressure.

    See `OverLoad` for the laws and `KelvinVoigtTyreLongitudinal` for the equations.
    """


class MaxwellTyreLongitudinalOverLoad(OverLoad, MaxwellTyreLongitudinal):
    """Longitudinal Maxwell tyre whose curve and carcass depend on load and pressure.

    See `OverLoad` for the laws and `MaxwellTyreLongitudinal` for the equations.
    """


class MaxwellTyreCombinedOverLoad(OverLoad, MaxwellTyreCombined):
    """Both forces of a tyre over slip ratio, slip angle, load and pressure.

    See `OverLoad` for the laws and `MaxwellTyreCombined` for the equations.
    """
