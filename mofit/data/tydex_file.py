"""A measurement as a TYDEX file (TYDEX-Format, release 1.3), which the importer reads back to full precision."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mofit.data.campaign import Measurement
from mofit.errors import InputError, Issue, raise_errors
from mofit.quantities import known_unit, title_of

#: TYDEX names of what it knows, in its W axis system
NAMES = {
    "time": "RUNTIME",
    "slip_angle": "SLIPANGL",
    "slip_ratio": "LONGSLIP",
    "lateral_force": "FYW",
    "longitudinal_force": "FXW",
    "self_aligning_torque": "MZW",
    "vertical_force": "FZW",
    "longitudinal_velocity": "TRAJVELW",
    "inflation_pressure": "INFLPRES",
    "camber_angle": "INCLANGL",
}
#: longest name, comment and unit of a line
_NAME, _COMMENT, _UNIT = 10, 30, 10


def tydex_text(measurement: Measurement, title: str, units: Mapping[str, str] | None = None) -> str:
    """The text of a TYDEX file: time, inputs and outputs as channels, conditions as constants, all in SI units.

    Names that TYDEX does not know are those of mofit, in capitals and cut to nine letters. Numbers have all digits.

    Parameters
    ----------
    measurement
        The test.
    title
        Of the campaign; a comment.
    units
        SI units of conditions that `mofit.quantities` does not know.

    Raises
    ------
    InputError
        If two names are alike after they were cut, or a unit is longer than nine letters.
    """
    experiment, where = measurement.experiment, f"test '{measurement.name}'"
    channels = {"time": measurement.time, **experiment.inputs, **measurement.outputs}
    all_units = {"time": "s", **(units or {}), **measurement.units}
    names = _short_names(where, [*channels, *experiment.conditions], all_units)

    def line(name: str, numbers: Iterable[float]) -> str:
        unit = _unit(name, all_units)
        comment = _ascii(title_of(name))[: _COMMENT - 1]
        values = "".join(f"{number!r:<10}" for number in numbers)
        return f"{names[name]:<{_NAME}}{comment:<{_COMMENT}}{unit:<{_UNIT}}{values}".rstrip()

    # a constant must not run into its neighbour: one number per line
    constants = [line(name, [float(value)]) for name, value in experiment.conditions.items()]
    table = np.stack([np.asarray(values, dtype=float) for values in channels.values()], axis=1)
    rows = [" ".join(map(repr, row)) for row in table.tolist()]
    lines = ["**HEADER", _field("RELEASE", "Release of TYDEX-Format", "1.3")]
    lines += [_field("MEASID", "Measurement ID", _ascii(measurement.name)), "**COMMENTS", _ascii(title)]
    lines += ["**CONSTANTS", *constants, "**MEASURCHANNELS"]
    lines += [line(name, [1.0, 0.0, 0.0]) for name in channels]
    return "\n".join([*lines, f"**MEASURDATA {len(rows)}", *rows, "**END", ""])


def _field(name: str, comment: str, value: str) -> str:
    return f"{name:<{_NAME}}{comment:<{_COMMENT}}{'':<{_UNIT}}{value}"


def _unit(name: str, units: Mapping[str, str]) -> str:
    unit = units.get(name) or known_unit(name) or "1"
    return "-" if unit == "1" else unit


def _ascii(text: str) -> str:
    """One line that no program trips over."""
    return " ".join(text.encode("ascii", "replace").decode("ascii").split())


def _short_names(where: str, names: list[str], units: Mapping[str, str]) -> dict[str, str]:
    """Name in the file by name."""
    short = {name: NAMES.get(name, _ascii(name).replace(" ", "_").upper()[: _NAME - 1]) for name in names}
    issues = [
        Issue(f"{where}, '{name}'", f"its unit has more than {_UNIT - 1} letters", "Leave it out")
        for name in names
        if len(_unit(name, units)) >= _UNIT
    ]
    for name, own in short.items():
        alike = [other for other in names if short[other] == own]
        if alike[0] != name:
            what = f"and '{alike[0]}' are both '{own}' in TYDEX"
            issues.append(Issue(f"{where}, '{name}'", what, "Rename one of them: nine letters count"))
    raise_errors(issues)
    return short


def only_test(tests: tuple[str, ...], test: str | None) -> str:
    """The test to write: the one named, or the only one.

    Raises
    ------
    InputError
        If there are several and none is named: a TYDEX file holds one measurement.
    """
    if test is not None:
        return test
    if len(tests) != 1:
        what = f"the campaign has {len(tests)} tests, and a TYDEX file holds one measurement"
        raise InputError.of("--to tydex", what, f"Name one with --test: {', '.join(tests[:8])} …")
    return tests[0]
