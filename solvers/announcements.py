"""What is said while something runs, to whoever hears it: that a run waits, that a worker is gone.

Where nobody listens it goes to the log, as a warning. A process that works for another has a
listener that passes it on.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Announcement:
    """One line, or a state that begins or is over.

    words : the line. of : who is in this state, until one comes with no words; "" : it is said
    once, and is no state.
    """

    words: str
    of: str = ""


Listener = Callable[[Announcement], None]


def _log(said: Announcement) -> None:
    if said.words:
        log.warning("%s", said.words)


_listener: ContextVar[Listener] = ContextVar("listener", default=_log)


@contextmanager
def hearing(listener: Listener) -> Iterator[None]:
    """Whatever is announced within goes to `listener`."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


def announce(words: str, of: str = "") -> None:
    """Say it to whoever listens."""
    _listener.get()(Announcement(words, of))


def pass_on(said: Announcement) -> None:
    """Say what another process has announced."""
    _listener.get()(said)
