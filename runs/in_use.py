"""Locks of output folders: one run at a time writes a folder, named in a locked file there."""

import functools
import inspect
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import datetime
from pathlib import Path
from typing import ParamSpec, TypeVar

from ..errors import BubblefitError, OutputError
from ..lazy_modules import filelock
from ..notes import warn_of, without_warnings
from ..processes import one_blas_thread, temporary_value
from ..solvers.scratch import owner_is_gone, owner_marks
from ..storage.writing import output_errors

P = ParamSpec("P")
R = TypeVar("R")

#: File by which a folder counts as one with results, and what a run writes before it has any.
RUN = "run.json"
BEGINNINGS = (RUN, "provenance.json", "as-run.toml", "history.csv", "report.html", "page.json")
#: Records of the starts of a fit, of which those that failed are no work to go on with.
STARTS = "starts.jsonl"
#: In a folder that is written: marks of the process, the time at which it began, its command.
HOLDER = ".in-use"
#: Calls from `alone_in_folder` to the line of the user: its own, and that of `checked_arguments`.
CALLS_TO_USER = 3
#: Letters of a command that are shown.
MAX_COMMAND_LETTERS = 80
#: Folders that the current call, or one around it, writes.
_folders_in_use: ContextVar[frozenset[Path]] = ContextVar("folders_in_use", default=frozenset())
#: Open files, by folder; a process that is forked must not hold them where this one is killed.
_locks: dict[Path, int] = {}


@contextmanager
def used_alone(folder: Path | str | None) -> Iterator[None]:
    """Hold an output folder within the block, which is made if it is not there.

    Calls within may hold it again. None stands for no folder.

    Raises
    ------
    OutputError
        Another process or thread holds it, or it cannot be made.
    """
    path = None if folder is None else Path(folder).resolve()
    if path is None or path in _folders_in_use.get():
        yield
        return
    # Innermost first; removed again where nothing is written into them.
    new_folders = [parent for parent in (path, *path.parents) if not parent.exists()]
    with output_errors(path):
        if path.exists() and not path.is_dir():
            raise OutputError(f"{folder}: is a file; name a folder for the results")
        path.mkdir(parents=True, exist_ok=True)
        lock = _lock(path, str(folder))
    _locks[path] = lock
    try:
        with temporary_value(_folders_in_use, _folders_in_use.get() | {path}):
            yield
    finally:
        with suppress(OSError):
            (path / HOLDER).unlink(missing_ok=True)
        if _locks.pop(path, None) is not None:
            os.close(lock)
        with suppress(OSError):  # something was written
            for new_folder in new_folders:
                new_folder.rmdir()


def alone_in_folder(function: Callable[P, R]) -> Callable[P, R]:
    """Hold the folder that a function writes, its argument `out` or `folder`, while it runs.

    BLAS has one thread meanwhile. Grave notes of the result are given to `warnings.warn`; those of
    fits within it are not.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        arguments = signature.bind(*args, **kwargs).arguments
        folder = arguments.get("out", arguments.get("folder"))
        with one_blas_thread(), used_alone(folder), _unused_after_failure(folder):
            with without_warnings():
                result = function(*args, **kwargs)
            warn_of(getattr(result, "notes", ()), CALLS_TO_USER)
            return result

    return wrapped


@contextmanager
def _unused_after_failure(folder: Path | str | None) -> Iterator[None]:
    """Free a folder that was new for the corrected command, where the block fails without work."""
    path = Path("" if folder is None else folder)
    is_new = folder is not None and not (path / RUN).exists()
    try:
        yield
    except BubblefitError:
        if is_new and not any(map(_holds_work, path.rglob("*"))):
            for file in path.rglob(RUN):
                file.unlink()
        raise


def _holds_work(file: Path) -> bool:
    """Return whether a file is one with which a run that failed could go on."""
    if file.name == STARTS:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
        return any('"objective": null' not in line for line in lines)
    return file.is_file() and file.name not in (*BEGINNINGS, HOLDER) and file.stat().st_size > 0


def _lock(path: Path, name: str) -> int:
    """Lock the file of the holder, write who that is, and return the open file."""
    while True:
        lock = os.open(path / HOLDER, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            marks = os.read(lock, 10_000).decode(errors="replace").split("\n")
            try:
                is_free = filelock.lock_descriptor(lock, blocking=False)
            except OSError:  # a file system without locks: the process's number will do
                is_free = owner_is_gone(marks[:4])
            if not is_free:
                raise OutputError(f"{name}: {_holder_words(marks)}")
            with suppress(FileNotFoundError):  # removed by its holder meanwhile
                if os.path.samestat(os.fstat(lock), os.stat(path / HOLDER)):
                    began = datetime.now().astimezone().isoformat(" ", "seconds")
                    command = " ".join([Path(sys.argv[0]).name, *sys.argv[1:]])
                    os.ftruncate(lock, 0)
                    lines = [*owner_marks(), began, " ".join(command.split())]
                    os.pwrite(lock, "\n".join(lines).encode(errors="replace"), 0)
                    return lock
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def _holder_words(marks: list[str]) -> str:
    """Return who uses a folder, since when, and what to do."""
    holder = "another process"
    if len(marks) == 6:
        machine, _, process, _, began, command = marks
        words = command[:MAX_COMMAND_LETTERS] or "Python"
        holder = f"process {process} on {machine} ({words}) since {began}"
    return f"is in use by {holder}; wait until that ends, or name another folder with --out"


def _leave_locks_to_parent() -> None:
    """Close the inherited lock files in a forked process; they stay locked by its parent."""
    for lock in _locks.values():
        os.close(lock)
    _locks.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_locks_to_parent)
