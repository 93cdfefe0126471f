"""Files and what lies around them: reading, writing, templates, plug-ins, caches of compiled code.

Untrusted files are read only where regular, not too large, and in time; written files are whole or
not there. Templates are rendered in a sandbox. A plug-in that does not work gives one line that
names its distribution. Heavy libraries are imported where they are used.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import html
import json
import math
import os
import re
import stat
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, cached_property, lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from .errors import NOTES, BubblefitError, InputError, Note, OutputError, PlugInFailure, rows

if TYPE_CHECKING:
    import filelock as filelock
    import jinja2
    import pandas as pandas
    import psutil as psutil

V = TypeVar("V")
__version__ = "0.2.0"
ROOT = Path(__file__).resolve().parent
TEMPLATES = ROOT / "templates"
#: Largest file in bytes: of data, which are read whole into memory, and of text that people write.
LARGEST, LARGEST_WRITTEN = 2**30, 2**24
PIECE = 2**22
#: Opening a pipe does not wait for its writer; 0 on systems without the flag.
NO_WAIT = getattr(os, "O_NONBLOCK", 0)
IS_FOLDER = "is a folder; name a file in it"
#: Parts of a dotted key.
MOST_PARTS = 100
#: Every file with compiled functions. An edit of one must reach the compiled code of all, while
#: numba's own cache looks only at the file in which a function stands.
KERNELS = (
    "materials/pieces.py",
    "materials/memory.py",
    "materials/point_law.py",
    "materials/wrinkles.py",
    "materials/law.py",
    "materials/biaxial_patch.py",
    "materials/closed_path.py",
    "meshes/mesh.py",
    "solvers/membrane/kernel.py",
    "inference/posterior.py",
)

# Reading


def content_of(path: Path | str, most: int = LARGEST) -> bytes:
    """Read a whole regular file; InputError if there is none such, or too large; OSError."""
    too_large = InputError(path, "", f"has more than {most // 2**20} MiB; is it the right file?")
    check_regular(path)
    if os.path.isdir(path):
        raise InputError(path, "", IS_FOLDER)
    # A pipe may have taken its place by now.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NO_WAIT)) as file:
        if os.fstat(file.fileno()).st_size > most:
            raise too_large
        # In pieces: the size that a file of /proc reports is 0.
        pieces = []
        size = 0
        while piece := file.read(PIECE):
            pieces.append(piece)
            size += len(piece)
            if size > most:
                raise too_large
    return b"".join(pieces)


@contextmanager
def reading(path: Path | str, field: str = "") -> Iterator[None]:
    """Turn an OSError within the block into an InputError about `path`."""
    try:
        yield
    except OSError as error:
        raise InputError(path, field, f"cannot be read: {error.strerror}") from None


def toml_of(path: Path, field: str = "") -> dict[str, Any]:
    """Read a TOML file; InputError (about `field` where it cannot be read at all)."""
    try:
        with reading(path, field):
            text = content_of(path, LARGEST_WRITTEN).decode("utf-8-sig")
        # A key of n parts costs tomllib n squared, in time and memory.
        plain = text.replace(" ", "").replace("\t", "")
        if any(part.count(".") > MOST_PARTS for part in re.split(r"[^\w.\"'-]", plain)):
            problem = f"a key, or a text, of more than {MOST_PARTS} parts with points between"
            raise ValueError(problem)
        return tomllib.loads(text)
    except UnicodeDecodeError:
        raise InputError(path, field, "is not a text file in UTF-8") from None
    except (ValueError, RecursionError) as error:  # beside its own, tomllib lets these through
        twice = re.match(r"Cannot declare \('(\w+)',", str(error))
        advice = f"; several tables of one name are written [[{twice[1]}]]" if twice else ""
        raise InputError(path, "TOML syntax", f"{error}{advice}") from None


def is_file(path: Path) -> bool:
    """Return whether there is a regular file of this name, however odd or long the name is."""
    return os.path.isfile(path)  # Path.is_file raises an OSError where the name is too long


def no_file_words(path: Path | str) -> str:
    """Return why a name is not that of a file: nothing is there, or a folder."""
    if os.path.isdir(path):
        return f"{path} {IS_FOLDER}"
    return f"there is no file {path}"


def check_regular(path: Path | str) -> None:
    """Raise InputError for a device, a pipe, or a name that no file can have; or OSError."""
    try:
        mode = os.stat(path).st_mode
    except ValueError:
        shown = str(path).replace("\0", "\\0")
        raise InputError(shown, "", "no file can have such a name") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(path, "", "is no regular file but a device or a pipe; copy it into a file")


def checksum(path: Path | str) -> str:
    """Return the SHA-256 of a file's content in hexadecimal digits; InputError if unreadable."""
    with reading(path), open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def process_context() -> Any:
    """Return the context of multiprocessing: the program's choice, else fork on Linux.

    With fork, compiled kernels and data are there already and no script needs a guard.
    """
    import multiprocessing

    forks = sys.platform == "linux" and hasattr(os, "fork")
    chosen = multiprocessing.get_start_method(allow_none=True)
    return multiprocessing.get_context(chosen or ("fork" if forks else "spawn"))


