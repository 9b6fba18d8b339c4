"""emcee without ``scipy.stats``, which it imports for a move that is not used here: that takes as long as a search.

The move (`emcee.moves.KDEMove`) still works: it gets what it needs when it is first called.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

NAME = "scipy.stats"


def _gaussian_kde(*arguments: Any, **options: Any) -> Any:
    return import_module(NAME).gaussian_kde(*arguments, **options)


@contextmanager
def _on_demand() -> Iterator[None]:
    """In the block, the module is a stand-in with the one function that emcee asks for."""
    if NAME in sys.modules:
        yield
        return
    stand_in = ModuleType(NAME)
    vars(stand_in)["gaussian_kde"] = _gaussian_kde
    sys.modules[NAME] = stand_in
    try:
        yield
    finally:
        del sys.modules[NAME]


with _on_demand():
    import emcee
    from emcee.moves import DEMove, RedBlueMove, StretchMove

__all__ = ["DEMove", "RedBlueMove", "StretchMove", "emcee"]
