"""A Dask cluster, reached by the address of its scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mofit.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

#: Seconds to wait for the scheduler's answer.
PATIENCE = 15.0


def connected(option: str, address: str, patience: float = PATIENCE) -> Client:
    """A client of the scheduler; messages name the ``option`` that gave its address.

    Raises
    ------
    InputError
        If the extra is not installed, or no scheduler answers within ``patience`` seconds.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError.of(option, "needs Dask", "Install mofit's extra: pip install 'mofit[dask]'") from None
    try:
        return Client(address, timeout=patience)
    except (OSError, ValueError, TimeoutError) as error:
        message = f"no scheduler answers ({error})"
        raise InputError.of(f"{option} {address}", message, "Check the address") from None


@dataclass(frozen=True)
class Answer:
    """What a worker answered."""

    result: Any = None
    error: Exception | None = None
    lost: bool = False
    """Whether worker after worker was lost with it."""

    def value(self) -> Any:
        """The result; raises what the worker raised."""
        if self.error is not None:
            raise self.error
        return self.result


def on_workers(
    option: str, address: str, function: Callable[[Any], Any], tasks: Sequence[Any], patience: float = PATIENCE
) -> Iterator[tuple[int, Answer]]:
    """Call a function for every task on the workers of a cluster; yields index and answer as they end.

    What a lost worker had to do is repeated by another one.

    Raises
    ------
    InputError
        As `connected`, or if the cluster is lost on the way.
    """
    client = connected(option, address, patience)
    from distributed import CancelledError, KilledWorker, as_completed

    with client:
        futures = {client.submit(function, task, pure=False): k for k, task in enumerate(tasks)}
        for future in as_completed(futures):
            try:
                answer = Answer(future.result())
            except KilledWorker as error:
                answer = Answer(error=error, lost=True)
            except CancelledError as error:
                message = f"the cluster was lost ({type(error).__name__})"
                raise InputError.of(f"{option} {address}", message, "Start it again, then the same command") from error
            except Exception as error:  # noqa: BLE001 - raised on the worker: the caller judges it
                answer = Answer(error=error)
            yield futures[future], answer
