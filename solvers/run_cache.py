"""Cached runs of external solvers that ended well, under a digest of what they depend on.

A file a run, named by its key; it appears whole under its name, so that processes and machines may
share the folder, also on a network file system: no lock, no database, nothing unpickled.
"""

import functools
import hashlib
import io
import json
import logging
import os
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BubblefitError, OutputError
from ..light_dataclasses import dataclass
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, as_note
from ..storage.writing import cache_folder, write_text
from ..version import __version__
from . import base
from .decks import code_mark, program_mark

log = logging.getLogger(__name__)

#: "off", or the folder, before the project's setting.
VARIABLE = "BUBBLEFIT_RUNS"
OFF = "off"
SUFFIX = ".run"
CUT = ".part"
#: Bytes beyond which the runs that were not used for longest are dropped.
LIMIT = 2 * 1000**3
#: File of the folder that holds another limit.
LIMIT_FILE = "limit"
#: Share of the limit to which runs are dropped, so that not every run has to make room.
PRUNED_SHARE = 0.9
#: Runs written by this process until it measures the folder again, which others fill as well.
RUNS_PER_MEASURE = 50
#: s; a file that was begun earlier and has no name yet was cut off.
MAX_WRITING_SECONDS = 86400.0
#: First bytes of every file, with the number of its layout.
TITLE = b"bubblefit run 1\n"
#: Fields that are no arrays, and fields that are not of the run itself.
PLAIN_FIELDS = ("iterations", "unstable", "remarks", "early", "relaxed")
NOT_WRITTEN = ("seconds", "from_cache", "model", "law")


def digest_of(*things: object) -> str:
    """Return the SHA-256 of this version and of plain things, by content; TypeError for others."""
    digest = hashlib.sha256(__version__.encode())
    for part in _parts(things):
        # Lengths in front: "ab", "c" is not "a", "bc".
        digest.update(f"{len(part)}:".encode())
        digest.update(part)
    return digest.hexdigest()


