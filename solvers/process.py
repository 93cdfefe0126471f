"""Other processes: programs in a group of their own, with a log and no orphans, and Dask's."""

from __future__ import annotations

import logging
import math
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Generic, TypeVar

from ..errors import InputError
from ..lazy_modules import psutil
from ..light_dataclasses import dataclass
from ..processes import temporary_value

T = TypeVar("T")
#: Open files that programs inherit, and whether anybody still wants what they compute.
_kept_open: ContextVar[tuple[int, ...]] = ContextVar("kept_open", default=())
_unwanted: ContextVar[Callable[[], bool]] = ContextVar("unwanted", default=lambda: False)

POLL_S = 0.05
#: Whether a program and all that it starts form one group, which one signal reaches.
GROUPS = hasattr(os, "killpg")
#: Lines of the log that an error carries.
TAIL = 25
#: Added by a shell to the number of the signal that killed its program, and the signals that are
#: looked for in its exit code: other numbers are the program's own.
SHELL = 128
_NAMES = ("KILL", "TERM", "SEGV", "ABRT", "BUS", "FPE", "ILL", "XFSZ", "XCPU")
KILLS = {getattr(signal, f"SIG{name}", None) for name in _NAMES} - {None}
#: Reads the number of a process group, and kills it when nobody holds the other end of the pipe.
WATCHER = ("/bin/sh", "-c", 'read -r group; read -r end; kill -9 "-$group"', "bubblefit-watch")
#: Free space (bytes) at which a run that ended badly is said to have filled the disk.
MIN_FREE_BYTES = 1024**2
#: Messages of programs that cannot write, in any case of letters.
DISK_FULL_MESSAGES = ("No space left on device", "File too large", "Disk quota exceeded")
#: s, for a Dask scheduler to answer at all.
CONNECT_S = 5.0
#: s, once connected.
ANSWER_S = 4.0
#: Of Dask; some have a level of their own.
LOGGERS = ("distributed", "distributed.client", "tornado", "tornado.application")


@dataclass(frozen=True)
class Outcome:
    """End of a subprocess: exit_code as in `subprocess` (-n: signal n), wall time s."""

    exit_code: int
    timed_out: bool
    seconds: float

    @property
    def signal_name(self) -> str:
        """Return the name of the signal that killed it (also behind a shell), or ""."""
        number = -self.exit_code if self.exit_code < 0 else self.exit_code - SHELL
        if self.exit_code >= 0 and number not in KILLS:
            return ""
        with suppress(ValueError):
            return signal.Signals(number).name
        return f"signal {number}"


class Unwanted(Exception):
    """A task that was cancelled while its program ran."""


def kept_open(file: int) -> AbstractContextManager[None]:
    """Let programs that are run within inherit the open file: they hold its lock, too."""
    return temporary_value(_kept_open, (*_kept_open.get(), file))


def unless(unwanted: Callable[[], bool]) -> AbstractContextManager[None]:
    """Kill a program that is run within, and raise `Unwanted`, once `unwanted` returns true.

    A block around it may end the program as well.
    """
    around = _unwanted.get()
    return temporary_value(_unwanted, lambda: around() or unwanted())


def check_wanted() -> None:
    """Raise `Unwanted` where the task was cancelled."""
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
    """Run a command in a folder to its end.

    An interruption kills the program as well, and where this process is killed outright, a shell
    does.

    Parameters
    ----------
    command : sequence of str or Path
    folder : Path
    log : Path
        File for its output, both streams.
    timeout : float or None, s
        After this time all that it started is killed.
    environment : mapping of str to str, optional
        Variables that are added to ours.
    watch : callable, optional
        Called about twenty times a second.

    Raises
    ------
    InputError
        The program cannot be started.
    Unwanted
        See `unless`.
    """
    start = time.monotonic()
    timed_out = False
    inherited: dict[str, Any] = {"pass_fds": _kept_open.get()} if os.name == "posix" else {}
    with log.open("wb") as output, _watched() as watch_group:
        try:
            process = subprocess.Popen(
                [str(part) for part in command],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, **(environment or {})},
                start_new_session=True,
                **inherited,
            )
        except OSError as error:
            problem = f"cannot be started: {error.strerror}; name another program"
            raise InputError(Path(command[0]), "", problem) from None
        tree: set[psutil.Process] = set()
        try:
            watch_group(process.pid)
            while True:
                try:
                    process.wait(POLL_S)
                    break
                except subprocess.TimeoutExpired:
                    if timeout is not None and time.monotonic() - start > timeout:
                        timed_out = True
                        break
                if not GROUPS:
                    tree |= _started_by(process.pid)
                check_wanted()
                if watch is not None:
                    watch()
        finally:
            # Also after a clean end: what a wrapper script left behind must not go on writing.
            _kill(process, tree)
    return Outcome(process.returncode, timed_out, time.monotonic() - start)


