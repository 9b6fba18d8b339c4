"""The way of one thing through the code: which rooms handle it while a campaign is identified.

``python scripts/route.py [CHECKOUT]`` identifies the bundled campaign with a profiler set and prints, as JSON, for the
campaign and for the name of a parameter (``d_M``): the rooms whose functions are handed it, and the climbs. A room is a
package or a loose module. A climb is a call, with the thing in hand, to a room that stands higher, where every room
stands above all that it imports; the same pair of rooms counts once. `architecture.py` writes the figures.
"""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FrameType
from typing import Any

PARAMETER = "d_M"
Route = dict[str, set[tuple[str, str]]]


def is_campaign(value: Any) -> bool:
    """A campaign, or the path of its file."""
    return type(value).__name__ == "Campaign" or (isinstance(value, Path) and value.name == "paper_campaign.nc")


def names_parameter(value: Any) -> bool:
    """Something that knows the parameter by name: the name, names, a mapping by name, a space, a result."""
    if isinstance(value, str):
        return value == PARAMETER
    if type(value).__name__ in ("ParameterSpace", "ParameterLayout", "DataTree", "Dataset"):
        return True
    if isinstance(value, (tuple, list, set, frozenset, Mapping)) and len(value) < 1000:
        return any(item == PARAMETER for item in value if isinstance(item, str))
    return False


THINGS: dict[str, Callable[[Any], bool]] = {"campaign": is_campaign, PARAMETER: names_parameter}


def room(module: str, package: Path) -> str:
    """The package of a module (its name without the leading ``mofit.``), or the module itself where it is loose."""
    parts = module.split(".")
    while parts and not (package.joinpath(*parts).is_dir() or len(parts) == 1):
        parts.pop()
    return ".".join(parts)


def follow(package: Path, routes: Route) -> Callable[[FrameType, str, Any], None]:
    """A profiler that notes, per thing, the pairs of rooms (caller, called) that hand it on."""
    rooms: dict[str, str] = {}

    def place(frame: FrameType | None) -> str:
        name = frame.f_globals.get("__name__", "") if frame else ""
        if not name.startswith("mofit"):
            return ""
        if name not in rooms:
            rooms[name] = room(name.partition(".")[2] or "__init__", package)
        return rooms[name]

    def listen(frame: FrameType, event: str, _: Any) -> None:
        if event != "call" or not (here := place(frame)):
            return
        code = frame.f_code
        arguments = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        values = [frame.f_locals.get(name) for name in arguments]
        for thing, holds in THINGS.items():
            if any(holds(value) for value in values):
                caller = frame.f_back
                while caller is not None and not place(caller):
                    caller = caller.f_back
                routes[thing].add((place(caller) or here, here))

    return listen


def run(checkout: str, target: str) -> None:
    """Identify the bundled campaign of a checkout, and write the pairs of rooms."""
    sys.path.insert(0, checkout)
    package = Path(checkout) / "mofit"
    routes: Route = {thing: set() for thing in THINGS}
    from mofit.cli import main

    listener = follow(package, routes)
    threading.setprofile(listener)
    sys.setprofile(listener)
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        main(["identify", str(Path(checkout) / "data/paper_campaign.nc"), "--out", f"{folder}/run", "--json"])
    sys.setprofile(None)
    Path(target).write_text(json.dumps({thing: sorted(pairs) for thing, pairs in routes.items()}))


def routes(checkout: Path) -> dict[str, list[tuple[str, str]]]:
    """Pairs of rooms per thing; in a process of its own, which forks no others, so that all is seen."""
    with tempfile.TemporaryDirectory() as folder:
        target = str(Path(folder) / "routes.json")
        process = multiprocessing.get_context("spawn").Process(target=run, args=(str(checkout), target))
        process.start()
        process.join()
        if process.exitcode:
            raise RuntimeError(f"identify failed in {checkout}")
        found: dict[str, list[tuple[str, str]]] = json.loads(Path(target).read_text())
    return found


if __name__ == "__main__":
    checkout = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parents[1]).resolve()
    print(json.dumps(routes(checkout), indent=1))
