"""Scratch folders of external solvers: fresh for every run, in memory where there is room."""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import OutputError, SolverFailure
from .process import log_tail

log = logging.getLogger(__name__)

MEMORY = Path("/dev/shm")
#: Free space (bytes) below which runs go to the disk instead; a bubble takes about 2 MB.
ROOM = 256 * 1024**2


def fresh_folder(name: str, parent: Path | None = None) -> Path:
    """A new, empty folder `bubblefit-NAME-...` below `parent` (default: memory, else disk).

    Raises
    ------
    OutputError : it cannot be made.
    """
    place = default_parent() if parent is None else parent
    try:
        place.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"bubblefit-{name}-", dir=place))
    except OSError as error:
        problem = f"no scratch folder can be made: {error.strerror}; choose another"
        raise OutputError(f"{place}: {problem}") from None


@contextmanager
def run_folder(
    name: str, parent: Path | None, keep: bool, solver: str, logs: str
) -> Iterator[Path]:
    """The fresh folder of one run: removed after a good end unless `keep`, kept after a failure.

    Parameters
    ----------
    logs : name of the log in the folder whose tail a failure carries, where it has none yet.

    Raises
    ------
    SolverFailure : the one that the run raised, with the folder and the log. OutputError : as
        `fresh_folder`.
    """
    folder = fresh_folder(name, parent)
    try:
        yield folder
    except SolverFailure as failure:
        kept = put_aside(folder)
        log.info("failed run kept in %s", kept)
        tail = failure.log_tail or log_tail(kept / logs)
        kind = type(failure)
        raise kind(failure.reason, solver, failure.exit_number, tail, kept) from None
    except BaseException:
        remove(folder)  # interrupted, or never begun: there is nothing to look into
        raise
    if keep:
        log.info("run kept in %s", folder)
    else:
        remove(folder)


def default_parent() -> Path:
    """Memory when it has room, else the system's temporary folder."""
    try:
        if os.access(MEMORY, os.W_OK | os.X_OK) and shutil.disk_usage(MEMORY).free > ROOM:
            return MEMORY
    except OSError:
        pass
    return Path(tempfile.gettempdir())


def put_aside(folder: Path) -> Path:
    """Where a failed run is kept: out of memory, onto the disk (where it is, if that is full)."""
    if folder.parent != MEMORY:
        return folder
    target = Path(tempfile.gettempdir()) / folder.name
    try:
        shutil.copytree(folder, target)
    except (OSError, shutil.Error):
        shutil.rmtree(target, ignore_errors=True)
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    return target


def remove(folder: Path) -> None:
    """Remove a scratch folder with what is in it."""
    shutil.rmtree(folder, ignore_errors=True)
