"""Processes that do tasks one by one, and end when the process that started them does."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from threadpoolctl import threadpool_limits

from ..errors import BubblefitError
from ..parent import end_with_parent
from ..solvers.base import hearing
from ..solvers.scratch import remove_interrupted

#: Does the task of a number; what it tells on the way and what it gives in the end are records.
Task = Callable[[int, Callable[[Any], None]], Any]
#: s, for a worker to kill its solver and remove its scratch folder once it is told to end.
GRACE_S = 20.0


@dataclass(frozen=True)
class Ended:
    """The last record of a task, on its way between processes."""

    record: Any


class Worker:
    """A process of its own that is given numbers of tasks, and the way to it.

    A way for each: a worker that is killed, wherever it is, holds no lock that others wait for, and
    what it was about to say ends with it.

    Parameters
    ----------
    context : of multiprocessing. prepare : makes what does a task; called once, over there.
    """

    def __init__(self, context: Any, prepare: Callable[[], Task]) -> None:
        self.connection, there = context.Pipe()
        self.task: int | None = None
        arguments = (prepare, there, os.getpid())
        self.process = context.Process(target=_work, args=arguments, daemon=True)
        self.process.start()
        there.close()  # the only other one is the worker's: where that dies, reading ends

    def give(self, number: int | None) -> None:
        """The next task; None: there is none, and the worker ends by itself."""
        self.task = number
        try:
            self.connection.send(number)
        except OSError:
            pass  # it is dead, which shows when it is listened to

    def hear(self) -> Any:
        """What it says next; raises EOFError or OSError where it is dead."""
        return self.connection.recv()


def _work(prepare: Callable[[], Task], listener: Connection, parent: int) -> None:
    # Ctrl-C reaches the whole group; the parent decides and terminates us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def end(*_: object) -> None:
        # By an exception, so that a solver that runs is killed and its scratch folder removed.
        raise SystemExit(1)

    signal.signal(signal.SIGTERM, end)
    end_with_parent(parent, GRACE_S)
    try:
        try:
            with threadpool_limits(1), hearing(listener.send):
                task = prepare()
                while (number := listener.recv()) is not None:
                    listener.send(Ended(task(number, listener.send)))
        except (EOFError, ConnectionError):  # nobody is there to be told
            raise SystemExit(1) from None
        except Exception as error:
            _say(listener, error)
    except SystemExit:
        # Nothing else of this copy of the parent is run: the end is an end at once.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        remove_interrupted()
        os._exit(1)
    # Nothing is left to remove, and an exception raised after this function would pass through
    # the code of the parent, whose copy this process is: the end is an end at once.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _say(listener: Connection, error: Exception) -> None:
    try:
        listener.send(error)
    except ConnectionError:
        raise SystemExit(1) from None
    except Exception:  # it cannot cross: its words can
        listener.send(BubblefitError(f"{type(error).__name__}: {error}"))