#: Whoever sets one of these has said how many threads there are.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS use one thread within the block, unless the environment says how many.

    The matrices are too small to share: on two busy cores `check` of 80,000 points took 22 s of
    processor time with a thread a core, 5 s with one.
    """
    from threadpoolctl import threadpool_limits

    said = any(os.environ.get(name) for name in THREADS)
    with threadpool_limits(None if said else 1, user_api="blas"):
        yield


@contextmanager
def given(variable: ContextVar[V], value: V) -> Iterator[None]:
    """Give a variable of the context a value within the block."""
    before = variable.set(value)
    try:
        yield
    finally:
        variable.reset(before)


def ends(call: Callable[[], object], seconds: float) -> bool:
    """Return whether a call ends within `seconds`, in any way but a crash of its process.

    Tried in a process of its own (`call` is picklable where these are spawned), errors left to the
    caller's own call. A daemonic process may start none: nothing is tried there.
    """
    import multiprocessing

    if multiprocessing.current_process().daemon:
        return True
    process = process_context().Process(target=_quietly, args=(call,), daemon=True)
    process.start()
    process.join(seconds)
    if process.is_alive():
        process.kill()
    process.join()
    return bool(process.exitcode == 0)


def _quietly(call: Callable[[], object]) -> None:
    with suppress(Exception, KeyboardInterrupt):
        call()


# Writing


@contextmanager
def output_errors(path: Path | str) -> Iterator[None]:
    """Turn an OSError within the block into an OutputError about `path`."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: {unwritable_words(error)} another --out") from error


def unwritable_words(error: OSError) -> str:
    """Return why something cannot be written and what to do, up to what to choose instead."""
    is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    advice = "free space or choose" if is_full else "choose"
    return f"cannot be written: {error.strerror or error}; {advice}"


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a path that takes the place of `path` when the block ends well; OutputError."""
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    with output_errors(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            os.replace(temporary, path)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> None:
    """Write a file whole, onto the disk; bytes that are no UTF-8 as "?"; OutputError."""
    text = text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())


def json_text(content: Any) -> str:
    """Return plain values as a JSON file; a number that is not known (not finite) is null."""
    return json.dumps(known(content), indent=1, allow_nan=False) + "\n"


def html_table(caption: str, header: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table for a notebook; every text is escaped."""
    head, *lines = (
        f"<tr>{''.join(f'<{tag}>{html.escape(str(cell))}</{tag}>' for cell in row)}</tr>"
        for tag, row in (("th", header), *(("td", row) for row in rows))
    )
    said = f"<caption>{html.escape(caption)}</caption>"
    return f"<table>{said}<thead>{head}</thead><tbody>{''.join(lines)}</tbody></table>"


def known(value: Any) -> Any:
    """Return plain values of dataclasses and arrays, None for a number that is not finite."""
    if is_dataclass(value):
        return {f.name: known(getattr(value, f.name)) for f in fields(value)}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: known(own) for key, own in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [known(own) for own in value]
    return value if isinstance(value, int | float | None) else str(value)


