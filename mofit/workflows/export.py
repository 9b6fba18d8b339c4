"""A run for other programs: the work of ``mofit export``."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import xarray as xr

from mofit.errors import Issue, raise_errors
from mofit.results import open_result
from mofit.runtime.files import atomic_path
from mofit.runtime.output_file import output_file

Format = Literal["toml", "csv", "casadi", "c", "fmu"]


@dataclass(frozen=True)
class Exported:
    """The file, and for an FMU its version of FMI, the platform of its binary, and what is to be said of it."""

    file: Path
    fmi: str | None = None
    platform: str | None = None
    note: str = ""


def export(
    run: xr.DataTree | str | Path,
    to: Format,
    *,
    mode: str = "m1",
    model: str | None = None,
    effects: Sequence[str] = (),
    fmi: Literal["3", "2"] | None = None,
    test: str | None = None,
    out: str | Path | None = None,
) -> Exported:
    """Export a run: parameters with uncertainty, the identified model as a function, or an FMU.

    Parameters
    ----------
    run
        Folder of a finished run, or its tree.
    to
        ``toml``, ``csv``: parameters of all modes. ``casadi``: a file for CasADi's ``Function.load``. ``c``: C source.
        ``fmu``: a Functional Mock-up Unit for co-simulation.
    mode
        Posterior mode: its MAP estimate goes into the function (``casadi``, ``c``), its posterior mean into the FMU.
    model, effects
        The run's own, if they are the user's: ``path/to/file.py:Name``.
    fmi, test
        Version of FMI (3 by default), and the test whose conditions the FMU starts with.
    out
        File to write; by default the model's name with the ending of the format.

    Raises
    ------
    InputError
        If options don't fit together, the run is not there, or the file exists.
    """
    raise_errors(
        Issue(f"--{option} {value}", f"is for an FMU, not for {to}", "Add --to fmu, or leave it out")
        for option, value in (("fmi", fmi), ("test", test))
        if value is not None and to != "fmu"
    )
    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    file = Path(re.sub("[^0-9A-Za-z_.-]", "_", f"{tree.attrs['model']}.{to}")) if out is None else Path(out)
    with output_file(file) as target, atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            _write_parameters(tree, temporary, to)
        elif to == "fmu":
            return _write_fmu(tree, temporary, target, fmi or "3", mode, model, effects, test)
        else:
            _write_function(tree, temporary, to, mode, model, effects)
    return Exported(target)


def _write_parameters(tree: xr.DataTree, file: Path, to: str) -> None:
    from mofit.results.export import parameters_csv, parameters_toml

    text = (parameters_toml if to == "toml" else parameters_csv)(tree)
    file.write_text(text, encoding="utf-8")


def _write_function(
    tree: xr.DataTree, file: Path, to: str, mode: str, model: str | None, effects: Sequence[str]
) -> None:
    from mofit.results.export import c_source, identified_function, model_of_run

    chosen = model_of_run(tree, model, tuple(effects))
    function = identified_function(tree, chosen, mode)
    if to == "casadi":
        function.save(str(file))
        return
    keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
    origin = {"mode": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
    file.write_text(c_source(function, chosen, origin), encoding="utf-8")


def _write_fmu(
    tree: xr.DataTree,
    file: Path,
    target: Path,
    fmi: Literal["3", "2"],
    mode: str,
    model: str | None,
    effects: Sequence[str],
    test: str | None,
) -> Exported:
    from mofit.results.export import model_of_run
    from mofit.results.fmu.archive import write_fmu

    built = write_fmu(tree, model_of_run(tree, model, tuple(effects)), file, fmi=fmi, mode=mode, test=test)
    return Exported(target, fmi, built.platform, built.note)