def _parts(thing: object) -> Iterator[bytes]:
    """Yield bytes that identify a thing by type and content; TypeError for an unknown type."""
    if thing is None or isinstance(thing, (bool, int, float, str, bytes)):
        yield f"{type(thing).__name__} {thing!r}".encode()
    elif isinstance(thing, np.ndarray):
        yield f"array {thing.dtype.str} {thing.shape}".encode()
        yield np.ascontiguousarray(thing).tobytes()
    elif isinstance(thing, np.generic):
        yield from _parts(thing.item())
    elif is_dataclass(thing):
        yield f"of {type(thing).__name__}".encode()
        for field in fields(thing):
            yield field.name.encode()
            yield from _parts(getattr(thing, field.name))
    elif isinstance(thing, Mapping):
        yield f"mapping {len(thing)}".encode()
        for key in sorted(thing, key=repr):
            yield from _parts(key)
            yield from _parts(thing[key])
    elif isinstance(thing, Sequence):
        yield f"sequence {len(thing)}".encode()
        for item in thing:
            yield from _parts(item)
    else:
        raise TypeError(f"{type(thing).__name__}: what it holds is not known")


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
        self._total_size: int | None = None
        self._written = 0
        self._warned = False

    @property
    def limit(self) -> int:
        """Return the largest size of all runs in bytes: the limit in the folder, else `LIMIT`."""
        with suppress(OSError, ValueError):
            return max(0, int((self.folder / LIMIT_FILE).read_text(encoding="ascii")))
        return LIMIT

    def set_limit(self, limit: int) -> None:
        """Write the limit into the folder, for all users, and make room; raises OutputError."""
        write_text(self.folder / LIMIT_FILE, f"{limit}\n")
        self.prune(limit)

    def read(self, key: str) -> base.History | None:
        """Return the run under this key, or None; drop a damaged one with an announcement."""
        path = self._file(key)
        try:
            history = from_bytes(path.read_bytes(), key)
        except FileNotFoundError:
            return None
        except (Damaged, OSError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            base.announce(f"{path} is dropped from the cache of runs and run again: {reason}")
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):  # another user's, or on a read-only file system
            os.utime(path)
        return history

    def write(self, key: str, history: base.History, seconds: float) -> None:
        """Keep a run that took so many seconds; warn once where that cannot be."""
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
        """Warn, once, that a run could not be written."""
        level = logging.INFO if self._warned else logging.WARNING
        log.log(level, "%s: runs cannot be kept there: %s", self.folder, error.strerror)
        self._warned = True

    def entries(self) -> list[Entry]:
        """Return every run that is there, the least recently used first."""
        entries = []
        for path in self._files(SUFFIX):
            with suppress(OSError):  # gone meanwhile
                about = path.stat()
                entries.append(Entry(path, about.st_size, about.st_mtime))
        return sorted(entries, key=lambda entry: (entry.used, entry.path))

    def prune(self, size: int | None = None, older: float | None = None) -> list[Entry]:
        """Drop the least recently used runs to `size` bytes, those `older` (s) too; OutputError."""
        entries = self.entries()
        current_time = time.time()
        total_size = sum(entry.size for entry in entries)
        dropped = []
        for entry in entries:
            if (size is not None and total_size > size) or (
                older is not None and current_time - entry.used > older
            ):
                try:
                    entry.path.unlink(missing_ok=True)
                except OSError as error:
                    problem = f"cannot be removed: {error.strerror}"
                    raise OutputError(f"{entry.path}: {problem}") from None
                total_size -= entry.size
                dropped.append(entry)
        for path in self._files(CUT):
            with suppress(OSError):
                if current_time - path.stat().st_mtime > MAX_WRITING_SECONDS:
                    path.unlink()
        self._total_size = total_size
        return dropped

    def _bound(self, added_bytes: int) -> None:
        """Make room where the runs are beyond the limit; `added_bytes` were just written."""
        self._written += 1
        if self._total_size is None or self._written % RUNS_PER_MEASURE == 0:
            self._total_size = sum(entry.size for entry in self.entries())
        else:
            self._total_size += added_bytes
        if self._total_size > (limit := self.limit):
            with suppress(OutputError):
                dropped = self.prune(int(PRUNED_SHARE * limit))
                log.info("%d runs dropped from %s", len(dropped), self.folder)

    def _file(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}{SUFFIX}"

    def _files(self, suffix: str) -> Iterator[Path]:
        # Files that are being written are hidden.
        pattern = f"[0-9a-f][0-9a-f]/{'.' if suffix == CUT else '[0-9a-f]'}*{suffix}"
        return self.folder.glob(pattern)


def run_cache(setting: bool | str | Path = True) -> RunCache | None:
    """Return the cache in use, None if off.

    Parameters
    ----------
    setting
        By the project, below the environment.
    """
    named = os.environ.get(VARIABLE, "")
    if setting is False or named.lower() == OFF:
        return None
    place = named or (str(setting) if setting is not True else "")
    return _cache_in(Path(place).expanduser().absolute() if place else cache_folder() / "runs")


@functools.cache
def _cache_in(folder: Path) -> RunCache:
    """Return the one cache of a folder: all solvers of a process share its size."""
    return RunCache(folder)


# A history as bytes and back, compressed and checked


class Damaged(ValueError):
    """Bytes that differ from those that were written."""


def to_bytes(history: base.History, key: str, seconds: float) -> bytes:
    """Return history, key and seconds behind a checksum; ValueError, TypeError: not to be kept."""
    if type(history) is not base.History:
        raise TypeError(f"{type(history).__name__} is not a History")
    arrays: dict[str, Any] = {}
    for name in (field.name for field in fields(base.History)):
        value = getattr(history, name)
        if name in PLAIN_FIELDS or name in NOT_WRITTEN or value is None:
            continue
        if name == "reactions":
            arrays |= {f"reactions of {body}": _numbers(value[body], name) for body in value}
        else:
            arrays[name] = _numbers(value, name)
    remarks = [(note.kind, str(note), note.of) for note in map(as_note, history.remarks)]
    unstable = None if history.unstable is None else list(map(str, history.unstable))
    words = {
        "key": key,
        "seconds": float(seconds),
        "iterations": int(history.iterations),
        "unstable": unstable,
        "remarks": remarks,
        "early": str(history.early),
        "relaxed": bool(history.relaxed),
    }
    content = io.BytesIO()
    np.savez_compressed(content, words=np.array(json.dumps(words)), **arrays)
    payload = content.getvalue()
    return TITLE + hashlib.sha256(payload).digest() + payload


