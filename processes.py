"""Processes and threads: starting workers, tasks side by side, threads of BLAS, time limits."""

from __future__ import annotations

import itertools
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

M = TypeVar("M")
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


class _Scope:
    """A block in which tasks may run in several processes at once, and the copies made in it."""

    def __init__(self, processes: int) -> None:
        self.processes = max(1, processes)
        self.copies: Copies[Any, Any] | None = None

    def end_copies(self) -> None:
        """End the copies that there are."""
        if self.copies is not None:
            self.copies.end()
            self.copies = None


_scope: ContextVar[_Scope | None] = ContextVar("processes_at_once_of_tasks", default=None)


@contextmanager
def may_run_at_once(processes: int) -> Iterator[None]:
    """Let tasks in the block run in so many processes at once, this one counted (`Copies`)."""
    scope = _Scope(processes)
    with temporary_value(_scope, scope):
        try:
            yield
        finally:
            scope.end_copies()


class Copies(Generic[M, V]):
    """Copies of this process that share tasks with it, as often as it asks them to.

    Nothing that a task does in a copy reaches this process but what it returns. The copies end with
    the block that allows them (`may_run_at_once`), or when others are made in it.

    Parameters
    ----------
    do : callable
        Does the task of a number by a message; both message and result can be pickled.
    shares : sequence of sequence of int
        The numbers of each process, this one first.
    """

    def __init__(self, do: Callable[[int, M], V], shares: Sequence[Sequence[int]]) -> None:
        self._do = do
        self._own_share, *others = self._shares = shares
        self._owner = os.getpid()
        self._copies = [(_Copy(do), share) for share in others]

    @property
    def exist(self) -> bool:
        """Return whether the copies can still be asked; those of another process cannot."""
        return bool(self._copies) and self._owner == os.getpid()

    def run(self, messages: Sequence[M]) -> list[V]:
        """Return the results of all tasks, each by its message.

        A task whose copy has died is done here.
        """
        for copy, share in self._copies:
            copy.send([(k, messages[k]) for k in share])
        with temporary_value(_scope, None):  # a task makes no copies itself
            results = {k: self._do(k, messages[k]) for k in self._own_share}
        for copy, share in self._copies:
            values = copy.receive()
            if values is None:
                values = [self._do(k, messages[k]) for k in share]
            results |= zip(share, values, strict=True)
        return [results[k] for k in range(len(messages))]

    def is_balanced(self, seconds: Sequence[float]) -> bool:
        """Return whether another way to share tasks, which take so long, would save little."""
        shares = _shares(seconds, len(self._shares))
        longest, shortest = (
            max(sum(seconds[k] for k in share) for share in by) for by in (self._shares, shares)
        )
        return longest <= 1.25 * shortest

    def end(self) -> None:
        """End all copies."""
        for copy, _ in self._copies:
            copy.end()
        self._copies = []


def copies_for(do: Callable[[int, M], V], seconds: Sequence[float]) -> Copies[M, V] | None:
    """Return copies of this process for tasks, None where they may not be made or save no time.

    Parameters
    ----------
    do : callable
        See `Copies`.
    seconds : sequence of float
        How long each task takes: the longest are shared out first.
    """
    scope = _scope.get()
    if scope is None or process_context().get_start_method() != "fork":
        return None
    shares = _shares(seconds, scope.processes)
    if len(shares) < 2:
        return None
    scope.end_copies()
    scope.copies = Copies(do, shares)
    return scope.copies


def run_side_by_side(do: Callable[[int], V], count: int) -> list[V]:
    """Return the results of `count` tasks by their numbers, done by copies where these may be made.

    The tasks count as equally long.
    """

    def do_number(number: int, _: None) -> V:
        return do(number)

    copies = copies_for(do_number, [1.0] * count)
    if copies is None:
        return [do(number) for number in range(count)]
    return copies.run([None] * count)


