"""Drawing the sections of a page on two cores, where the system can fork."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mofit.forking import forked, may_fork
from mofit.report.page import Section
from mofit.report.run import Run

Maker = Callable[[Run], Section | None]

#: Figures are drawn in Python, a core at a time; a second process halves the wait, more would mostly start up.
PROCESSES = 2

# what a forked process draws: it has both from its parent
_task: tuple[Run, Sequence[Maker]] | None = None


def draw_sections(
    run: Run, makers: Sequence[Maker], processes: int | None = None, longest: Sequence[Maker] = ()
) -> list[Section]:
    """The sections that find something to show, in order; the same for any number of processes.

    Those that take longest are begun first, so that processes end together.
    """
    if processes is None:
        processes = PROCESSES if may_fork() else 1
    if processes > 1:
        with forked(processes, _begin, run, makers) as pool:
            order = sorted(range(len(makers)), key=lambda number: makers[number] not in longest)
            begun = {number: pool.submit(_draw, number) for number in order}
            drawn = [begun[number].result() for number in range(len(makers))]
    else:
        drawn = [make(run) for make in makers]
    return [section for section in drawn if section is not None]


def _begin(run: Run, makers: Sequence[Maker]) -> None:
    global _task
    _task = run, makers


def _draw(number: int) -> Section | None:
    assert _task is not None
    run, makers = _task
    return makers[number](run)
