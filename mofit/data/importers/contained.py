"""Files that a library parses are read in a process of their own, so that a damaged one can do no harm."""

from __future__ import annotations

import os
import pickle
import resource
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from mofit.data.importers.registry import Columns, ImportFormat, format_of
from mofit.errors import InputError, Issue


@dataclass(frozen=True)
class ContainedLimits:
    """What reading one file may take."""

    seconds: int = 60
    """Wall time in s, far above what a small file needs on a busy machine."""
    bytes_per_second: int = 5_000_000
    """Speed at which a big file must be read beyond that; libraries read ten times as fast."""
    memory: int = 2 << 30
    """Bytes of memory for the libraries themselves."""
    memory_per_byte: int = 32
    """And per byte of the file: compressed single precision, expanded and copied."""


class Contained:
    """Reads files one after another in a child process, which it starts anew after it died.

    Damaged files make the libraries that parse them loop without end (linked blocks in a circle), ask for any amount
    of memory, or crash the interpreter. None of these can be foreseen, nor stopped from inside: the child sets itself
    an alarm and a limit on memory.

    Parameters
    ----------
    limits
        Time and memory that one file may take.

    Attributes
    ----------
    process, folder
        The child process and its folder for temporary files; None before the first file, and after one that ended it.
    """

    def __init__(self, limits: ContainedLimits = ContainedLimits()) -> None:
        self.limits = limits
        self.process: subprocess.Popen[bytes] | None = None
        self.folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Contained:
        return self

    def __exit__(self, *error: object) -> None:
        self._stop()

    def columns(self, path: Path) -> Columns:
        """Columns and units of a file.

        Raises
        ------
        InputError
            If the file cannot be read within its time and memory.
        """
        process = self._start()
        assert process.stdin is not None
        assert process.stdout is not None
        size = path.stat().st_size
        seconds = self.limits.seconds + size // self.limits.bytes_per_second
        memory = self.limits.memory + self.limits.memory_per_byte * size
        try:
            pickle.dump((path.absolute(), seconds, memory), process.stdin)
            process.stdin.flush()
            answer = pickle.load(process.stdout)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError) as error:
            self._stop()
            message = f"damaged: reading it crashed, or took more than {seconds} s"
            raise InputError.of(f"file '{path.name}'", message, "Copy or export it again") from error
        except BaseException:
            # interrupted: the answer that is still under way belongs to no later file
            self._stop()
            raise
        if isinstance(answer, InputError):
            raise answer
        columns, units = answer
        return columns, units

    def _start(self) -> subprocess.Popen[bytes]:
        if self.process is None:
            # what the libraries unpack on disk goes with the process, however it ended
            self.folder = tempfile.TemporaryDirectory(prefix="mofit-")
            root = str(Path(__file__).resolve().parents[3])
            search = os.pathsep.join([root, *(entry for entry in sys.path if entry)])
            self.process = subprocess.Popen(
                [sys.executable, "-W", "ignore", "-c", f"from {__name__} import serve; serve()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": search, "TMPDIR": self.folder.name},
            )
        return self.process

    def _stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.communicate()  # closes the pipes and waits
            self.process = None
        if self.folder is not None:
            self.folder.cleanup()
            self.folder = None


def serve() -> None:
    """What the child does until standard input ends: read the file of each request, answer with columns or an error.

    A request is the file, the seconds and the bytes of memory that it may take.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "wb")
    # what a library prints must not get between the answers
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    while True:
        try:
            path, seconds, memory = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (memory if hard < 0 else min(memory, hard), hard))
        # the default action of the alarm ends the process, whatever it is doing
        signal.alarm(seconds)
        answer = _answer(path)
        signal.alarm(0)
        pickle.dump(answer, answers)
        answers.flush()


def _answer(path: Path) -> Columns | InputError:
    where = f"file '{path.name}'"
    known = format_of(path)
    try:
        columns, units = known.read(path)
    except InputError as error:
        return InputError(Issue(_clean(i.where), _clean(i.message), _clean(i.hint)) for i in error.issues)
    except Exception as error:  # noqa: BLE001  a damaged file raises anything, from struct.error to MemoryError
        return InputError.of(where, *_unreadable(known, error))
    if not columns:
        return InputError.of(where, "holds no numeric vector", "Save the signals as vectors")
    return (
        {_clean(name): values for name, values in columns.items()},
        {_clean(name): _clean(unit) for name, unit in units.items()},
    )


def _unreadable(known: ImportFormat, error: Exception) -> tuple[str, str]:
    """Message and hint for what a reader raised."""
    if isinstance(error, ModuleNotFoundError) and known.package and error.name == known.package:
        message = f"{known.name} files are read by {known.package}, which is not installed"
        return message, f"Install the extra: pip install 'mofit[{known.extra}]'"
    reason = (str(error).splitlines() or [""])[0][:200] or type(error).__name__
    return f"not a readable {known.name} file ({_clean(reason)})", "Copy it again"


def _clean(text: str) -> str:
    """Text that can be printed and stored: names of damaged files hold bytes that are no UTF-8."""
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "?")
