"""An FMU as one file: description, sources, and a binary for this platform where a compiler is found."""

from __future__ import annotations

import os
import platform
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
import xarray as xr

from mofit.models import Model
from mofit.results.export import c_identifier
from mofit.results.fmu.description import Heading, build_description, model_description
from mofit.results.fmu.equations import equations_source
from mofit.results.fmu.scales import recorded_inputs
from mofit.results.fmu.variables import Contents, contents

FmiVersion = Literal["2", "3"]

#: files of every FMU, and those of a version
_COMMON = ("memory.h", "rodas4.h", "cosimulation.h")
_OF_VERSION = {
    "2": ("fmi2.c", "fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3.c", "fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_COMPILERS = ("cc", "gcc", "clang")
#: seconds that a compiler may take
_PATIENCE = 300
#: longest name of a model in C and in file names
_LONGEST = 60
#: the same bytes of the same content, whenever they are written
_EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Built:
    """What became of the binary of an FMU."""

    platform: str | None
    """Folder of the binary in the FMU; None for an FMU of sources alone."""
    note: str = ""
    """Why there is none."""


def write_fmu(
    tree: xr.DataTree,
    model: Model,
    path: Path,
    *,
    fmi: FmiVersion = "3",
    mode: str = "m1",
    test: str | None = None,
) -> Built:
    """Write the model of a run as an FMU for co-simulation.

    Parameters
    ----------
    tree, model
        A ``mofit.result/2`` tree, and its model with the effects (`mofit.results.export.model_of_run`).
    path
        File to write.
    fmi
        Version of FMI: 3.0 or 2.0.
    mode
        Mode whose posterior means are the start values.
    test
        Test whose conditions and values per test are taken; by default those common to all, and the mean.

    Raises
    ------
    InputError
        If the run lacks the mode, the test or a value, or if a condition differs between the tests and none is named.
    """
    found = contents(tree, model, mode, test)
    identifier = c_identifier(model.name)[:_LONGEST]
    equations, header = equations_source(found, identifier)
    own = files(__package__) / "c"
    shipped = {name: (own / name).read_bytes() for name in (*_COMMON, *_OF_VERSION[fmi])}
    sources = {**shipped, "equations.c": equations.encode(), "model.h": header.encode()}
    compiled = [name for name in sources if name.endswith(".c")]
    heading = _heading(tree, found, identifier, mode)
    entries = {
        "modelDescription.xml": model_description(found, heading, int(fmi), compiled),
        **{f"sources/{name}": text for name, text in sources.items()},
        "documentation/licenses/mofit.txt": (own / "LICENSE.txt").read_bytes(),
    }
    if fmi == "3":
        entries["sources/buildDescription.xml"] = build_description(identifier, compiled)
    folder, suffix = _platform(fmi)
    with TemporaryDirectory() as place:
        binary, note = _compiled(sources, Path(place), f"{identifier}{suffix}")
        if binary is not None:
            entries[f"binaries/{folder}/{identifier}{suffix}"] = binary
    _write_archive(path, entries)
    return Built(folder if binary is not None else None, note)


def _heading(tree: xr.DataTree, found: Contents, identifier: str, mode: str) -> Heading:
    records = [time for time, _ in recorded_inputs(tree, found.model).values() if len(time) > 1]
    length = max((float(time[-1] - time[0]) for time in records), default=1.0)
    step = min((float(np.median(np.diff(time))) for time in records), default=0.01)
    attrs = tree.attrs
    origin = f"{attrs.get('title', found.model.title or found.model.name)}; mode {mode} of an identification by mofit"
    try:
        created = datetime.fromisoformat(str(attrs.get("created", ""))).isoformat()
    except ValueError:
        created = ""
    return Heading(identifier, origin, created, length, step)


def _platform(fmi: FmiVersion) -> tuple[str, str]:
    """Folder of binaries for this machine, as the version of FMI names it, and the ending of a library."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system = "darwin" if sys.platform == "darwin" else "linux"
    suffix = ".dylib" if system == "darwin" else ".so"
    # FMI 2.0 names none but those of x86
    return (f"{system}64" if fmi == "2" and machine == "x86_64" else f"{machine}-{system}"), suffix


def _compiled(sources: Mapping[str, bytes], folder: Path, library: str) -> tuple[bytes | None, str]:
    """A shared library of the sources; None, and why, without a compiler that makes one."""
    command = _compiler()
    if not command:
        return None, "no C compiler was found: the FMU holds sources only, an importer must compile them"
    for name, text in sources.items():
        (folder / name).write_bytes(text)
    options = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-I."]
    units = [name for name in sources if name.endswith(".c")]
    try:
        subprocess.run(
            [*command, *options, *units, "-o", library, "-lm"],
            cwd=folder, check=True, capture_output=True, text=True, timeout=_PATIENCE,
        )  # fmt: skip
    except subprocess.CalledProcessError as error:
        reason = next((line for line in error.stderr.splitlines() if "error" in line), f"exit code {error.returncode}")
        return None, f"the C compiler failed, so the FMU holds sources only: {reason}"
    except (OSError, subprocess.TimeoutExpired) as error:
        return None, f"the C compiler failed, so the FMU holds sources only: {error}"
    return (folder / library).read_bytes(), ""


def _compiler() -> list[str]:
    """The command of a C compiler: ``CC``, else the first known one that is there."""
    try:
        given = shlex.split(os.environ.get("CC", ""))
    except ValueError:  # a quotation mark without the other
        given = []
    return given if given and shutil.which(given[0]) else [name for name in _COMPILERS if shutil.which(name)][:1]


def _write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in entries.items():
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, text)
