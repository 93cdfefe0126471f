"""Registry of the kinds of test: those of the folders beside this file, and those of plug-ins."""

import logging
from collections.abc import Collection, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, cast

from ..errors import InputError, PlugInFailure
from ..plugins import Group, names_with_plug_ins, plug_in_named
from ..presenting import KINDS
from .base import BaseKind, Kind, Presenter
from .own import KIND as OWN

GROUP: Group = "bubblefit.tests"
#: Attributes that a plug-in's kind must have.
NEEDED = ("name", "title", "section", "fitted", "predicted", "studied", "read", "report")

#: Logs a warning only once: kinds are looked up many times.
warn_once = cache(logging.getLogger(__name__).warning)


def kind_names() -> tuple[str, ...]:
    """Return the names of all kinds, ours before those of plug-ins, without importing any."""
    return names_with_plug_ins(GROUP, _folders())


def kinds(names: Collection[str] | None = None) -> Mapping[str, Kind]:
    """Return kinds by name, all or those of the given names.

    Our kinds come first, of these the ones that can be fitted; then those of plug-ins. Plug-ins
    that do not work are logged and left out.
    """
    found_kinds = list[Kind]()
    for name in kind_names() if names is None else names:
        try:
            found_kinds.append(kind_named(name))
        except PlugInFailure as error:
            warn_once("%s", str(error))
    ours = _folders()  # False comes before True
    found_kinds.sort(key=lambda k: (k.name not in ours, k.name in ours and not k.fitted, k.name))
    return {kind.name: kind for kind in found_kinds}


def kind_named(name: str) -> Kind:
    """Return the kind of this name, without importing any other.

    Raises
    ------
    InputError
        There is no kind of this name.
    PlugInFailure
        The kind is one of a plug-in that does not work.
    """
    kind: Kind
    if name == OWN.name:  # of objects, not of a project file: it is none of `kinds`
        return cast(Kind, OWN)
    if name in _folders():
        kind = import_module(f".{name}", __package__).KIND
        return kind
    plug_in = plug_in_named(GROUP, name)
    if plug_in is None:
        raise InputError(None, "kind", f"{name!r} is not one of: {', '.join(kind_names())}")
    kind = plug_in.load("kind of test", NEEDED)
    return kind if BaseKind in type(kind).mro() else cast(Kind, PlugInKind(kind))


def presenter_of(name: str) -> Presenter:
    """Return the presenter of a kind of test: its own `report`, else the one of its class.

    Raises
    ------
    InputError
        There is no kind of this name.
    PlugInFailure
        The kind is one of a plug-in that does not work.
    """
    kind = kind_named(name)
    return cast(Presenter, KINDS.of(kind) if kind.report is None else kind.report)


class PlugInKind(BaseKind):
    """A plug-in's kind that does not derive from `BaseKind`, with defaults for what it lacks."""

    def __init__(self, kind: Any) -> None:
        members = (name for name in dir(kind) if not name.startswith("_"))
        vars(self).update({name: getattr(kind, name) for name in members})


@cache
def _folders() -> tuple[str, ...]:
    """Return the names of the subpackages here; each holds the kind of its name as `KIND`."""
    folder = str(Path(__file__).parent)
    return tuple(module.name for module in iter_modules([folder]) if module.ispkg)
