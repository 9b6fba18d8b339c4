"""One rig's record written in every format, by the formats' own libraries."""

import json
from pathlib import Path

import numpy as np

SAMPLES = 400
UNITS = {"time": "s", "slip_angle": "deg", "lateral_force": "kN", "vertical_force": "N", "speed": "km/h"}
TYDEX_NAMES = {
    "time": "RUNTIME",
    "slip_angle": "SLIPANGL",
    "lateral_force": "FYW",
    "vertical_force": "FZW",
    "speed": "LONGVEL",
}


def record(seed=0):
    """A sine steer in the units of `UNITS`, with noise that fills every digit."""
    rng = np.random.default_rng(seed)
    time = np.arange(SAMPLES) / 100
    return {
        "time": time,
        "slip_angle": 4 * np.sin(2 * np.pi * time),
        "lateral_force": 3 * np.sin(2 * np.pi * time - 0.2) + 0.01 * rng.normal(size=SAMPLES),
        "vertical_force": 3000 + rng.normal(size=SAMPLES),
        "speed": 80 + 0.1 * rng.normal(size=SAMPLES),
    }


def write_csv(path: Path, data):
    rows = (";".join(repr(float(v)) for v in row) for row in zip(*data.values(), strict=True))
    path.write_text("\n".join([";".join(data), ";".join(UNITS[name] for name in data), *rows]))


def write_mat5(path: Path, data, do_compression=True):
    from scipy.io import savemat

    savemat(path, data, do_compression=do_compression)


def write_mat73(path: Path, data):
    """The way MATLAB does: its own 512 bytes first, vectors as rows of a transposed matrix, structs as groups."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            column = file.create_dataset(name, data=values[None, :], chunks=True, compression="gzip")
            column.attrs["MATLAB_class"] = np.bytes_("double")
        note = file.create_dataset("note", data=np.array([[82], [55]], dtype="u2"))
        note.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#").create_dataset("a", data=np.arange(3.0))
        rig = file.create_group("rig")
        rig.attrs["MATLAB_class"] = np.bytes_("struct")
        rig.create_dataset("gain", data=np.array([[2.0]])).attrs["MATLAB_class"] = np.bytes_("double")
        empty = rig.create_dataset("none", data=np.array([0, 0], dtype="u8"))
        empty.attrs["MATLAB_class"], empty.attrs["MATLAB_empty"] = np.bytes_("double"), 1
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


def write_mdf(path: Path, data, version="4.10", compression=2):
    from asammdf import MDF, Signal

    with MDF(version=version) as file:
        channels = [Signal(v, data["time"], unit=UNITS[n], name=n) for n, v in data.items() if n != "time"]
        file.append(channels, common_timebase=True)
        file.save(path, overwrite=True, compression=compression)


def write_tydex(path: Path, data):
    """By hand, in the columns of the manual: name 1-10, comment 11-40, unit 41-50, numbers from 51 on."""
    lines = ["**HEADER", f"{'RELEASE':10}{'Release of TYDEX-Format':30}{'':10}1.3", "", "**COMMENTS", "a rig", ""]
    lines += ["**CONSTANTS", "! Key     ! Comment", f"{'INFLPRES':10}{'Inflation pressure':30}{'bar':10}2.5"]
    lines += [f"{'LOCATION':10}{'Location':30}{'':10}Hall 3", "", "**MEASURCHANNELS"]
    lines += [f"{TYDEX_NAMES[n]:10}{n.replace('_', ' '):30}{UNITS[n]:10}{1:<10}{0:<10}{0:<10}" for n in data]
    lines += ["", f"**MEASURDATA {len(data['time'])}"]
    lines += [" ".join(repr(float(v)) for v in row) for row in zip(*data.values(), strict=True)]
    path.write_text("\n".join([*lines, "**END", ""]))


def write_json(path: Path, data):
    path.write_text(json.dumps({name: values.tolist() for name, values in data.items()} | {"note": "a rig"}))


def write_parquet(path: Path, data):
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(data), path)


def write_excel(path: Path, data):
    """Names, units, then rows, below a title."""
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["Rig 7"])
    book.active.append(list(data))
    book.active.append([UNITS[name] for name in data])
    for row in zip(*(values.tolist() for values in data.values()), strict=True):
        book.active.append(row)
    book.create_sheet("notes").append(["no numbers here"])
    book.save(path)


WRITERS = {
    "csv": write_csv,
    "json": write_json,
    "mat": write_mat5,
    "mat73": write_mat73,
    "mf4": write_mdf,
    "parquet": write_parquet,
    "tdx": write_tydex,
    "xlsx": write_excel,
}
#: packages of the extras that write and read a format
PACKAGES = {"mf4": "asammdf", "parquet": "pyarrow", "xlsx": "openpyxl"}
#: formats that hold no units
WITHOUT_UNITS = ("json", "mat", "mat73", "parquet")


def write(folder: Path, format: str, data=None) -> Path:
    """The record as ``run.<ending>`` in ``folder``."""
    path = folder / f"run.{'mat' if format == 'mat73' else format}"
    WRITERS[format](path, record() if data is None else data)
    return path


def map_of(path: Path, format: str) -> str:
    """A map that takes the file's own units where it has them."""
    names = TYDEX_NAMES if format == "tdx" else {name: name for name in UNITS}

    def entry(name):
        unit = f', unit = "{UNITS[name]}"' if format in WITHOUT_UNITS else ""
        return f'{{ column = "{names[name]}"{unit} }}'

    return f"""
title = "A tyre"
[[tests]]
name = "sine"
file = "{path.name}"
procedure = "sine"
frequency = "1 Hz"
time = {entry("time")}
[tests.channels]
slip_angle = {entry("slip_angle")}
lateral_force = {entry("lateral_force")}
[tests.conditions]
vertical_force = {entry("vertical_force")}
longitudinal_velocity = {entry("speed")}
"""
