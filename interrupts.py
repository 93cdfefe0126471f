"""Handling of Ctrl-C while the command line is being imported, before anything is done."""

import os
import signal
import sys
import threading
from types import FrameType

EXIT_CODE = 130


def is_command() -> bool:
    """Return whether this process is the command line, and not a program that imports us."""
    # While Python looks for the module of `python -m`, sys.argv[0] is "-m".
    is_module = sys.argv[:1] == ["-m"] and {"bubblefit", "bubblefit.cli"} & set(sys.orig_argv[:4])
    return bool(is_module) or os.path.basename(sys.argv[0]).split(".")[0] == "bubblefit"


def end_at_once_until_begun() -> None:
    """Let Ctrl-C end the command line without a traceback, until `begin` is called."""
    is_main = threading.current_thread() is threading.main_thread()
    # Jobs in the background of a shell ignore the signal, which stays so.
    if is_main and is_command() and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def begin() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, which commands handle."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, b"bubblefit: interrupted\n")
    os._exit(EXIT_CODE)


end_at_once_until_begun()
