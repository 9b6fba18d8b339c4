"""The page of a diagnosis, drawn by a process that gets ready while the caller computes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from mofit.runtime.parallel import ready_beside

if TYPE_CHECKING:
    from mofit.diagnosis.result import Diagnosis

#: Writes the page of a diagnosis, and the files beside it, into a folder.
Draw: TypeAlias = "Callable[[Diagnosis, Path], None]"
#: That draw: more only get ready.
_PROCESSES = 2


@contextmanager
def page_beside() -> Iterator[Draw]:
    """Start the process; given a diagnosis and a folder, it writes the page and the files beside it.

    See `mofit.diagnosis.pages.write_diagnosis`. Where nothing is imported yet, the process imports while the caller
    does.
    """
    with ready_beside(_get_ready) as start:

        def drawn(found: Diagnosis, folder: Path) -> None:
            from mofit.diagnosis.effect_file import effect_file
            from mofit.diagnosis.result import page_data

            data = page_data(found)
            effect = effect_file(found.proposed, data["campaign"], data["model_title"]) if found.proposed else ""
            start(_write, data, effect, folder)()

        yield drawn


def _get_ready() -> None:
    """Import what draws, and draw once what is slow the first time."""
    import mofit.diagnosis.pages  # noqa: F401 - imported for later
    from mofit.report.toolkit.figures import warm_up

    warm_up()


def _write(data: Mapping[str, Any], effect: str, folder: Path) -> None:
    from mofit.diagnosis.pages import write_files

    write_files(data, effect, folder, _PROCESSES)
