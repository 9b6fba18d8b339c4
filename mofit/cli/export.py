"""The command that writes what a run found, or a test of a campaign, for other programs."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from mofit.cli.app import DONE, Json, app, print_json

if TYPE_CHECKING:
    from xarray import DataTree

#: endings of files whose format has no name of its own
_ENDINGS = {"relaxation": "_relaxation.csv", "bode": "_bode.csv"}
#: formats that read an option
_FORMATS = {"--fmi": ("fmu",), "--test": ("fmu", "tydex"), "--template": ("tir",), "--load": ("tir",)}


@app.command
def export(
    run: Annotated[Path, Parameter(help="Folder of a finished run; for tydex a campaign file.")],
    /,
    *,
    to: Literal["toml", "csv", "casadi", "c", "fmu", "relaxation", "bode", "tir", "tydex"],
    mode: str = "m1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    fmi: Literal["3", "2"] | None = None,
    test: str | None = None,
    template: Path | None = None,
    load: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Export a run for other programs: parameters, the identified model, an FMU, or what is wanted of a tyre.

    Example: mofit export runs/my-campaign-maxwell_tyre --to fmu --out tyre.fmu

    Parameters
    ----------
    to
        toml, csv: parameters of all modes with standard deviation, quantiles, unit and classification. casadi: a file
        for CasADi's Function.load. c: C source. fmu: a Functional Mock-up Unit for co-simulation, with its sources, and
        with a binary where a C compiler is found. relaxation: relaxation lengths of a tyre as CSV, or as a page with
        Bode plots where FILE ends in .html. bode: its frequency response as CSV, or as a picture (.svg, .png). tir: a
        property file with the Magic Formula coefficients that the run supports. tydex: a test of a campaign file,
        which is named in place of the run.
    mode
        Posterior mode: its MAP estimate goes into the function (casadi, c), its posterior mean into the FMU.
    model
        The run's model, if it is your own: path/to/file.py:Name.
    effect
        Effects of the run, all in their order, if one is your own; repeatable.
    fmi
        Version of FMI, 3.0 by default (fmu).
    test
        Test whose conditions and values per test the FMU starts with; by default those common to all, and the mean.
        Test to write (tydex).
    template
        Property file of Magic Formula 5.2 or 6.1 whose other entries stay as they are (tir).
    load
        Vertical force of the tests, where the model does not read it: "3600 N" (tir).
    out
        File to write. By default the model's name with the ending of the format.
    """
    from mofit.runtime.files import atomic_path
    from mofit.runtime.output_file import output_file

    _check_options(to, {"--fmi": fmi, "--test": test, "--template": template, "--load": load})
    if to == "tydex":
        return _export_tydex(run, test, out, as_json)
    from mofit.results import open_result
    from mofit.results.export import require_equations

    tree = open_result(run)
    if to in ("casadi", "c", "fmu"):
        require_equations(tree)
    name = f"{tree.attrs['model']}{_ENDINGS.get(to, f'.{to}')}"
    file = Path(re.sub("[^0-9A-Za-z_.-]", "_", name)) if out is None else out
    said: dict[str, str | None] = {}
    with output_file(file, inputs=[] if template is None else [template]) as target, atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            _export_parameters(tree, temporary, to)
        elif to == "fmu":
            said = _export_fmu(tree, temporary, fmi or "3", mode, model, effect, test)
        elif to in ("relaxation", "bode"):
            _export_responses(tree, temporary, to, target.suffix.lower(), model, effect)
        elif to == "tir":
            said = _export_tir(tree, temporary, template, load, model, effect)
        else:
            _export_function(tree, temporary, to, mode, model, effect)
    if as_json:
        of_mode = mode if to in ("casadi", "c", "fmu") else None
        print_json({"file": str(target), "to": to, "mode": of_mode, **said})
    else:
        print(target)
    if said.get("note"):
        print(f"mofit: {said['note']}", file=sys.stderr)
    return DONE


def _check_options(to: str, given: Mapping[str, object]) -> None:
    """Refuse options that another format reads."""
    from mofit.errors import Issue, raise_errors

    raise_errors(
        Issue(f"{option} {given[option]}", f"is for {' and '.join(formats)}, not for {to}", "Leave it out")
        for option, formats in _FORMATS.items()
        if given[option] is not None and to not in formats
    )


