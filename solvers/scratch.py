"""Scratch folders of external solvers: fresh for every run, in memory where there is room."""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path

from ..errors import OutputError

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
