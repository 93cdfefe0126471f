"""A solver as a subprocess: its own process group, a log, a time limit, no orphans."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from ..errors import InputError
from ..parent import kill_with_parent

T = TypeVar("T")
#: Open files that programs inherit, and whether anybody still wants what they compute.
_kept_open: ContextVar[tuple[int, ...]] = ContextVar("kept_open", default=())
_unwanted: ContextVar[Callable[[], bool]] = ContextVar("unwanted", default=lambda: False)

POLL_S = 0.05
#: Lines of the log that an error carries.
TAIL = 25
#: What a shell adds to the number of the signal that killed its program, and the signals that are
#: looked for in its exit code: other numbers are the program's own.
SHELL = 128
KILLS = {
    signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE,
    signal.SIGILL, signal.SIGXFSZ, signal.SIGXCPU,
}  # fmt: skip
#: Kills a process group when nobody holds the other end of its input any more.
WATCHER = ("/bin/sh", "-c", 'read -r end; kill -9 "-$1"', "bubblefit-watch")


@dataclass(frozen=True)
class Outcome:
    """How a subprocess ended: exit_code as in `subprocess` (-n: signal n), wall time s."""

    exit_code: int
    timed_out: bool
    seconds: float

    @property
    def signal_name(self) -> str:
        """Name of the signal that killed it, or empty.

        A shell that was in between says 128 and the signal's number.
        """
        number = -self.exit_code if self.exit_code < 0 else self.exit_code - SHELL
        if self.exit_code >= 0 and number not in KILLS:
            return ""
        with suppress(ValueError):
            return signal.Signals(number).name
        return f"signal {number}"


class Unwanted(Exception):
    """Nobody waits for the result any more: the task was cancelled while its program ran."""


@contextmanager
def kept_open(file: int) -> Iterator[None]:
    """Programs that are run within inherit the open file: its lock is held until they end, too."""
    before = _kept_open.set((*_kept_open.get(), file))
    try:
        yield
    finally:
        _kept_open.reset(before)


@contextmanager
def unless(unwanted: Callable[[], bool]) -> Iterator[None]:
    """A program that is run within is killed, and `Unwanted` raised, once `unwanted` says so."""
    before = _unwanted.set(unwanted)
    try:
        yield
    finally:
        _unwanted.reset(before)


def check_wanted() -> None:
    """Raise `Unwanted` where nobody waits for the result any more."""
    if _unwanted.get()():
        raise Unwanted


def run_process(
    command: Sequence[str | Path],
    folder: Path,
    log: Path,
    timeout: float | None = None,
    environment: Mapping[str, str] | None = None,
    watch: Callable[[], None] | None = None,
) -> Outcome:
    """Run `command` in `folder` to its end, its output (both streams) going to `log`.

    Parameters
    ----------
    timeout : s; then the whole process group is killed.
    environment : added to ours.
    watch : called about twenty times a second while it runs.

    Raises
    ------
    InputError : the program cannot be started (not there, no permission, another machine's).
    Unwanted : see `unless`.
    Whatever interrupts us (Ctrl-C, an error in `watch`) is passed on after the group is killed.
    Where this process is killed outright, the group is killed, too.
    """
    begun = time.monotonic()
    with log.open("wb") as output:
        try:
            process = subprocess.Popen(
                [str(part) for part in command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, **(environment or {})},
                start_new_session=True,
                pass_fds=_kept_open.get(),
                preexec_fn=kill_with_parent,
            )
        except OSError as error:
            problem = f"cannot be started: {error.strerror}; name another program"
            raise InputError(Path(command[0]), "", problem) from None
        timed_out = False
        try:
            watcher, held = _watcher(process.pid)
        except BaseException:
            _kill(process)
            raise
        try:
            while True:
                try:
                    process.wait(POLL_S)
                    break
                except subprocess.TimeoutExpired:
                    if timeout is not None and time.monotonic() - begun > timeout:
                        timed_out = True
                        break
                check_wanted()
                if watch is not None:
                    watch()
        finally:
            # Also after a clean end: what a wrapper script left behind must not go on writing.
            _kill(process)
            # Before the pipe is closed: the number of the group may be somebody else's by now.
            if watcher is not None:
                watcher.kill()
                watcher.wait()
            os.close(held)
    return Outcome(process.returncode, timed_out, time.monotonic() - begun)


class Watch(Generic[T]):
    """Tells of every increment once, as it appears: `look` finds all there are so far."""

    def __init__(self, look: Callable[[], list[T]], tell: Callable[[T], None]) -> None:
        self.look, self.tell, self.told = look, tell, 0

    def __call__(self) -> None:
        """Look once."""
        fresh = self.look()[self.told :]
        self.told += len(fresh)
        for increment in fresh:
            self.tell(increment)


def log_tail(log: Path, lines: int = TAIL) -> str:
    """Last lines of a log of any size and encoding; empty when there is none."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 400 * lines))
            text = file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
    return "\n".join(line.rstrip() for line in text.splitlines()[-lines:])


def _kill(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _watcher(group: int) -> tuple[subprocess.Popen[bytes] | None, int]:
    """What kills the group when we are killed outright, and our end of the pipe that it reads.

    The kernel's own signal reaches the program that we started, not what a script has started.
    """
    read, held = os.pipe()
    try:
        return subprocess.Popen(
            [*WATCHER, str(group)],
            stdin=read,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ), held
    except OSError:  # no such shell: then it is the kernel's signal alone
        return None, held
    finally:
        os.close(read)