def _export_parameters(tree: DataTree, file: Path, to: str) -> None:
    from mofit.results.export import parameters_csv, parameters_toml

    text = (parameters_toml if to == "toml" else parameters_csv)(tree)
    file.write_text(text, encoding="utf-8")


def _export_function(
    tree: DataTree, file: Path, to: str, mode: str, model: str | None, effects: tuple[str, ...]
) -> None:
    from mofit.results.export import c_source, identified_function, model_of_run

    chosen = model_of_run(tree, model, effects)
    function = identified_function(tree, chosen, mode)
    if to == "casadi":
        function.save(str(file))
        return
    keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
    origin = {"mode": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
    file.write_text(c_source(function, chosen, origin), encoding="utf-8")


def _export_fmu(
    tree: DataTree,
    file: Path,
    fmi: Literal["3", "2"],
    mode: str,
    model: str | None,
    effects: tuple[str, ...],
    test: str | None,
) -> dict[str, str | None]:
    """What is to be said of it."""
    from mofit.results.export import model_of_run
    from mofit.results.fmu.archive import write_fmu

    built = write_fmu(tree, model_of_run(tree, model, effects), file, fmi=fmi, mode=mode, test=test)
    return {"fmi": fmi, "platform": built.platform, "note": built.note or None}


def _export_responses(
    tree: DataTree, file: Path, to: str, ending: str, model: str | None, effects: tuple[str, ...]
) -> None:
    from mofit.errors import InputError
    from mofit.prediction.relaxation import bode_csv, relaxation_csv, tyre_responses
    from mofit.prediction.relaxation_page import save_bode, write_relaxation_page
    from mofit.results.export import model_of_run

    endings = {"relaxation": (".csv", ".html"), "bode": (".csv", ".svg", ".png")}[to]
    if ending not in endings:
        raise InputError.of(f"--out *{ending}", f"is no format of --to {to}", f"End it in {', '.join(endings)}")
    responses = tyre_responses(tree, model_of_run(tree, model, effects))
    if ending == ".csv":
        text = (relaxation_csv if to == "relaxation" else bode_csv)(responses)
        file.write_text(text, encoding="utf-8")
    elif ending == ".html":
        write_relaxation_page(responses, str(tree.attrs["title"]), file)
    else:
        save_bode(responses, file, ending[1:])


def _export_tir(
    tree: DataTree, file: Path, template: Path | None, load: str | None, model: str | None, effects: tuple[str, ...]
) -> dict[str, str | None]:
    """What is to be said of it: what stayed as it was, and why."""
    from mofit.errors import InputError
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
    draws = tyre_draws(tree, model_of_run(tree, model, effects), newton)
    new, kept = tir_replacements(tir, draws)
    file.write_bytes(tir.patched(new))
    reasons = "; ".join(f"{key}: {reason}" for key, reason in kept.items())
    return {"replaced": ", ".join(new), "note": f"left as in the template: {reasons}" if reasons else None}


def _export_tydex(campaign_file: Path, test: str | None, out: Path | None, as_json: bool) -> int:
    from mofit.data import read_campaign
    from mofit.data.tydex_file import only_test, tydex_text
    from mofit.errors import InputError
    from mofit.runtime.files import atomic_path
    from mofit.runtime.output_file import output_file

    if campaign_file.is_dir():
        raise InputError.of(f"'{campaign_file}'", "is a run, and TYDEX holds measurements", "Name the campaign file")
    campaign = read_campaign(campaign_file)
    chosen = campaign[only_test(campaign.tests, test)]
    text = tydex_text(chosen, campaign.title, campaign.units)
    file = Path(re.sub("[^0-9A-Za-z_.-]", "_", f"{chosen.name}.tdx")) if out is None else out
    with output_file(file, inputs=[campaign_file]) as target, atomic_path(target) as temporary:
        temporary.write_text(text, encoding="ascii")
    if as_json:
        print_json({"file": str(target), "to": "tydex", "mode": None, "test": chosen.name})
    else:
        print(target)
    return DONE