class Watch(Generic[T]):
    """Reporter of every increment once, as it appears: `look` finds all there are so far."""

    def __init__(self, look: Callable[[], list[T]], report: Callable[[T], None]) -> None:
        self.look = look
        self.report = report
        self.reported = 0

    def __call__(self) -> None:
        """Look once."""
        fresh = self.look()[self.reported :]
        self.reported += len(fresh)
        for increment in fresh:
            self.report(increment)


def log_tail(log: Path, lines: int = TAIL) -> str:
    """Return the last lines of a log of any size and encoding; "" when there is none."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 400 * lines))
            text = file.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
    return "\n".join(line.rstrip() for line in text.splitlines()[-lines:])


@dataclass(frozen=True)
class Increment:
    """An increment of a program that converged: its step, its number in it, and total time."""

    step: int
    increment: int
    iterations: int
    time: float


def number_rows(path: Path) -> list[list[float]]:
    """Read the whole lines of finite numbers in a file that a program may be writing."""
    rows: list[list[float]] = []
    with suppress(OSError):
        text = path.read_text(encoding="latin-1")
        for line in text[: text.rfind("\n") + 1].splitlines():
            with suppress(ValueError):
                rows.append([float(part) for part in line.split()])
    return [row for row in rows if all(map(math.isfinite, row))]


def program_at(path: Path, field: str, description: str) -> Path:
    """Return the absolute path of a program, as runs are in a scratch folder; InputError: none."""
    if not path.is_file():
        raise InputError(path, field, f"there is no such file; name the {description} to run")
    if not os.access(path, os.X_OK):
        raise InputError(
            path, field, f"is not executable; chmod +x it, or name another {description}"
        )
    return path.absolute()


def disk_full(folder: Path, lines: Iterable[str], outcome: Outcome) -> str:
    """Return the sign, in lines of the program and of the folder, that the disk was full, or ""."""
    if outcome.signal_name == "SIGXFSZ":
        return "a file would be larger than allowed"
    for line in lines:
        for words in DISK_FULL_MESSAGES:
            if words.lower() in line.lower():
                return words
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return ""
    return f"{free} bytes left for {folder}" if free < MIN_FREE_BYTES else ""


def _kill(process: subprocess.Popen[bytes], tree: set[psutil.Process]) -> None:
    """Kill a program with its process group; without groups, with all that it was seen to start."""
    if GROUPS:
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        tree |= _started_by(process.pid)
        with suppress(psutil.Error):
            tree.add(psutil.Process(process.pid))
        for child in tree:
            with suppress(psutil.Error):
                child.kill()
    process.wait()


def _started_by(number: int) -> set[psutil.Process]:
    with suppress(psutil.Error):
        return set(psutil.Process(number).children(recursive=True))
    return set()


@contextmanager
def _watched() -> Iterator[Callable[[int], None]]:
    """Yield a function that lets a shell kill a process group once this process is killed."""
    read, write_end = os.pipe()
    watcher = None

    def watch(group: int) -> None:
        # A library may have made SIGPIPE deadly: nothing is written that nobody reads.
        with suppress(OSError):
            if watcher is not None:
                os.write(write_end, f"{group}\n".encode())

    try:
        with suppress(OSError):  # no such shell
            null = subprocess.DEVNULL
            watcher = subprocess.Popen(
                WATCHER,
                stdin=read,
                stdout=null,
                stderr=null,
                start_new_session=True,
            )
        os.close(read)
        yield watch
    finally:
        # Before the pipe is closed: the number of the group may be in use again by now.
        if watcher is not None:
            watcher.kill()
            watcher.wait()
        os.close(write_end)


# Dask


def check(address: str) -> None:
    """Raise InputError unless a scheduler answers at this address."""
    with connected(address):
        pass


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Yield a client of the scheduler, Dask's logs silenced; InputError where none answers."""
    distributed = dask()
    loggers = [logging.getLogger(name) for name in LOGGERS]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
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
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def dask() -> Any:
    """Import the module `distributed`, which is an extra; InputError where it is not installed."""
    try:
        import distributed
    except ImportError:
        problem = "Dask is not installed; pip install 'bubblefit[cluster]'"
        raise InputError(None, "--scheduler", problem) from None
    return distributed
