"""The registry of global searches: every module of `mofit.optimize.searches` is one.

Its name is the module's, with hyphens; its description the first line of the module's docstring; its function is called
``search``. ``with_budget`` makes its settings from a number of evaluations, where it has one. Names and descriptions
are read without importing the modules, so that command-line help stays quick.
"""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from mofit.errors import InputError, did_you_mean

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike

    from mofit.optimize.global_search import Gradients, Objectives, Progress, SearchResult

DEFAULT_SEARCH = "effa"
#: Of simulators that cost more than equations.
COSTLY_SEARCH = "surrogate"
_FOLDER = Path(__file__).parents[1] / "optimize" / "searches"


class Search(Protocol):
    """A global search in the unit cube; see `mofit.optimize.searches.mlsl.search` for the parameters."""

    def __call__(
        self,
        objectives: Objectives,
        gradients: Gradients,
        dimension: int,
        rng: np.random.Generator,
        settings: Any = None,
        weights: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> SearchResult:
        """Search with the settings given, or with the search's own."""


@cache
def search_descriptions() -> dict[str, str]:
    """Name and one-line description of every search, the default first."""
    files = sorted(_FOLDER.glob("[!_]*.py"), key=lambda file: (_name(file) != DEFAULT_SEARCH, file.stem))
    return {_name(file): _first_line(file) for file in files}


def search_help() -> str:
    """What the command line says of ``--search``."""
    listed = "; ".join(f"{name} ({text.rstrip('.')})" for name, text in search_descriptions().items())
    return f"Global search: {listed}."


def find_search(name: str) -> Search:
    """The search of that name.

    Raises
    ------
    InputError
        If there is none; names the closest one.
    """
    known = search_descriptions()
    if name not in known:
        raise InputError.of("--search", f"unknown search '{name}'", did_you_mean(name, known))
    found: Search = import_module(f"mofit.optimize.searches.{name.replace('-', '_')}").search
    return found


def search_settings(name: str, evaluations: int | None) -> Any:
    """Settings of the search of that name with a budget; None, its own ones, without.

    Raises
    ------
    InputError
        If there is no such search, or its budget is not counted in evaluations.
    """
    search = find_search(name)
    if evaluations is None:
        return None
    with_budget = getattr(import_module(search.__module__), "with_budget", None)
    if with_budget is None:
        raise InputError.of("--evaluations", f"the search '{name}' takes no budget", "Leave it out")
    return with_budget(evaluations)


def _name(file: Path) -> str:
    return file.stem.replace("_", "-")


def _first_line(file: Path) -> str:
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").partition("\n")[0]
