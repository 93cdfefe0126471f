"""Plug-ins: laws, kinds of test, readers and solvers that other distributions install.

They are found by entry points. A plug-in that does not work raises PlugInFailure, whose one line
names the distribution that it comes from.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, distributions
from itertools import chain
from typing import Any, Literal

from .errors import BubblefitError, PlugInFailure
from .light_dataclasses import dataclass

Group = Literal["bubblefit.laws", "bubblefit.tests", "bubblefit.readers", "bubblefit.solvers"]


@dataclass(frozen=True)
class PlugIn:
    """A plug-in that another distribution offers by an entry point; `load` imports it.

    Attributes
    ----------
    name : str
        Name of the plug-in, as a project file gives it.
    distribution : str
        "NAME VERSION" of the distribution that installed it.
    entry : EntryPoint
    """

    name: str
    distribution: str
    entry: EntryPoint

    def load(self, role: str = "", needs: Sequence[str] = ()) -> Any:
        """Import the object that the plug-in offers.

        Parameters
        ----------
        role : str
            What the object serves as, for messages: "law", "reader".
        needs : sequence of str
            Attributes that the object must have. If "name" is among them, the object must have
            the name of the plug-in.

        Raises
        ------
        PlugInFailure
            The object cannot be imported, lacks an attribute, or has another name.
        """
        try:
            loaded = self.entry.load()
        # A module may do anything when it is imported, sys.exit included.
        except (Exception, SystemExit) as error:
            raise self.failure("cannot be imported", error) from error
        missing = [attribute for attribute in needs if not hasattr(loaded, attribute)]
        if missing:
            lacks = f"{self.entry.value} has no {', '.join(missing)}"
            raise self.failure(f"is no {role}: {lacks}")
        if "name" in needs and loaded.name != self.name:
            raise self.failure(f"calls its {role} {loaded.name!r}; both must have one name")
        return loaded

    @contextmanager
    def calling(self, problem: str) -> Iterator[None]:
        """Turn exceptions of the plug-in's code in the block, except ours, into PlugInFailure."""
        try:
            yield
        except BubblefitError:
            raise
        except Exception as error:
            raise self.failure(problem, error) from error

    def failure(self, problem: str, error: BaseException | None = None) -> PlugInFailure:
        """Return the error that says what is wrong with the plug-in.

        Parameters
        ----------
        problem : str
            What is wrong, in words that follow the plug-in's name.
        error : BaseException, optional
            What the plug-in's code raised.
        """
        cause = ""
        if error is not None:
            first_line = (str(error).splitlines() or [""])[0]
            cause = f" ({type(error).__name__}{': ' if first_line else ''}{first_line})"
        plug_in = f"the plug-in {self.name!r} of {self.distribution}"
        return PlugInFailure(f"{plug_in} {problem}{cause}; repair or uninstall it")


@lru_cache(maxsize=1)
def _entries(folders: tuple[tuple[str, int], ...]) -> Any:
    """Return our entry points; a search takes 5 ms.

    `folders` are those of `sys.path` with the time of the last change, ns: the key of the cache, so
    that what is installed meanwhile is found. `importlib.metadata.entry_points` takes 20 ms, as it
    parses the entry points of all distributions.
    """
    offers = dict[str, Distribution]()
    for offer in distributions():
        if "bubblefit." in (offer.read_text("entry_points.txt") or ""):
            offers.setdefault(offer.name, offer)  # a second of that name is not imported
    return EntryPoints(chain.from_iterable(offer.entry_points for offer in offers.values()))


def _changed(folder: str) -> int:
    """Return the time of the last change of a folder, ns; 0 if the folder does not exist."""
    return os.stat(folder or os.curdir).st_mtime_ns if os.path.exists(folder or os.curdir) else 0


def plug_ins(group: Group) -> list[PlugIn]:
    """Return all installed plug-ins of a group, sorted by name; two may have one name."""
    offers = {}
    folders = tuple((folder, _changed(folder)) for folder in sys.path)
    for entry in _entries(folders).select(group=group):
        # An editable install may be listed twice.
        offers[entry.name, entry.value] = PlugIn(entry.name, _distribution(entry), entry)
    return [offers[key] for key in sorted(offers)]


def plug_in_named(group: Group, name: str) -> PlugIn | None:
    """Return the plug-in of a group by its name, or None if no distribution offers it.

    Raises
    ------
    PlugInFailure
        Two distributions offer a plug-in of that name.
    """
    offers = [plug_in for plug_in in plug_ins(group) if plug_in.name == name]
    if len(offers) > 1:
        distributions = " and ".join(offer.distribution for offer in offers)
        raise PlugInFailure(f"{name}: is offered by {distributions}; uninstall one of them")
    return offers[0] if offers else None


def names_with_plug_ins(group: Group, ours: Iterable[str]) -> tuple[str, ...]:
    """Return the names `ours` in their order, then the further names of plug-ins, sorted."""
    ours = tuple(ours)
    return (*ours, *sorted({plug_in.name for plug_in in plug_ins(group)} - {*ours}))


def _distribution(entry: EntryPoint) -> str:
    """Return the name and the version of the distribution that an entry point comes from."""
    try:
        if entry.dist is not None:
            return f"{entry.dist.name} {entry.dist.version}"
    except Exception:  # noqa: S110 - a damaged installation: the name is only for the message
        pass
    return f"an unknown distribution ({entry.value})"
