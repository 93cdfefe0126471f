"""Processes and threads: starting workers, limiting the threads of BLAS, time limits of calls."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from typing import Any, TypeVar

V = TypeVar("V")


def process_context() -> Any:
    """Return the context of multiprocessing by which workers are started.

    It is the one that the program has chosen, or else fork on Linux and spawn elsewhere. With fork,
    workers have compiled kernels and data already, and scripts need no `__main__` guard.
    """
    import multiprocessing

    forks = sys.platform == "linux" and hasattr(os, "fork")
    chosen = multiprocessing.get_start_method(allow_none=True)
    return multiprocessing.get_context(chosen or ("fork" if forks else "spawn"))


@cache
def cores() -> int:
    """Return the number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):  # not of macOS or Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_processes_at_once: ContextVar[int] = ContextVar("processes_at_once", default=1)


def share_cores(processes: int) -> None:
    """Let this process leave the cores to so many processes that do the same, itself counted."""
    _processes_at_once.set(max(1, processes))


def share_of_cores() -> int:
    """Return the number of cores that this process may use for itself, 1 or more."""
    return max(1, cores() // _processes_at_once.get())


#: Environment variables by which a user limits threads; if one is set, it is left as it is.
_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread within the block, unless the environment says how many.

    The matrices are too small for several threads: on two busy cores `check` of 80,000 points took
    22 s of processor time with one thread per core, and 5 s with a single thread.
    """
    from threadpoolctl import threadpool_limits

    is_chosen = any(os.environ.get(name) for name in _THREAD_VARIABLES)
    with threadpool_limits(None if is_chosen else 1, user_api="blas"):
        yield


@contextmanager
def temporary_value(variable: ContextVar[V], value: V) -> Iterator[None]:
    """Give a context variable a value within the block, and restore it afterwards."""
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def ends_within(seconds: float, call: Callable[[], object]) -> bool:
    """Try a call in a process of its own, and return whether it ends in time.

    Parameters
    ----------
    seconds : float
        Time limit.
    call : callable
        What is tried; picklable where processes are spawned.

    Returns
    -------
    bool
        Whether it ends in time, in any way but a crash of its process: errors are left to the
        caller's own call. A daemonic process may start none: True, and nothing is tried.
    """
    import multiprocessing

    if multiprocessing.current_process().daemon:
        return True
    process = process_context().Process(target=_quietly, args=(call,), daemon=True)
    process.start()
    process.join(seconds)
    if process.is_alive():
        process.kill()
    process.join()
    return bool(process.exitcode == 0)


def _quietly(call: Callable[[], object]) -> None:
    """Make the call, and ignore its errors."""
    with suppress(Exception, KeyboardInterrupt):
        call()
