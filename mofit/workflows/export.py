"""What a run found, or a test of a campaign, for other programs: the work of ``mofit export``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import xarray as xr

from mofit.errors import InputError, Issue, raise_errors
from mofit.runtime.files import atomic_path
from mofit.runtime.output_file import output_file

Format = Literal["toml", "csv", "casadi", "c", "fmu", "relaxation", "bode", "tir", "tydex"]
#: endings of files whose format has no name of its own
_ENDINGS = {"relaxation": "_relaxation.csv", "bode": "_bode.csv"}
#: formats that read an option
_FORMATS = {"--fmi": ("fmu",), "--test": ("fmu", "tydex"), "--template": ("tir",), "--load": ("tir",)}


@dataclass(frozen=True)
class Exported:
    """The file, and what is to be said of it, as ``--json`` prints it."""

    file: Path
    said: Mapping[str, str | None] = field(default_factory=dict)


def export(
    run: xr.DataTree | str | Path,
    to: Format,
    *,
    mode: str = "m1",
    model: str | None = None,
    effects: Sequence[str] = (),
    fmi: Literal["3", "2"] | None = None,
    test: str | None = None,
    template: str | Path | None = None,
    load: str | None = None,
    out: str | Path | None = None,
) -> Exported:
    """Export a run for other programs: parameters, the identified model, an FMU, or what is wanted of a tyre.

    Parameters
    ----------
    run
        Folder of a finished run, or its tree; for ``tydex`` the path of a campaign file.
    to
        Format, see docs/export.md.
    mode
        Posterior mode: its MAP estimate goes into the function (``casadi``, ``c``), its posterior mean into the FMU.
    model, effects
        The run's own, if they are the user's: ``path/to/file.py:Name``.
    fmi
        Version of FMI, 3 by default (``fmu``).
    test
        Test whose conditions the FMU starts with (``fmu``), or test to write (``tydex``).
    template, load
        Property file whose other entries stay, and vertical force of the tests, ``"3600 N"`` (``tir``).
    out
        File to write; by default the model's name with the ending of the format.

    Raises
    ------
    InputError
        If options don't fit together, the run is not there, or the file exists.
    """
    _check_options(to, {"--fmi": fmi, "--test": test, "--template": template, "--load": load})
    file = None if out is None else Path(out)
    if to == "tydex":
        if isinstance(run, xr.DataTree):
            raise InputError.of(
                "run", "is a result, and TYDEX holds measurements", "Give the path of the campaign file"
            )
        return _write_tydex(Path(run), test, file)
    from mofit.results import open_result
    from mofit.results.export import require_equations

    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    if to in ("casadi", "c", "fmu"):
        require_equations(tree)
    name = f"{tree.attrs['model']}{_ENDINGS.get(to, f'.{to}')}"
    file = file or Path(re.sub("[^0-9A-Za-z_.-]", "_", name))
    start = None if template is None else Path(template)
    said: dict[str, str | None] = {}
    with output_file(file, inputs=[] if start is None else [start]) as target, atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            _write_parameters(tree, temporary, to)
        elif to == "fmu":
            said = _write_fmu(tree, temporary, fmi or "3", mode, model, effects, test)
        elif to in ("relaxation", "bode"):
            _write_responses(tree, temporary, to, target.suffix.lower(), model, effects)
        elif to == "tir":
            said = _write_tir(tree, temporary, start, load, model, effects)
        else:
            _write_function(tree, temporary, to, mode, model, effects)
    return Exported(target, {"mode": mode if to in ("casadi", "c", "fmu") else None, **said})


def _check_options(to: str, given: Mapping[str, object]) -> None:
    """Refuse options that another format reads."""
    raise_errors(
        Issue(f"{option} {given[option]}", f"is for {' and '.join(formats)}, not for {to}", "Leave it out")
        for option, formats in _FORMATS.items()
        if given[option] is not None and to not in formats
    )


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
    fmi: Literal["3", "2"],
    mode: str,
    model: str | None,
    effects: Sequence[str],
    test: str | None,
) -> dict[str, str | None]:
    """What is to be said of it."""
    from mofit.results.export import model_of_run
    from mofit.results.fmu.archive import write_fmu

    built = write_fmu(tree, model_of_run(tree, model, tuple(effects)), file, fmi=fmi, mode=mode, test=test)
    return {"fmi": fmi, "platform": built.platform, "note": built.note or None}


def _write_responses(
    tree: xr.DataTree, file: Path, to: str, ending: str, model: str | None, effects: Sequence[str]
) -> None:
    from mofit.prediction.relaxation import bode_csv, relaxation_csv, tyre_responses
    from mofit.prediction.relaxation_page import save_bode, write_relaxation_page
    from mofit.results.export import model_of_run

    endings = {"relaxation": (".csv", ".html"), "bode": (".csv", ".svg", ".png")}[to]
    if ending not in endings:
        raise InputError.of(f"--out *{ending}", f"is no format of --to {to}", f"End it in {', '.join(endings)}")
    responses = tyre_responses(tree, model_of_run(tree, model, tuple(effects)))
    if ending == ".csv":
        text = (relaxation_csv if to == "relaxation" else bode_csv)(responses)
        file.write_text(text, encoding="utf-8")
    elif ending == ".html":
        write_relaxation_page(responses, str(tree.attrs["title"]), file)
    else:
        save_bode(responses, file, ending[1:])


def _write_tir(
    tree: xr.DataTree, file: Path, template: Path | None, load: str | None, model: str | None, effects: Sequence[str]
) -> dict[str, str | None]:
    """What is to be said of it: what stayed as it was, and why."""
    from mofit.prediction.tyre_draws import tyre_draws
    from mofit.results.export import model_of_run
    from mofit.results.tir_entries import tir_replacements
    from mofit.results.tir_file import TirFile
    from mofit.units import parse_quantity

    if template is None:
        raise InputError.of("--to tir", "needs a property file to start from", "Name one with --template")
    if not template.is_file():
        raise InputError.of(f"--template {template}", "no such file", "Name a .tir file")
    newton = None if load is None else parse_quantity("--load", load, "N")[0]
    tir = TirFile.of_bytes(template.read_bytes(), f"file '{template.name}'")
    draws = tyre_draws(tree, model_of_run(tree, model, tuple(effects)), newton)
    new, kept = tir_replacements(tir, draws)
    file.write_bytes(tir.patched(new))
    reasons = "; ".join(f"{key}: {reason}" for key, reason in kept.items())
    return {"replaced": ", ".join(new), "note": f"left as in the template: {reasons}" if reasons else None}


def _write_tydex(campaign_file: Path, test: str | None, out: Path | None) -> Exported:
    from mofit.data import read_campaign
    from mofit.data.tydex_file import only_test, tydex_text

    if campaign_file.is_dir():
        raise InputError.of(f"'{campaign_file}'", "is a run, and TYDEX holds measurements", "Name the campaign file")
    campaign = read_campaign(campaign_file)
    chosen = campaign[only_test(campaign.tests, test)]
    text = tydex_text(chosen, campaign.title, campaign.units)
    file = out or Path(re.sub("[^0-9A-Za-z_.-]", "_", f"{chosen.name}.tdx"))
    with output_file(file, inputs=[campaign_file]) as target, atomic_path(target) as temporary:
        temporary.write_text(text, encoding="ascii")
    return Exported(target, {"mode": None, "test": chosen.name})
