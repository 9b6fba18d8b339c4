"""The command export."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from mofit.cli.app import DONE, Json, app, new_file, print_json


@app.command
def export(
    run: Path,
    /,
    *,
    to: Literal["toml", "csv", "casadi", "c"],
    mode: str = "m1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Export a run for other programs: parameters with uncertainty, or the identified model as a function.

    Example: mofit export runs/my-campaign-maxwell_tyre --to c --out tyre.c

    Parameters
    ----------
    run
        Folder of a finished run.
    to
        toml or csv: parameters of all modes with standard deviation, quantiles, unit and classification; casadi: a file
        for CasADi's Function.load; c: C source.
    mode
        Posterior mode whose MAP estimate goes into the function (casadi, c).
    model
        The run's model if it is your own: path/to/file.py:Name.
    effect
        All effects of the run in their order if one is your own; repeatable.
    out
        File to write; by default the model's name with the ending of the format.
    """
    from mofit.results import open_result
    from mofit.results.export import c_source, identified_function, model_of_run, parameters_csv, parameters_toml
    from mofit.runtime.files import atomic_path

    tree = open_result(run)
    target = new_file(out or Path(f"{tree.attrs['model']}.{to}".replace("+", "_")))
    with atomic_path(target) as temporary:
        if to in ("toml", "csv"):
            text = (parameters_toml if to == "toml" else parameters_csv)(tree)
            temporary.write_text(text, encoding="utf-8")
        else:
            chosen = model_of_run(tree, model, effect)
            function = identified_function(tree, chosen, mode)
            if to == "casadi":
                function.save(str(temporary))
            else:
                keys = ("title", "campaign_title", "campaign_source", "created", "mofit_version")
                origin = {"mode": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
                temporary.write_text(c_source(function, chosen, origin), encoding="utf-8")
    if as_json:
        print_json({"file": str(target), "to": to, "mode": mode if to in ("casadi", "c") else None})
    else:
        print(target)
    return DONE