def _shares(seconds: Sequence[float], processes: int, *, least: float = 0.01) -> list[list[int]]:
    """Share tasks out among processes, of which each has `least` seconds to do, or one has all."""
    shares: list[list[int]] = [[] for _ in range(processes)]
    loads = [0.0] * processes
    for k in sorted(range(len(seconds)), key=lambda k: -seconds[k]):
        free = loads.index(min(loads))
        shares[free].append(k)
        loads[free] += seconds[k]
    if processes > 1 and min(loads) < least:
        return _shares(seconds, processes - 1, least=least)
    return shares


#: Bytes of arrays that a copy returns by memory that both processes share, several times as fast as
#: by a pipe; it is taken from the machine only as far as it is used.
_SHARED_BYTES = 1 << 28


class _SharedMemory:
    """Memory that this process shares with its copies, for the arrays of results."""

    def __init__(self, size: int = _SHARED_BYTES) -> None:
        import mmap

        self._bytes = memoryview(bytearray())  # where there is none, all goes by the pipe
        with suppress(OSError):
            self._bytes = memoryview(mmap.mmap(-1, size))

    def pack(self, results: Any) -> tuple[bytes, list[int]]:
        """Return results pickled without arrays, which are written here, and the sizes of these."""
        buffers: list[pickle.PickleBuffer] = []
        content = pickle.dumps(results, protocol=5, buffer_callback=buffers.append)
        arrays = [buffer.raw() for buffer in buffers]
        if sum(array.nbytes for array in arrays) > len(self._bytes):
            return pickle.dumps(results), []
        start = 0
        for array in arrays:
            self._bytes[start : start + array.nbytes] = array
            start += array.nbytes
        return content, [array.nbytes for array in arrays]

    def unpack(self, content: bytes, sizes: Sequence[int]) -> Any:
        """Return the results that a copy has packed."""
        ends = list(itertools.accumulate(sizes))
        arrays = [
            bytearray(self._bytes[end - size : end]) for size, end in zip(sizes, ends, strict=True)
        ]
        return pickle.loads(content, buffers=arrays)  # noqa: S301 - written by a copy of this process


class _Copy:
    """A copy of this process, and the pipe to it."""

    def __init__(self, do: Callable[[int, Any], Any]) -> None:
        import multiprocessing

        self._memory = _SharedMemory()
        self._connection, connection = multiprocessing.Pipe()
        self._number = os.fork()
        if self._number == 0:
            self._connection.close()
            try:
                signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process copied decides
                signal.signal(signal.SIGTERM, signal.SIG_DFL)
                _scope.set(None)  # a task makes no copies itself
                while True:
                    results = [do(k, message) for k, message in connection.recv()]
                    connection.send(self._memory.pack(results))
            finally:
                os._exit(0)  # nothing else of the process copied is run
        connection.close()

    def send(self, tasks: Sequence[tuple[int, Any]]) -> None:
        """Send tasks, unless the copy has died."""
        with suppress(OSError):
            self._connection.send(tasks)

    def receive(self) -> list[Any] | None:
        """Return the results of the tasks, None if the copy has died."""
        try:
            return self._memory.unpack(*self._connection.recv())
        except (EOFError, OSError):
            return None

    def end(self) -> None:
        """End the copy, unless it is that of another process."""
        self._connection.close()
        with suppress(OSError):
            os.kill(self._number, signal.SIGKILL)
            os.waitpid(self._number, 0)


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
    is_chosen = any(os.environ.get(name) for name in _THREAD_VARIABLES)
    with nullcontext() if is_chosen else limit_blas(1):
        yield


def limit_blas(threads: int) -> AbstractContextManager[Any]:
    """Limit the threads of BLAS from now on, or within a block."""
    return _blas().limit(limits=threads, user_api="blas")


@cache
def _blas() -> ThreadpoolController:
    """Return the control of the threads of BLAS: numpy and scipy have a library each.

    That of scipy is loaded here, as one that came later would have a thread for each core.
    """
    import scipy.linalg  # noqa: F401
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


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
