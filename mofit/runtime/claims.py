"""Claims: which process works on an output. A claim is a lock on a file: it ends with its process, in any case."""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

from mofit.errors import MofitError

#: Name of the lock of a folder, inside of it.
LOCK = ".lock"
#: Seconds that the processes which a killed one has left behind get to end.
_GRACE = 5.0


@dataclass(frozen=True)
class Owner:
    """Who has a claim."""

    pid: int
    host: str
    since: str

    @classmethod
    def here(cls) -> Owner:
        """The process that asks."""
        return cls(os.getpid(), socket.gethostname(), datetime.now().astimezone().isoformat(" ", "seconds"))

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host} has been working on it since {self.since}"

    @property
    def gone(self) -> bool:
        """Whether its process has ended; of another machine's that is not known."""
        if self.host != socket.gethostname():
            return False
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        except OSError:
            return False  # another user's
        return False


class TakenError(MofitError):
    """Another process has the claim."""

    def __init__(self, owner: Owner | None) -> None:
        super().__init__(str(owner) if owner else "another process is working on it")


@dataclass(frozen=True)
class Claim:
    """A lock that is held."""

    path: Path
    handle: int

    def release(self, path: Path | None = None) -> None:
        """Give it up and remove the file, which may have moved to another path."""
        (path or self.path).unlink(missing_ok=True)
        os.close(self.handle)


def claim(path: Path) -> Claim:
    """Lock a file, which is made if need be, and write into it who has it.

    Raises
    ------
    TakenError
        If another process, or another thread, has it.
    OSError
        If the file cannot be made.
    """
    end = time.monotonic() + _GRACE
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if _locked(handle):
                # who had it before may have removed the file after it was opened here
                if path.exists() and os.path.samestat(os.fstat(handle), path.stat()):
                    _sign(handle)
                    return Claim(path, handle)
            else:
                owner = _owner(path)
                if owner is None or not owner.gone or time.monotonic() > end:
                    raise TakenError(owner)
                time.sleep(0.05)  # forked processes of a killed one hold the lock until they have ended, too
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _locked(handle: int) -> bool:
    """Whether the lock could be taken; where a system has none, every claim is granted."""
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system without locks
    return True


def _sign(handle: int) -> None:
    os.ftruncate(handle, 0)
    os.pwrite(handle, json.dumps(asdict(Owner.here())).encode(), 0)


def _owner(path: Path) -> Owner | None:
    """Who has signed; None where that is not, or not yet, readable."""
    try:
        return Owner(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