def remove_unfinished(folder: Path | str) -> None:
    """Remove the temporary files of `replacing` that processes which are gone left in a folder."""
    for path in Path(folder).glob(".*"):
        found = re.fullmatch(r"\..*\.(\d+)(\.[^.]*)?", path.name)
        if found is None or not path.is_file():
            continue
        with suppress(OverflowError):  # no number of a process
            if psutil.pid_exists(int(found[1])):
                continue
        with suppress(OSError):
            path.unlink()


class Later:
    """A heavy module that is imported when something of it is first asked for."""

    def __init__(self, name: str) -> None:
        self.module = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self.module), name)


if not TYPE_CHECKING:
    filelock, pandas, psutil = Later("filelock"), Later("pandas"), Later("psutil")

# Templates


def environment(loader: jinja2.BaseLoader, html: bool = False) -> jinja2.Environment:
    """Return a sandboxed environment, missing variables errors; html : escape the values."""
    import jinja2
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    return ImmutableSandboxedEnvironment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=html,
    )


def render(template: str, /, **context: Any) -> str:
    """Return the text of a template below templates/; a missing variable is an UndefinedError."""
    import jinja2

    return environment(jinja2.FileSystemLoader(TEMPLATES)).get_template(template).render(context)


# Plug-ins

Group = Literal["bubblefit.laws", "bubblefit.tests", "bubblefit.readers", "bubblefit.solvers"]


@dataclass(frozen=True)
class PlugIn:
    """An entry point of another distribution, "NAME VERSION", that is not imported yet."""

    name: str
    distribution: str
    entry: EntryPoint

    def load(self, what: str = "", needs: Sequence[str] = ()) -> Any:
        """Import the object; PlugInFailure: it cannot be, or lacks `needs`, its `name` included."""
        try:
            thing = self.entry.load()
        # A module may do anything when it is imported, sys.exit included.
        except (Exception, SystemExit) as error:
            raise self.failure("cannot be imported", error) from error
        missing = [attribute for attribute in needs if not hasattr(thing, attribute)]
        if missing:
            lacks = f"{self.entry.value} has no {', '.join(missing)}"
            raise self.failure(f"is no {what}: {lacks}")
        if "name" in needs and thing.name != self.name:
            raise self.failure(f"calls its {what} {thing.name!r}; both must have one name")
        return thing

    @contextmanager
    def calling(self, what: str) -> Iterator[None]:
        """Turn what its code raises within the block, but our own errors, into its failure."""
        try:
            yield
        except BubblefitError:
            raise
        except Exception as error:
            raise self.failure(what, error) from error

    def failure(self, what: str, error: BaseException | None = None) -> PlugInFailure:
        """Return an error that names the distribution, `what` it does, and what it raised."""
        cause = ""
        if error is not None:
            first = (str(error).splitlines() or [""])[0]
            cause = f" ({type(error).__name__}{': ' if first else ''}{first})"
        problem = f"the plug-in {self.name!r} of {self.distribution} {what}{cause}"
        return PlugInFailure(f"{problem}; repair or uninstall it")


@lru_cache(maxsize=1)
def _entries(folders: tuple[tuple[str, int], ...]) -> Any:
    """Return what is installed in folders of those times of their last change (30 ms)."""
    return entry_points()


def _changed(folder: str) -> int:
    return os.stat(folder or os.curdir).st_mtime_ns if os.path.exists(folder or os.curdir) else 0


def plug_ins(group: Group) -> list[PlugIn]:
    """Return the installed plug-ins of a group by name, both where two have one name."""
    offers = {}
    for entry in _entries(tuple((at, _changed(at)) for at in sys.path)).select(group=group):
        # An editable install may be listed twice.
        offers[entry.name, entry.value] = PlugIn(entry.name, _distribution(entry), entry)
    return [offers[key] for key in sorted(offers)]


def plug_in_named(group: Group, name: str) -> PlugIn | None:
    """Return the plug-in of that name, or None; PlugInFailure where two distributions offer it."""
    offers = [plug_in for plug_in in plug_ins(group) if plug_in.name == name]
    if len(offers) > 1:
        both = " and ".join(offer.distribution for offer in offers)
        raise PlugInFailure(f"{name}: is offered by {both}; uninstall one of them")
    return offers[0] if offers else None


