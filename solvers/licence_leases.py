"""Licences of a whole cluster: a Dask scheduler leases them to whoever runs the program.

Not Dask's resources of workers, which are each worker's own. A lease that is not renewed (its
holder died) is free again after `distributed.scheduler.locks.lease-timeout`, 30 s unless the
cluster says otherwise: a dead worker's program has ended by then.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ..errors import BubblefitError, InputError

#: s, for the scheduler to answer; and between two words that it is waited for.
CONNECT_S, LOOK_S = 10.0, 1.0


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
    scheduler, loop = _place(address, os.getpid())
    from distributed import Semaphore

    semaphore = Semaphore(count, f"bubblefit licences of {name}", scheduler, loop)
    try:
        semaphore.register()
        while not semaphore.acquire(LOOK_S):
            waiting()
    except ValueError as error:
        problem = f"the cluster counts another number of them already ({error})"
        raise InputError(None, f"solver.{name}.licences", problem) from None
    except OSError as error:
        raise BubblefitError(f"{address}: the scheduler leases no licence: {error}") from None
    try:
        yield
    finally:
        semaphore.release()
        if hasattr(semaphore, "refresh_callback"):  # none where leases never time out
            semaphore.refresh_callback.stop()


@functools.cache
def _place(address: str, process: int) -> tuple[Any, Any]:
    """Connections to the scheduler, and the loop that serves them: a worker's own, or a client's.

    process : ours; a copy of it (fork) has no use of the connections of the original.
    """
    try:
        from distributed import Client, get_worker
    except ImportError:
        problem = "Dask is not installed; pip install 'bubblefit[cluster]'"
        raise InputError(None, "--scheduler", problem) from None
    try:
        worker = get_worker()
        return worker.scheduler, worker.loop
    except ValueError:
        pass
    try:
        client = Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise BubblefitError(f"{address}: the scheduler leases no licence: {error}") from None
    return _Kept(client), client.loop


class _Kept:
    """The scheduler as a client knows it, with the client."""

    def __init__(self, client: Any) -> None:
        self.client = client

    def __getattr__(self, name: str) -> Any:
        return getattr(self.client.scheduler, name)