def from_bytes(content: bytes, key: str) -> base.History:
    """Return the history that `to_bytes` wrote under this key.

    Raises
    ------
    Damaged
        The bytes are not such a history; the message says why.
    """
    start = len(TITLE) + hashlib.sha256().digest_size
    if not content.startswith(TITLE):
        raise Damaged("it is not a run that was kept, or of another version")
    if hashlib.sha256(content[start:]).digest() != content[len(TITLE) : start]:
        raise Damaged("its checksum is wrong")
    # The checksum is no proof against forgery: nothing is ever unpickled.
    try:
        with np.load(io.BytesIO(content[start:]), allow_pickle=False) as arrays:
            words = json.loads(str(arrays["words"]))
            if words["key"] != key:
                raise Damaged("it is of another run")
            fields: dict[str, Any] = {
                name: np.array(arrays[name]) for name in arrays.files if name != "words"
            }
        reactions = {
            name.removeprefix("reactions of "): fields.pop(name)
            for name in list(fields)
            if name.startswith("reactions of ")
        }
        return base.History(
            **fields,
            reactions=reactions,
            iterations=int(words["iterations"]),
            unstable=None if words["unstable"] is None else tuple(words["unstable"]),
            remarks=tuple(Note(NoteKind(kind), text, of) for kind, text, of in words["remarks"]),
            early=str(words["early"]),
            seconds=float(words["seconds"]),
            from_cache=True,
            relaxed=bool(words.get("relaxed", False)),
        )
    except (ValueError, KeyError, TypeError, OSError, EOFError, zipfile.BadZipFile) as error:
        if isinstance(error, Damaged):
            raise
        raise Damaged(f"it cannot be read ({error})") from None


def _numbers(value: Any, name: str) -> Any:
    """Return numbers as an array; ValueError unless all are finite."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or not np.isfinite(array).all():
        raise ValueError(f"{name} is not all finite numbers")
    return array


# A solver that looks into a cache before it runs


def with_cache(solver: base.Solver, cache: RunCache, options: Mapping[str, Any]) -> base.Solver:
    """Let a solver look into a cache first unless it is embedded, differentiates, or keeps folders.

    Parameters
    ----------
    options : mapping of str to Any
        Those that may change a result.
    """
    # An analysis in this process is quick; a differentiating solver is asked for derivatives, too,
    # which `run` does not return.
    not_worth_caching = not solver.external or isinstance(solver, base.DifferentiatingSolver)
    if not_worth_caching or getattr(solver, "keep", False):
        return solver
    return cache_runs(solver, cache, options)


def cache_runs(solver: base.Solver, cache: RunCache, options: Mapping[str, Any]) -> base.Solver:
    """Let a solver return runs that are in a cache; those that fail are not kept.

    Replaces `run` of this very object, which is returned, so that it keeps its class and protocols.
    Arguments that are None are not passed on: the `run` of a plug-in may lack them.
    """
    run = solver.run

    def cached_run(
        model: Any,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> base.History:
        key = key_of(solver, options, model, law)
        history = None if key is None else cache.read(key)
        if history is not None:
            return history
        optional: dict[str, Any] = {"scratch": scratch, "timeout": timeout}
        start = time.perf_counter()
        result = run(model, law, **{name: v for name, v in optional.items() if v is not None})
        if key is not None and isinstance(result, base.History):
            seconds = time.perf_counter() - start
            cache.write(key, result, seconds)
            result = replace(result, seconds=seconds)
        return result

    solver.run = cached_run  # type: ignore[method-assign]
    return solver


def key_of(
    solver: base.Solver,
    options: Mapping[str, Any],
    model: Any,
    law: HypoelasticLaw,
) -> str | None:
    """Return the digest of all that a result depends on; None where that is not known."""
    try:
        files = solver.programs if isinstance(solver, base.ProgramSolver) else ()
        program = [program_mark(path) for path in files]
        code = code_mark(type(solver).__module__)
        solver_key = (solver.name, solver.identity, dict(options), program, code)
        return digest_of("run", solver_key, model, law)
    except (TypeError, BubblefitError) as error:  # the run raises the latter again
        log.info("runs of %s are not kept: %s", solver.name, error)
        return None
