"""Register and recognise formats of data files: modules of `formats`, and plug-ins."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

from ..errors import InputError, PlugInFailure
from ..lazy_modules import LazyFunction
from ..light_dataclasses import dataclass
from ..plugins import PlugIn, names_with_plug_ins, plug_in_named, plug_ins
from ..storage.reading import check_regular

is_mat = LazyFunction(f"{__package__}.mat_files", "is_mat")
variable_names = LazyFunction(f"{__package__}.mat_files", "variable_names")

#: What a file holds, and with which arguments the `read` of its formats is called, and its result:
#: frame : `read(path, frames.FrameOptions)`, a sequence of `frames.Frame`;
#: machine table : `read(path, machine_tables.TableOptions)`, a `machine_tables.MachineTable`, from
#:     which load curves, loads and bending curves are taken alike;
#: load polynomials : `read(path)`, `curves.PublishedPolynomial` by direction.
Content = Literal["frame", "machine table", "load polynomials"]
#: Number of bytes at the beginning of a file by which a format is recognised.
HEAD = 65536
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Format:
    """One format of data files.

    Attributes
    ----------
    name : str
        What ``format =`` in a project names.
    content : str
        What files of the format hold.
    title : str
        What the format is, for lists.
    read : callable
        Reads a file; see `Content`.
    recognises : callable or None
        Whether a file, by its path and first bytes, has the format; None for any that no other
        format recognises.
    """

    name: str
    content: Content
    title: str
    read: Callable[..., Any]
    recognises: Callable[[Path, bytes], bool] | None = None


_FORMATS: dict[tuple[Content, str], Format] = {}


def register_format(format: Format) -> None:
    """Register a built-in format; this is the last statement of its module in `formats`."""
    _FORMATS[format.content, format.name] = format


def formats(content: Content) -> tuple[Format, ...]:
    """Return the built-in formats of a content, sorted by name."""
    _import_formats()
    of_content = [format for format in _FORMATS.values() if format.content == content]
    return tuple(sorted(of_content, key=lambda format: format.name))


def format_names(content: Content) -> tuple[str, ...]:
    """Return the allowed values of `format =`: built-in formats of a content, then plug-ins."""
    return names_with_plug_ins("bubblefit.readers", [format.name for format in formats(content)])


def format_named(content: Content, name: str) -> Format:
    """Return the format of this name, built in or of a plug-in.

    Raises
    ------
    InputError
        There is none, or it is of another content.
    PlugInFailure
        The plug-in of this name does not work.
    """
    for format in formats(content):
        if format.name == name:
            return format
    plug_in = plug_in_named("bubblefit.readers", name)
    if plug_in is None:
        names = ", ".join(format_names(content))
        raise InputError(None, "format", f"{name[:40]!r} is not one of: {names}")
    format = _format_of_plug_in(plug_in)
    if format.content != content:
        raise InputError(None, "format", f"{name!r} is of a {format.content}, not of a {content}")
    return format


def format_of(content: Content, path: Path | str) -> Format:
    """Recognise the format of a file: built-in formats are tried first, then those of plug-ins.

    Raises
    ------
    InputError
        Several formats recognise the file.
    """
    path = Path(path)
    head = b""
    with suppress(OSError), path.open("rb") as file:
        head = file.read(HEAD)
    for candidates in (formats(content), _working_plug_ins(content)):
        matching = [f for f in candidates if f.recognises is not None and f.recognises(path, head)]
        if len(matching) > 1:
            names = " or ".join(repr(format.name) for format in matching)
            raise InputError(path, "", f"the format may be {names}; say which with format")
        if matching:
            return matching[0]
    if is_mat(head):
        names = ", ".join(variable_names(path, head) or ("nothing that can be read",))
        problem = f"is a MAT-file of no program that is recognised, with: {names[:200]}"
        raise InputError(path, "", f"{problem}; export text, or write a format as a plug-in")
    return next(format for format in formats(content) if format.recognises is None)


def read_file(
    content: Content,
    path: Path | str,
    name: str | None,
    *options: Any,
) -> Any:
    """Read a file in the named format, or else in the one that is recognised.

    Parameters
    ----------
    content : str
        What the file must hold.
    path : path
    name : str or None
        Name of the format.
    *options
        Arguments of the format's `read` after the path, see `Content`.
    """
    with suppress(OSError):  # the reader says why
        check_regular(path)
    format = format_of(content, path) if name is None else format_named(content, name)
    return format.read(Path(path), *options)


@cache
def _import_formats() -> None:
    """Import every module of `formats`, which registers its own."""
    from . import formats as folder

    for module in iter_modules(folder.__path__):
        import_module(f"{folder.__name__}.{module.name}")


def _working_plug_ins(content: Content) -> Iterator[Format]:
    """Yield the formats of plug-ins; a warning of each that does not work."""
    for plug_in in plug_ins("bubblefit.readers"):
        try:
            format = _format_of_plug_in(plug_in)
        except PlugInFailure as error:
            log.warning("%s", error)
        else:
            if format.content == content:
                yield format


def _format_of_plug_in(plug_in: PlugIn) -> Format:
    """Return the format of a plug-in, whose errors name it."""
    format = plug_in.load("format", ("name", "content", "read", "recognises"))

    def read(path: Path, *options: Any) -> Any:
        with plug_in.calling(f"fails on {path}"):
            return format.read(path, *options)

    def recognises(path: Path, head: bytes) -> bool:
        try:
            return format.recognises is not None and bool(format.recognises(path, head))
        except Exception as error:
            log.warning("%s", plug_in.failure(f"fails on {path}", error))
            return False

    return replace(format, read=read, recognises=recognises)
