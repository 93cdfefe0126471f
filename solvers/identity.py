"""What a solver's results depend on, in words: for the fingerprint of what is taken up again."""

from __future__ import annotations

import hashlib
from pathlib import Path

import jinja2
import jinja2.meta

from ..errors import InputError
from ..rendering import environment
from ..writing import checksum


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
