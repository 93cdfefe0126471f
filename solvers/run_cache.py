"""Runs of external solvers that ended well, kept under what they depend on: one folder for all.

A file a run, named by its key, in folders by the key's first two digits. A file appears whole
under its name (it is written beside and renamed), so that any number of processes and machines may
write and read the same folder, a network file system's among them: there is no lock and no
database, which many of those do not carry.
"""

from __future__ import annotations

import functools
import logging
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..caching import cache_folder
from ..errors import OutputError
from ..writing import write_text
from .base import History, announce
from .history_file import Damaged, from_bytes, to_bytes

log = logging.getLogger(__name__)

#: "off", or the folder, instead of what a project says.
VARIABLE = "BUBBLEFIT_RUNS"
OFF = "off"
SUFFIX, CUT = ".run", ".part"
#: Bytes beyond which the runs that were not used for longest go, and the file that says another.
LIMIT, LIMIT_FILE = 2 * 1000**3, "limit"
#: Down to this share of the limit, so that not every run has to make room.
ROOM = 0.9
#: Runs written by this process after which it looks again how full others have made the folder.
LOOK = 50
#: s; what was begun earlier and has no name yet was cut off.
OLD = 86400.0


@dataclass(frozen=True)
class Entry:
    """A run in the cache: its file, bytes, and when it was last written or read (s, Unix)."""

    path: Path
    size: int
    used: float


class RunCache:
    """The runs in a folder, which need not be there yet."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._held: int | None = None
        self._written, self._told = 0, False

    @property
    def limit(self) -> int:
        """Bytes beyond which runs go: what the folder says, else `LIMIT`."""
        with suppress(OSError, ValueError):
            return max(0, int((self.folder / LIMIT_FILE).read_text(encoding="ascii")))
        return LIMIT

    def set_limit(self, limit: int) -> None:
        """Say it in the folder, for all who use it, and make room; raises OutputError."""
        write_text(self.folder / LIMIT_FILE, f"{limit}\n")
        self.prune(limit)

    def read(self, key: str) -> History | None:
        """The run under this key; None where there is none.

        A damaged one is dropped, and said so.
        """
        path = self._file(key)
        try:
            history = from_bytes(path.read_bytes(), key)
        except FileNotFoundError:
            return None
        except (Damaged, OSError) as error:
            why = error.strerror if isinstance(error, OSError) else str(error)
            announce(f"{path} is dropped from the cache of runs and run again: {why}")
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):  # of somebody else, or on a file system that may only be read
            os.utime(path)
        return history

    def write(self, key: str, history: History, seconds: float) -> None:
        """Keep a run that took so long; where that cannot be, it is said once."""
        try:
            content = to_bytes(history, key, seconds)
        except (ValueError, TypeError) as error:
            log.info("a run is not kept: %s", error)
            return
        path = self._file(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # A name of its own: two machines can have processes of one number.
            number, name = tempfile.mkstemp(CUT, ".", path.parent)
            try:
                with open(number, "wb") as stream:
                    stream.write(content)
                os.replace(name, path)
            finally:
                with suppress(OSError):
                    os.unlink(name)
            self._bound(len(content))
        except OSError as error:
            self.not_kept(error)

    def not_kept(self, error: OSError) -> None:
        """Told once: a run that is not kept is as good."""
        level = logging.INFO if self._told else logging.WARNING
        log.log(level, "%s: runs cannot be kept there: %s", self.folder, error.strerror)
        self._told = True

    def entries(self) -> list[Entry]:
        """Every run that is there, that of the longest ago first."""
        found = []
        for path in self._files(SUFFIX):
            with suppress(OSError):  # gone meanwhile
                about = path.stat()
                found.append(Entry(path, about.st_size, about.st_mtime))
        return sorted(found, key=lambda entry: (entry.used, entry.path))

    def prune(self, size: int | None = None, older: float | None = None) -> list[Entry]:
        """Drop what was used longest ago until `size` bytes are left; what, of all.

        older : s; drop also what was not used for so long.

        Raises
        ------
        OutputError : a file cannot be removed.
        """
        entries, now = self.entries(), time.time()
        left, gone = sum(entry.size for entry in entries), []
        for entry in entries:
            if (size is not None and left > size) or (
                older is not None and now - entry.used > older
            ):
                try:
                    entry.path.unlink(missing_ok=True)
                except OSError as error:
                    problem = f"cannot be removed: {error.strerror}"
                    raise OutputError(f"{entry.path}: {problem}") from None
                left -= entry.size
                gone.append(entry)
        for path in self._files(CUT):
            with suppress(OSError):
                if now - path.stat().st_mtime > OLD:
                    path.unlink()
        self._held = left
        return gone

    def _bound(self, more: int) -> None:
        """Make room where what is there, `more` bytes of it just written, is beyond the limit."""
        self._written += 1
        if self._held is None or self._written % LOOK == 0:
            self._held = sum(entry.size for entry in self.entries())
        else:
            self._held += more
        if self._held > (limit := self.limit):
            with suppress(OutputError):
                gone = self.prune(int(ROOM * limit))
                log.info("%d runs dropped from %s", len(gone), self.folder)

    def _file(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}{SUFFIX}"

    def _files(self, suffix: str) -> Iterator[Path]:
        # Hidden files are those that are being written.
        wanted = f"[0-9a-f][0-9a-f]/{'.' if suffix == CUT else '[0-9a-f]'}*{suffix}"
        return self.folder.glob(wanted)


def run_cache(said: bool | str | Path = True) -> RunCache | None:
    """The cache that is used: none where either the project or the environment turns it off.

    said : by the project: whether there is one, or its folder; the environment's counts before.
    """
    named = os.environ.get(VARIABLE, "")
    if said is False or named.lower() == OFF:
        return None
    place = named or (str(said) if said is not True else "")
    return _cache_in(Path(place).expanduser().absolute() if place else cache_folder() / "runs")


@functools.cache
def _cache_in(folder: Path) -> RunCache:
    """One a folder: how full it is, is known to all solvers of a process."""
    return RunCache(folder)
