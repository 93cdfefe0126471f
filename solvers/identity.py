"""What a solver's results depend on, in words: for the fingerprint of what is taken up again."""

from __future__ import annotations

import functools
import hashlib
import sys
from pathlib import Path

import jinja2
import jinja2.meta

from ..caching import ROOT
from ..errors import InputError
from ..rendering import environment
from ..writing import checksum

#: Rooms whose files make a run of one of our own adapters what it is.
ROOMS = ("materials", "meshes", "models", "solvers", "templates")
CODE = (".py", ".j2", ".c", ".f")


def in_words(name: str, version: str, **settings: object) -> str:
    """A solver, its version and the settings that matter, in one line."""
    said = [f"{name} {version}".rstrip(), *(f"{key}={value}" for key, value in settings.items())]
    return "; ".join(said)


def file_mark(path: Path) -> str:
    """SHA-256 of a file's content.

    Raises
    ------
    InputError : it cannot be read.
    """
    return checksum(path)


def templates_mark(folder: Path | None) -> str:
    """SHA-256 of the templates in a folder and of the files there that they include.

    Names below the folder and contents count, not where the folder is; what else lies in it
    does not (it may be the project's own, with all its results). "" without a folder.

    Raises
    ------
    InputError : a template cannot be read.
    """
    if folder is None:
        return ""
    waiting = sorted(path.relative_to(folder) for path in folder.rglob("*.j2") if path.is_file())
    marks: dict[str, str] = {}
    while waiting:
        name = waiting.pop()
        if name.as_posix() not in marks:
            marks[name.as_posix()] = file_mark(folder / name)
            waiting += [other for other in _included(folder / name) if (folder / other).is_file()]
    return hashlib.sha256(repr(sorted(marks.items())).encode()).hexdigest()


def program_mark(path: Path) -> str:
    """SHA-256 of a program's content; of a script, of its own text and not of what it calls.

    Raises
    ------
    InputError : it cannot be read.
    """
    try:
        about = path.stat()
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    return _program_mark(path, about.st_mtime_ns, about.st_size, about.st_ino)


@functools.lru_cache(maxsize=64)
def _program_mark(path: Path, *_: int) -> str:
    # Some megabytes: read again only where the file is another.
    return file_mark(path)


@functools.cache
def code_mark(module: str) -> str:
    """SHA-256 of the code that makes decks and reads results.

    That is our own rooms, and of a plug-in every Python file of its package, or its module.

    module : of the solver's class.
    """
    files = {path.relative_to(ROOT).as_posix(): path for room in ROOMS
             for path in (ROOT / room).rglob("*")}  # fmt: skip
    top = module.partition(".")[0]
    if top != __package__.partition(".")[0]:
        package = sys.modules.get(top)
        for folder in map(Path, getattr(package, "__path__", ())):
            files |= {f"{top}/{p.relative_to(folder).as_posix()}": p for p in folder.rglob("*.py")}
        if not hasattr(package, "__path__") and getattr(package, "__file__", None):
            files[f"{top}.py"] = Path(str(getattr(package, "__file__")))  # noqa: B009
    marks = {name: file_mark(path) for name, path in files.items() if path.suffix in CODE}
    return hashlib.sha256(repr(sorted(marks.items())).encode()).hexdigest()


def _included(template: Path) -> list[Path]:
    """Files that a template names in full; what a run is to find wrong with it is left to it."""
    try:
        tree = environment(jinja2.BaseLoader()).parse(_content(template).decode("utf-8"))
    except (jinja2.TemplateSyntaxError, UnicodeDecodeError):
        return []
    found = jinja2.meta.find_referenced_templates(tree)
    return [Path(name) for name in found if name is not None]


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