def names_with(group: Group, ours: Iterable[str]) -> tuple[str, ...]:
    """Return our own names in order, then those that plug-ins add, sorted; ours come first."""
    ours = tuple(ours)
    return (*ours, *sorted({plug_in.name for plug_in in plug_ins(group)} - {*ours}))


def _distribution(entry: EntryPoint) -> str:
    try:
        if entry.dist is not None:
            return f"{entry.dist.name} {entry.dist.version}"
    except Exception:  # noqa: S110 - a damaged installation: the name is only for the message
        pass
    return f"an unknown distribution ({entry.value})"


# Caches of compiled code: kernels here, material libraries and ccx in solvers/calculix


def cache_folder() -> Path:
    """Return $BUBBLEFIT_CACHE, else the user's cache folder of this system; it may not be there."""
    from platformdirs import user_cache_path

    named = os.environ.get("BUBBLEFIT_CACHE")
    return Path(named) if named else user_cache_path("bubblefit", appauthor=False)


@cache
def _kernel_folder() -> Path | None:
    """Return the folder of the kernels compiled from exactly these sources; None if unwritable.

    A new one starts with the kernels that came with the installation, if any: numba takes those
    that were compiled by its own version for this processor, and compiles the others.
    """
    digest = hashlib.sha256(__version__.encode())
    for name in KERNELS:
        digest.update((ROOT / name).read_bytes())
    name = f"kernels-{digest.hexdigest()[:12]}"
    folder = cache_folder() / name
    if (ROOT / name).is_dir() and not folder.exists():
        import shutil

        # Another process may do the same: whole or not there.
        fresh = folder.with_name(f"{name}-{os.getpid()}")
        with suppress(OSError):
            shutil.copytree(ROOT / name, fresh)
            fresh.rename(folder)
        shutil.rmtree(fresh, ignore_errors=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


def kernels_are_compiled() -> bool:
    """Return whether compiled kernels of these sources are kept; else a run compiles first."""
    folder = _kernel_folder()
    return folder is not None and next(folder.rglob("*.nbc"), None) is not None


class Compiled:
    """A function that numba compiles, or loads, at its first call, with those that it calls."""

    def __init__(self, function: Any, options: Mapping[str, Any]) -> None:
        self.function = function
        self.options = options

    def __call__(self, *given: Any) -> Any:
        return self.dispatcher(*given)

    @cached_property
    def dispatcher(self) -> Any:
        """Return numba's function, which takes its place in the module from now on."""
        import numba

        names = self.function.__globals__
        for name in self.function.__code__.co_names:
            if isinstance(other := names.get(name), Compiled):
                names[name] = other.dispatcher
        made = numba.njit(**self.options)(self.function)
        if folder := _kernel_folder():
            with suppress(AttributeError):  # another numba, without these classes: not cached
                made._cache = _kernel_cache(folder)(self.function)
        names[self.function.__name__] = made
        return made


@cache
def _kernel_cache(folder: Path) -> Any:
    """Return numba's cache of functions with its files in a folder, wherever the sources lie."""
    from numba.core import caching

    class Locator(caching._CacheLocator):
        def __init__(self, function: Any, file: str) -> None:
            self.line = str(function.__code__.co_firstlineno)
            self._py_file = file

        def get_cache_path(self) -> str:
            return str(folder)

        def get_source_stamp(self) -> str:
            return folder.name

        def get_disambiguator(self) -> str:
            return self.line

        @classmethod
        def from_function(cls, function: Any, file: str) -> Any:
            return cls(function, file)

    # Attributes are given to `type`: numba has changed the types that it declares for them.
    results = type("Results", (caching.CompileResultCacheImpl,), {"_locator_classes": [Locator]})
    return type("Cache", (caching.FunctionCache,), {"_impl_class": results})


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Return `numba.njit(**options)`, cached where a folder can be written, loaded when called."""
    return lambda function: Compiled(function, options)


def write_notes(folder: Path, notes: Iterable[Note]) -> None:
    """Write notes.csv (of, kind, note), a header alone without any; OutputError."""
    with replacing(folder / NOTES) as path, open(path, "w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, ["of", "kind", "note"], lineterminator="\n")
        table.writeheader()
        table.writerows(rows(notes))
