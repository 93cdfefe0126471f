"""Whether a call comes to an end: tried in a process of its own first."""

from __future__ import annotations

import os
import signal
import time
import warnings
from collections.abc import Callable


def ends(call: Callable[[], object], seconds: float) -> bool:
    """Whether a call ends within `seconds`, in whatever way but by a crash of its process.

    What it raises is left to the caller's own call.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # the child runs nothing but `call`
        child = os.fork()
    if child == 0:
        try:
            call()
        finally:
            os._exit(0)
    end = time.monotonic() + seconds
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status == 0
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return False
        time.sleep(0.002)
