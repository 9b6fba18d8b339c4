"""Names of channels as test rigs spell them, and the parts of a column's header: name and unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from mofit.quantities import known_unit
from mofit.units import UnitError, is_unit, normal, si_unit

#: spellings per quantity, in small letters without signs between; the TYDEX name comes first where there is one
TIME = (
    "runtime",
    "time",
    "t",
    "timestamp",
    "timestamps",
    "zeit",
    "elapsedtime",
    "seconds",
    "sec",
    "tsec",
    "abszeit",
    "datetime",
    "date",
    "clock",
    "datum",
    "uhrzeit",
    "zeitstempel",
    "datumzeit",
    "datumuhrzeit",
    "progtime",
    "testtime",
    "totaltime",
    "runningtime",
    "times",
    "messzeit",
    "steptime",
)
_TYRE = {
    "slip_angle": "slipangl slipangle alpha alfa sa slip sideslip sideslipangle schraglaufwinkel schrag α steer "
    "steerangle steeringangle toe",
    "lateral_force": "fyw fyh fyc fy lateralforce latforce sideforce cornerforce corneringforce seitenkraft querkraft",
    "turn_slip": "turnslip pathcurvature spinslip wendeschlupf",
    "self_aligning_torque": "mzw mzh mzc mz aligningtorque selfaligningtorque selfaligningmoment aligningmoment "
    "ruckstellmoment sat",
}
_BRAKING = {
    "slip_ratio": "longslip slipratio kappa longitudinalslip sr sx wheelslip schlupf langsschlupf κ",
    "longitudinal_force": "fxw fxh fxc fx longitudinalforce longforce brakeforce drivingforce tractiveforce langskraft",
}
_LOAD = {"vertical_force": "fzw fzh fzc fz load wheelload verticalload verticalforce normalforce normalload radlast"}
_ROLLING = {
    **_LOAD,
    "longitudinal_velocity": "longvel trajvelw v vx speed velocity roadspeed beltspeed drumspeed longitudinalvelocity "
    "longitudinalspeed forwardspeed geschwindigkeit vroad vbelt vdrum",
    "inflation_pressure": "inflpres p pressure inflationpressure tyrepressure tirepressure pinfl reifendruck druck",
    "camber_angle": "inclangl camber camberangle gamma ia inclination inclinationangle sturz γ",
    "dynamic_rolling_radius": "rd rdyn re rolling radius rollingradius effectiveradius effectiverollingradius "
    "dynamicrollingradius dynrad",
}
_STATE = {
    "temperature": "temperature temp oiltemp oiltemperature tempoil ambitemp temperatur",
    "current": "current i coilcurrent strom amps",
}


@dataclass(frozen=True)
class Family:
    """Channels that belong together: all of ``needed`` make a test; spellings hold within the family only."""

    needed: tuple[str, str]
    spellings: Mapping[str, str]
    conditions: Mapping[str, str]


#: in the order in which they are tried
FAMILIES = (
    Family(("slip_angle", "lateral_force"), _TYRE, _ROLLING),
    Family(
        ("lateral_displacement", "lateral_force"),
        {
            "lateral_displacement": "lateraldisplacement latdisp lateraldeflection ydisp dy y uy querweg",
            "lateral_force": _TYRE["lateral_force"],
        },
        {**_LOAD, "inflation_pressure": _ROLLING["inflation_pressure"]},
    ),
    Family(("slip_ratio", "longitudinal_force"), _BRAKING, _ROLLING),
    Family(
        ("longitudinal_displacement", "longitudinal_force"),
        {
            "longitudinal_displacement": "longitudinaldisplacement longdisp longitudinaldeflection xdisp ux langsweg",
            "longitudinal_force": _BRAKING["longitudinal_force"],
        },
        {**_LOAD, "inflation_pressure": _ROLLING["inflation_pressure"]},
    ),
    Family(
        ("displacement", "force"),
        {
            "displacement": "displacement disp stroke travel position pos weg hub x s damperdisplacement "
            "damperposition pistonposition actuatorposition damperweg lvdt",
            "force": "force f fz fx load loadcell damperforce actuatorforce kraft damperkraft",
        },
        _STATE,
    ),
    Family(("angle", "torque"), {"angle": "angle phi theta winkel", "torque": "torque m moment drehmoment"}, _STATE),
    Family(
        ("strain", "stress"), {"strain": "strain epsilon eps dehnung ε", "stress": "stress sigma spannung σ"}, _STATE
    ),
    Family(
        ("current", "voltage"),
        {"current": _STATE["current"], "voltage": "voltage u v ucell cellvoltage spannung klemmenspannung"},
        {"temperature": _STATE["temperature"]},
    ),
    Family(
        ("input_voltage", "output_voltage"),
        {
            "input_voltage": "inputvoltage vin uin u input v1 ch1 drive",
            "output_voltage": "outputvoltage vout uout y output v2 ch2 response",
        },
        {},
    ),
)

#: name [unit], name (unit), name in unit, name / unit
_WITH_UNIT = (r"(.+?)\s*\[(.*)\]", r"(.+?)\s*\((.*)\)", r"(.+?)\s+in\s+(\S+)", r"(.+?)\s*/\s*(\S+)")
#: longest header that is parsed: the patterns need quadratic time
_LONGEST = 200
#: SI units of what is no channel or condition that mofit knows
_MORE_UNITS = {"time": "s", "voltage": "V", "frequency": "Hz"}
_PLAIN_LETTERS = str.maketrans("äöüéè", "aouee")


def name_and_unit(column: str, quantity: str) -> tuple[str, str | None]:
    """Name and unit of a header such as ``Fy [kN]``, ``Fy (kN)``, ``Fy in kN``, ``Fy/kN`` or ``Fy_kN``."""
    text = column.strip()
    if len(text) > _LONGEST:
        return text, None
    for pattern in _WITH_UNIT:
        if (match := re.fullmatch(pattern, text)) and (unit := read_unit(match[2], quantity)):
            return match[1], unit
    name, _, unit = text.rpartition("_")
    # one letter is rather an index than a unit: F_N is a force in N, but not T_A a temperature in A
    if name and (found := read_unit(unit, quantity)) and (len(unit) > 1 or unit in "NsmV"):
        return name, found
    return text, None


def read_unit(unit: str, quantity: str) -> str | None:
    """The unit as mofit reads it, also where capitals are wrong (``KN``, ``Deg``); None if it is none.

    Of several readings that which fits the quantity is taken: ``KN`` is a kilonewton for a force, not a knot.
    """
    unit = unit.strip()
    if unit in ("C", "c") and known_unit(quantity) == "K":
        return "degC"  # no coulomb
    tries = (unit, unit[:1].lower() + unit[1:], unit.lower(), unit[:1].lower() + unit[1:].upper(), unit.upper())
    readings = [normal(text) for text in tries if text and is_unit(text)]
    return next((text for text in readings if fits(quantity, text)), readings[0] if readings else None)


def key(name: str) -> str:
    """A name as the spellings are kept: small, without signs; of ``rig.alpha`` and ``g1.alpha`` the last part."""
    last = name.rpartition(".")[2] or name
    return re.sub(r"[^0-9a-zα-ω]", "", last.lower().translate(_PLAIN_LETTERS))


def fits(quantity: str, unit: str | None) -> bool:
    """Whether a unit can be one of the quantity; an unknown one may be any, and one of an unknown quantity, too."""
    wanted = known_unit(quantity) or _MORE_UNITS.get(quantity)
    try:
        return unit is None or wanted is None or si_unit(unit) == wanted
    except UnitError:
        return False
