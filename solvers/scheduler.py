"""A Dask scheduler, and connections to it, without Dask's own words."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..errors import InputError

#: s, for the scheduler to answer at all; and once connected.
CONNECT_S, ANSWER_S = 5.0, 4.0
#: Of Dask; some have a level of their own.
LOGGERS = ("distributed", "distributed.client", "tornado", "tornado.application")


def check(address: str) -> None:
    """That a scheduler answers; raises InputError."""
    with connected(address):
        pass


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client of the scheduler.

    Raises
    ------
    InputError : nobody answers there, or Dask is not installed.
    """
    distributed = dask()
    with _silence():
        try:
            client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            problem = f"no Dask scheduler answers at {address} ({error or type(error).__name__})"
            advice = "start one (dask scheduler), or give the address that it prints"
            raise InputError(None, "--scheduler", f"{problem}; {advice}") from None
        try:
            yield client
        finally:
            client.close(timeout=ANSWER_S)


@contextmanager
def _silence() -> Iterator[None]:
    """Dask logs every lost connection, with tracebacks; all of it is said in our words."""
    loggers = [logging.getLogger(name) for name in LOGGERS]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)


def dask() -> Any:
    """The module `distributed`, which is an extra.

    Raises
    ------
    InputError : it is not installed.
    """
    try:
        import distributed
    except ImportError:
        problem = "Dask is not installed; pip install 'bubblefit[cluster]'"
        raise InputError(None, "--scheduler", problem) from None
    return distributed
