"""The process beside a diagnosis: it reads the campaign while the caller imports, and draws the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from mofit.runtime.parallel import Start, ready_beside

if TYPE_CHECKING:
    from mofit.data import Campaign
    from mofit.diagnosis.result import Diagnosis

#: Writes the page of a diagnosis, and the files beside it, into a folder; see `mofit.diagnosis.pages.write_diagnosis`.
Draw: TypeAlias = "Callable[[Diagnosis, Path], None]"
#: The campaign of the files, or the error for which it cannot be used; nothing where there are no files.
Read: TypeAlias = "Callable[[], Campaign | tuple[()]]"
#: That draw: more only get ready.
_PROCESSES = 2


@contextmanager
def page_beside() -> Iterator[Draw]:
    """Start the process: it gets ready to draw while the caller computes."""
    with ready_beside(_get_ready_to_draw) as start:
        yield partial(_drawn, start)


@contextmanager
def reader_beside(files: Sequence[Path]) -> Iterator[tuple[Read, Draw]]:
    """As `page_beside`; before, the process reads the campaign of the files while the caller imports."""
    with ready_beside(_get_ready_to_read) as start:
        read = start(_read, files)
        start(_get_ready_to_draw)
        yield read, partial(_drawn, start)


def _get_ready_to_read() -> None:
    import mofit.data.join  # noqa: F401 - imported for later


def _read(files: Sequence[Path]) -> Campaign | tuple[()]:
    from mofit.data import read_joined

    return read_joined(files) if files else ()


def _get_ready_to_draw() -> None:
    """Import what draws, and draw once what is slow the first time."""
    import mofit.diagnosis.pages  # noqa: F401 - imported for later
    from mofit.report.toolkit.figures import warm_up

    warm_up()


def _drawn(start: Start, found: Diagnosis, folder: Path) -> None:
    from mofit.diagnosis.effect_file import effect_file
    from mofit.diagnosis.result import page_data

    data = page_data(found)
    effect = effect_file(found.proposed, data["campaign"], data["model_title"]) if found.proposed else ""
    start(_write, data, effect, folder)()


def _write(data: Mapping[str, Any], effect: str, folder: Path) -> None:
    from mofit.diagnosis.pages import write_files

    write_files(data, effect, folder, _PROCESSES)
