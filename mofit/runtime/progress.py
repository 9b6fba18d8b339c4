"""Progress of long work: the callback, the log of a run, and its clock."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from mofit.runtime.memory import give_back

#: ``progress(stage, done, total, note)``: called now and then; ``total`` 0 where it is not known.
Progress = Callable[[str, float, float, str], None]


def silent(stage: str, done: float, total: float, note: str = "") -> None:
    """The listener that does nothing."""


@dataclass
class RunLog:
    """Passes progress on to a listener, and keeps the first word of every stage for the log file.

    Lines are held until the run's folder exists (`write_to`), then written as they come.
    """

    listener: Progress = silent
    lines: list[str] = field(default_factory=list)
    path: Path | None = None
    _stage: str = ""

    def __call__(self, stage: str, done: float, total: float, note: str = "") -> None:
        """Hear of progress."""
        self.listener(stage, done, total, note)
        if stage != self._stage:
            self._stage = stage
            self.note(f"{stage}: {note}" if note else stage)

    def note(self, text: str) -> None:
        """Add a line."""
        self.lines.append(f"{datetime.now(UTC).isoformat(timespec='milliseconds')} {text}\n")
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(self.lines[-1])

    def write_to(self, path: Path) -> None:
        """From now on lines go to this file; those so far first. A resumed run goes on in the same file."""
        self.path = path
        with path.open("a", encoding="utf-8") as file:
            file.writelines(self.lines)


@dataclass(frozen=True)
class StageTimer:
    """Seconds per stage."""

    seconds: dict[str, float] = field(default_factory=dict)
    began: float = field(default_factory=time.perf_counter)

    @property
    def total(self) -> float:
        """Seconds since the clock was made; stages that overlap add up to more."""
        return time.perf_counter() - self.began

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the time spent in the block to a stage, whose freed memory is given back."""
        start = time.perf_counter()
        yield
        give_back()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start
