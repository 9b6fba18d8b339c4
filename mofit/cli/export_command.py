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
    mode: str = "c1",
    model: str | None = None,
    effect: tuple[str, ...] = (),
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Write what was identified for other programs: parameters with uncertainty, or the model as a function.

    Example: mofit export runs/my-campaign-maxwell_tyre --to c --out tyre.c

    Parameters
    ----------
    run
        Folder of a finished run.
    to
        toml or csv: parameters of all solutions with sd, quantiles, unit and verdict; casadi: a file for CasADi's
        Function.load; c: C source.
    mode
        Solution whose refined minimum goes into the function (casadi, c).
    model
        The run's model where it is not a shipped one: path/to/file.py:Name.
    effect
        The run's effects where one is not a shipped one, all of them in order; repeatable.
    out
        File to write; by default the model's name with the ending of the format.
    """
    from mofit.export import c_source, identified_function, model_of_run, parameters_csv, parameters_toml
    from mofit.result import atomic_path, open_result

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
                origin = {"solution": mode, **{key.replace("_", " "): str(tree.attrs[key]) for key in keys}}
                temporary.write_text(c_source(function, chosen, origin), encoding="utf-8")
    if as_json:
        print_json({"file": str(target), "to": to, "mode": mode if to in ("casadi", "c") else None})
    else:
        print(target)
    return DONE
