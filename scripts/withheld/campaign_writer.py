"""Campaign files (mofit.campaign/1), written with netCDF4 alone; every file looks the same but for its numbers."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import netCDF4
from numpy.typing import NDArray
from rig_tests import DRUM_RADIUS, LOAD, SPEED, WHEEL_RADIUS, RigTest

CONDITIONS = {
    "vertical_force": (LOAD, "N"),
    "longitudinal_velocity": (SPEED, "m/s"),
    "inflation_pressure": (2.75e5, "Pa"),
    "camber_angle": (0.0, "rad"),
    "dynamic_rolling_radius": (WHEEL_RADIUS, "m"),
    "drum_radius": (DRUM_RADIUS, "m"),
}


def write_file(path: Path, tests: Sequence[RigTest], forces: Sequence[NDArray]) -> None:
    """Write a campaign whole or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with netCDF4.Dataset(part, "w", format="NETCDF4") as file:
            file.setncatts(
                {"schema": "mofit.campaign/1", "title": "Car tyre on a drum, lateral", "source": "simulated"}
            )
            for name, (value, unit) in CONDITIONS.items():
                _scalar(file, name, value, unit)
            for test, force in zip(tests, forces, strict=True):
                _write_test(file, test, force)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def extend_file(source: Path, path: Path, test: RigTest, force: NDArray) -> None:
    """A copy of a campaign file with one more test."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        shutil.copyfile(source, part)
        with netCDF4.Dataset(part, "a") as file:
            _write_test(file, test, force)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _write_test(file: netCDF4.Dataset, test: RigTest, force: NDArray) -> None:
    group = file.createGroup(test.name)
    group.setncatts({"procedure": test.kind, "amplitude": test.amplitude, "interpolation": _interpolation(test)})
    if test.frequency:
        group.frequency = test.frequency
    if test.start_time is not None:
        group.start_time = test.start_time
    if test.kind != "quasi_static":
        _scalar(group, "wheel_phase", test.wheel_phase, "rad")
        _scalar(group, "drum_phase", test.drum_phase, "rad")
    if test.speed != SPEED:
        _scalar(group, "longitudinal_velocity", test.speed, "m/s")
    group.createDimension("time", len(test.time))
    channel, unit = ("lateral_displacement", "m") if test.kind == "quasi_static" else ("slip_angle", "rad")
    columns = (("time", test.time, "s"), (channel, test.command(test.time), unit), ("lateral_force", force, "N"))
    for name, values, of in columns:
        variable = group.createVariable(name, "f8", ("time",), zlib=True, complevel=2, shuffle=True)
        variable.units = of
        if name != "time":
            variable.role = "output" if name == "lateral_force" else "input"
        variable[:] = values


def _interpolation(test: RigTest) -> str:
    return "cubic" if test.kind == "sine" else "linear"


def _scalar(group: netCDF4.Dataset, name: str, value: float, unit: str) -> None:
    variable = group.createVariable(name, "f8", ())
    variable.units = unit
    variable[...] = value
