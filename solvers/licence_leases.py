"""Licences of a whole cluster: a Dask scheduler leases them to whoever runs the program.

Not Dask's resources of workers, which are each worker's own. A lease that is not renewed (its
holder died) is free again after `distributed.scheduler.locks.lease-timeout`, 30 s unless the
cluster says otherwise: a dead worker's program has ended by then.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from ..errors import BubblefitError, InputError
from .scheduler import CONNECT_S, dask

#: s between two words that it is waited for.
LOOK_S = 1.0
_clients: dict[tuple[str, int], Any] = {}


@contextmanager
def leased(name: str, count: int, address: str, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold one of `count` licences of the program `name` in the cluster of a scheduler.

    Parameters
    ----------
    waiting : called while there is none, now and then.

    Raises
    ------
    InputError : another count is in use in this cluster, or Dask is not installed.
    BubblefitError : the scheduler does not answer.
    """
    place = _place(address)
    try:
        semaphore = dask().Semaphore(count, f"bubblefit licences of {name}", *place())
        semaphore.register()
        while not semaphore.acquire(LOOK_S):
            waiting()
    except ValueError as error:
        problem = f"the cluster counts another number of them already ({error})"
        raise InputError(None, f"solver.{name}.licences", problem) from None
    except OSError as error:
        said = BubblefitError(f"{address}: the Dask scheduler leases no licence: {error}")
        said.exit_code = 4
        raise said from None
    try:
        yield
    finally:
        with suppress(OSError):  # it is gone, and the lease with it
            semaphore.release()
        if hasattr(semaphore, "refresh_callback"):  # none where leases never time out
            semaphore.refresh_callback.stop()


def _place(address: str) -> Callable[[], tuple[Any, Any]]:
    """Gives connections to the scheduler, and the loop that serves them: a worker's, or a client's.

    The client raises OSError where nobody answers.
    """
    distributed = dask()

    def place() -> tuple[Any, Any]:
        try:
            worker = distributed.get_worker()
            return worker.scheduler, worker.loop
        except ValueError:
            pass
        # A copy of a process (fork) has no use of the connections of the original.
        key = address, os.getpid()
        client = _clients.get(key)
        if client is None or client.status != "running":
            client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
            _clients[key] = client
        return client.scheduler, client.loop

    return place
