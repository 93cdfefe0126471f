"""A process that ends when the one that started it is gone, however that ended."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

#: s between two looks at who the parent is.
LOOK_S = 0.3
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None


def kill_with_parent() -> None:
    """Have the kernel kill this process when its parent is gone; nothing where it cannot.

    For a process that is about to become another program. (Linux: prctl.)
    """
    if _LIBC is not None:
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def end_with_parent(parent: int, grace: float) -> None:
    """Send this process SIGTERM when `parent` is its parent no more; kill it `grace` s later.

    A thread looks: a signal of the kernel's would also come where the parent lives on and only the
    thread that started us has ended, and other systems than Linux have none.
    """
    threading.Thread(target=_watch, args=(parent, grace), daemon=True).start()


def _watch(parent: int, grace: float) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK_S)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(grace)
    os.kill(os.getpid(), signal.SIGKILL)
