"""A run, or a test of a campaign, for other programs: the work of ``mofit export``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import xarray as xr

from mofit.data import Campaign
from mofit.errors import InputError, Issue, raise_errors
from mofit.identification.inputs import as_campaign
from mofit.models import Model
from mofit.results import open_result
from mofit.runtime.files import atomic_path
from mofit.runtime.output_file import output_file

Format = Literal["toml", "csv", "casadi", "c", "fmu", "relaxation", "bode", "tir", "tydex"]

#: formats that write the model of one posterior mode
_OF_EQUATIONS = ("casadi", "c", "fmu")
#: endings of files whose format has no name of its own, and those that an output may have
_ENDINGS = {"relaxation": "_relaxation.csv", "bode": "_bode.csv", "tydex": ".tdx"}
_RESPONSES = {"relaxation": (".csv", ".html"), "bode": (".csv", ".svg", ".png")}
#: formats that read an option
_FORMATS = {"--fmi": ("fmu",), "--test": ("fmu", "tydex"), "--template": ("tir",), "--load": ("tir",)}


@dataclass(frozen=True)
class Exported:
    """The file, and what is to be said of it: version and platform of an FMU, what stayed as it was, and so on."""

    file: Path
    said: Mapping[str, str | None] = field(default_factory=dict)


@dataclass(frozen=True)
class _Wanted:
    """The run with what was asked for."""

    tree: xr.DataTree
    mode: str
    model: str | None
    effects: tuple[str, ...]
    fmi: Literal["3", "2"]
    test: str | None
    template: Path | None
    load: str | None

    def identified(self) -> Model:
        """The model of the run."""
        from mofit.results.export import model_of_run

        return model_of_run(self.tree, self.model, self.effects)


def export(
    run: xr.DataTree | Campaign | str | Path,
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
        Folder of a finished run, or its tree; for ``tydex`` a campaign, or its file.
    to
        ``toml``, ``csv``: parameters of all modes. ``casadi``: a file for CasADi's ``Function.load``. ``c``: C source.
        ``fmu``: a Functional Mock-up Unit for co-simulation. ``relaxation``: relaxation lengths of a tyre, as CSV or
        page. ``bode``: its frequency response, as CSV or picture. ``tir``: a property file. ``tydex``: a test.
    mode
        Posterior mode: its MAP estimate goes into the function (``casadi``, ``c``), its posterior mean into the FMU.
    model, effects
        The run's own, if they are the user's: ``path/to/file.py:Name``.
    fmi, test
        Version of FMI (3 by default), and the test whose conditions the FMU starts with; the test to write (tydex).
    template, load
        Property file whose other entries stay, and the vertical force of the tests, as ``"3600 N"``, where the model
        does not read it (tir).
    out
        File to write; by default the model's name with the ending of the format.

    Raises
    ------
    InputError
        If options don't fit together, the run is not there, or the file exists.
    """
    _check_options(to, {"--fmi": fmi, "--test": test, "--template": template, "--load": load})
    if to == "tydex":
        return _tydex(run, test, out)
    if isinstance(run, Campaign):
        raise InputError.of("campaign", f"cannot be exported to {to}", "Give a run, or export it to tydex")
    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    if to in _OF_EQUATIONS:
        from mofit.results.export import require_equations

        require_equations(tree)
    start = None if template is None else Path(template)
    wanted = _Wanted(tree, mode, model, tuple(effects), fmi or "3", test, start, load)
    file = _file(f"{tree.attrs['model']}{_ENDINGS.get(to, f'.{to}')}", out)
    with output_file(file, inputs=[] if start is None else [start]) as target, atomic_path(target) as temporary:
        if to in ("relaxation", "bode"):
            _write_responses(wanted, temporary, to, target.suffix.lower())
            return Exported(target)
        writers = {"toml": _write_parameters, "csv": _write_parameters, "fmu": _write_fmu, "tir": _write_tir}
        return Exported(target, writers.get(to, _write_function)(wanted, temporary, to))


def _file(name: str, out: str | Path | None) -> Path:
    return Path(re.sub("[^0-9A-Za-z_.-]", "_", name)) if out is None else Path(out)


