"""Formats of data files: each a module of `formats`, or a plug-in (`bubblefit.readers`)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

from ..errors import InputError, PlugInFailure
from ..files import PlugIn, check_regular, names_with, plug_in_named, plug_ins

#: What a file holds, and what the `read` of its formats is called with and gives:
#: frame : `read(path, frames.FrameOptions)`, a sequence of `frames.Frame`;
#: machine table : `read(path, machine_tables.TableOptions)`, a `machine_tables.MachineTable`, from
#:     which load curves, loads and bending curves are taken alike;
#: load polynomials : `read(path)`, `curves.PublishedPolynomial` by direction.
Content = Literal["frame", "machine table", "load polynomials"]
#: How much of a file a format may look at to recognise it, bytes.
HEAD = 65536
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Format:
    """One format of data files; read : see `Content`; recognises : by path and head; None: all."""

    name: str
    content: Content
    title: str
    read: Callable[..., Any]
    recognises: Callable[[Path, bytes], bool] | None = None


_FORMATS: dict[tuple[Content, str], Format] = {}


def register_format(one: Format) -> None:
    """Add one of our own formats: the last statement of its module in `formats`."""
    _FORMATS[one.content, one.name] = one


def formats(content: Content) -> tuple[Format, ...]:
    """Return our own formats of a content, by name."""
    _import_formats()
    ours = [one for one in _FORMATS.values() if one.content == content]
    return tuple(sorted(ours, key=lambda one: one.name))


def format_names(content: Content) -> tuple[str, ...]:
    """Return the values of `format =`: our formats of a content, then readers of plug-ins."""
    return names_with("bubblefit.readers", [one.name for one in formats(content)])


def format_named(content: Content, name: str) -> Format:
    """Return the format of this name, ours or that of a plug-in."""
    for one in formats(content):
        if one.name == name:
            return one
    plug_in = plug_in_named("bubblefit.readers", name)
    if plug_in is None:
        known = ", ".join(format_names(content))
        raise InputError(None, "format", f"{name[:40]!r} is not one of: {known}")
    one = _format_of(plug_in)
    if one.content != content:
        raise InputError(None, "format", f"{name!r} is of a {one.content}, not of a {content}")
    return one


def format_of(content: Content, path: Path | str) -> Format:
    """Return the format of a file by its content: ours first, then those of plug-ins that work."""
    path = Path(path)
    head = b""
    ours = formats(content)
    with suppress(OSError), path.open("rb") as file:
        head = file.read(HEAD)
    for group in (ours, _working(content)):
        able = [one for one in group if one.recognises is not None and one.recognises(path, head)]
        if len(able) > 1:
            names = " or ".join(repr(one.name) for one in able)
            raise InputError(path, "", f"the format may be {names}; say which with format")
        if able:
            return able[0]
    return next(one for one in ours if one.recognises is None)


def read_file(content: Content, path: Path | str, name: str | None, *options: Any) -> Any:
    """Read a file by the format named, else by the one that its content shows; see `Content`."""
    with suppress(OSError):  # the reader says why
        check_regular(path)
    chosen = format_of(content, path) if name is None else format_named(content, name)
    return chosen.read(Path(path), *options)


@cache
def _import_formats() -> None:
    """Import every module of `formats`, which registers its own."""
    from . import formats as folder

    for module in iter_modules(folder.__path__):
        import_module(f"{folder.__name__}.{module.name}")


def _working(content: Content) -> Iterator[Format]:
    for plug_in in plug_ins("bubblefit.readers"):
        try:
            one = _format_of(plug_in)
        except PlugInFailure as error:
            log.warning("%s", error)
        else:
            if one.content == content:
                yield one


def _format_of(plug_in: PlugIn) -> Format:
    one = plug_in.load("format", ("name", "content", "read", "recognises"))

    def read(path: Path, *options: Any) -> Any:
        with plug_in.calling(f"fails on {path}"):
            return one.read(path, *options)

    def recognises(path: Path, head: bytes) -> bool:
        try:
            return one.recognises is not None and bool(one.recognises(path, head))
        except Exception as error:
            log.warning("%s", plug_in.failure(f"fails on {path}", error))
            return False

    return replace(one, read=read, recognises=recognises)