def _check_options(to: str, given: Mapping[str, object]) -> None:
    """Refuse options that another format reads."""
    raise_errors(
        Issue(f"{option} {given[option]}", f"is for {' and '.join(formats)}, not for {to}", "Leave it out")
        for option, formats in _FORMATS.items()
        if given[option] is not None and to not in formats
    )


def _write_parameters(wanted: _Wanted, file: Path, to: str) -> dict[str, str | None]:
    from mofit.results.export import parameters_csv, parameters_toml

    text = (parameters_toml if to == "toml" else parameters_csv)(wanted.tree)
    file.write_text(text, encoding="utf-8")
    return {}


def _write_function(wanted: _Wanted, file: Path, to: str) -> dict[str, str | None]:
    from mofit.results.export import c_source, identified_function

    tree, chosen = wanted.tree, wanted.identified()
    function = identified_function(tree, chosen, wanted.mode)
    if to == "casadi":
        function.save(str(file))
        return {}
    keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
    origin = {"mode": wanted.mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
    file.write_text(c_source(function, chosen, origin), encoding="utf-8")
    return {}


def _write_fmu(wanted: _Wanted, file: Path, to: str) -> dict[str, str | None]:
    from mofit.results.fmu.archive import write_fmu

    fmi = wanted.fmi
    built = write_fmu(wanted.tree, wanted.identified(), file, fmi=fmi, mode=wanted.mode, test=wanted.test)
    return {"fmi": fmi, "platform": built.platform, "note": built.note or None}


def _write_responses(wanted: _Wanted, file: Path, to: str, ending: str) -> None:
    from mofit.prediction.relaxation import bode_csv, relaxation_csv, tyre_responses
    from mofit.prediction.relaxation_page import save_bode, write_relaxation_page

    if ending not in _RESPONSES[to]:
        raise InputError.of(f"--out *{ending}", f"is no format of --to {to}", f"End it in {', '.join(_RESPONSES[to])}")
    responses = tyre_responses(wanted.tree, wanted.identified())
    if ending == ".csv":
        text = (relaxation_csv if to == "relaxation" else bode_csv)(responses)
        file.write_text(text, encoding="utf-8")
    elif ending == ".html":
        write_relaxation_page(responses, str(wanted.tree.attrs["title"]), file)
    else:
        save_bode(responses, file, ending[1:])


def _write_tir(wanted: _Wanted, file: Path, to: str) -> dict[str, str | None]:
    """What stayed as it was, and why, is to be said."""
    from mofit.prediction.tyre_draws import tyre_draws
    from mofit.results.tir_entries import tir_replacements
    from mofit.results.tir_file import TirFile
    from mofit.units import parse_quantity

    template = wanted.template
    if template is None:
        raise InputError.of("--to tir", "needs a property file to start from", "Name one with --template")
    if not template.is_file():
        raise InputError.of(f"--template {template}", "no such file", "Name a .tir file")
    newton = None if wanted.load is None else parse_quantity("--load", wanted.load, "N")[0]
    tir = TirFile.of_bytes(template.read_bytes(), f"file '{template.name}'")
    new, kept = tir_replacements(tir, tyre_draws(wanted.tree, wanted.identified(), newton))
    file.write_bytes(tir.patched(new))
    reasons = "; ".join(f"{key}: {reason}" for key, reason in kept.items())
    return {"replaced": ", ".join(new), "note": f"left as in the template: {reasons}" if reasons else None}


def _tydex(given: xr.DataTree | Campaign | str | Path, test: str | None, out: str | Path | None) -> Exported:
    from mofit.data.tydex_file import only_test, tydex_text

    if isinstance(given, xr.DataTree) or (not isinstance(given, Campaign) and Path(given).is_dir()):
        what = "the run" if isinstance(given, xr.DataTree) else f"'{given}'"
        raise InputError.of(what, "is a run, and TYDEX holds measurements", "Name the campaign file")
    campaign = as_campaign(given)
    chosen = campaign[only_test(campaign.tests, test)]
    text = tydex_text(chosen, campaign.title, campaign.units)
    inputs = [] if isinstance(given, Campaign) else [Path(given)]
    file = _file(f"{chosen.name}{_ENDINGS['tydex']}", out)
    with output_file(file, inputs=inputs) as target, atomic_path(target) as temporary:
        temporary.write_text(text, encoding="ascii")
    return Exported(target, {"test": chosen.name})
