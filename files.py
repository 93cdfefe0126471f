"""Text from Jinja2 templates, all read in one way: what they ask for must be there.

A template may be a user's own, or lie beside a project that somebody else wrote. All are rendered
in a sandbox: they reach no further than the values they are given, and change none of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from .errors import PlugInFailure

if TYPE_CHECKING:
    import jinja2

__version__ = "0.2.0"
TEMPLATES = Path(__file__).resolve().parent / "templates"


def environment(loader: jinja2.BaseLoader, html: bool = False) -> jinja2.Environment:
    """Where templates are found, and how they are read.

    html : whether values are escaped.
    """
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
    """Text of `template` (a path below templates/).

    Raises
    ------
    jinja2.UndefinedError : the template asks for what the context does not have.
    """
    import jinja2

    return environment(jinja2.FileSystemLoader(TEMPLATES)).get_template(template).render(context)


# What other distributions add: laws, kinds of test, readers and solvers, by entry points.
#
# Names are looked up without importing anything; a plug-in is imported when its name is asked for.
# One that does not work is one line that names the distribution, and breaks nothing else.

Group = Literal["bubblefit.laws", "bubblefit.tests", "bubblefit.readers", "bubblefit.solvers"]


@dataclass(frozen=True)
class PlugIn:
    """One thing that another distribution offers.

    Parameters
    ----------
    name : what a project file or an option calls it.
    distribution : who offers it, "NAME VERSION".
    entry : of the distribution's metadata; not imported yet.
    """

    name: str
    distribution: str
    entry: EntryPoint

    def load(self, what: str = "", needs: Sequence[str] = ()) -> Any:
        """Import what the entry point names.

        Parameters
        ----------
        what : what it should be, in a word, for the complaint: "form".
        needs : attributes that it must have to be one.

        Raises
        ------
        PlugInFailure : it cannot be imported, or lacks one of `needs`.
        """
        try:
            thing = self.entry.load()
        # A module may do anything when it is imported, sys.exit included.
        except (Exception, SystemExit) as error:
            raise self.failure("cannot be imported", error) from error
        missing = [attribute for attribute in needs if not hasattr(thing, attribute)]
        if missing:
            lacks = f"{self.entry.value} has no {', '.join(missing)}"
            raise self.failure(f"is no {what or 'plug-in of this kind'}: {lacks}")
        return thing

    def failure(self, what: str, error: BaseException | None = None) -> PlugInFailure:
        """The plug-in is at fault: one line that names the distribution.

        Parameters
        ----------
        what : what it does, "fails its check".
        error : what it raised; its class and the first line of its message are told.
        """
        cause = ""
        if error is not None:
            first = (str(error).splitlines() or [""])[0]
            cause = f" ({type(error).__name__}{': ' if first else ''}{first})"
        problem = f"the plug-in {self.name!r} of {self.distribution} {what}{cause}"
        return PlugInFailure(f"{problem}; repair or uninstall it")


def plug_ins(group: Group) -> list[PlugIn]:
    """Every plug-in of a group that is installed, by name; two of one name are both there."""
    offers = {}
    for entry in entry_points(group=group):
        # An editable install may be listed twice.
        offers[entry.name, entry.value] = PlugIn(entry.name, _distribution(entry), entry)
    return [offers[key] for key in sorted(offers)]


def plug_in_named(group: Group, name: str) -> PlugIn | None:
    """The plug-in of that name, or None.

    Raises
    ------
    PlugInFailure : two distributions offer it.
    """
    offers = [plug_in for plug_in in plug_ins(group) if plug_in.name == name]
    if len(offers) > 1:
        both = " and ".join(offer.distribution for offer in offers)
        raise PlugInFailure(f"{name}: is offered by {both}; uninstall one of them")
    return offers[0] if offers else None


def names_with(group: Group, ours: Iterable[str]) -> tuple[str, ...]:
    """Our own names in their order, then those that plug-ins add, sorted.

    A plug-in with one of our names adds none: it never takes the place of one of ours, so whoever
    looks a name up asks for ours first.
    """
    ours = tuple(ours)
    theirs = {plug_in.name for plug_in in plug_ins(group)} - {*ours}
    return (*ours, *sorted(theirs))


def _distribution(entry: EntryPoint) -> str:
    try:
        if entry.dist is not None:
            return f"{entry.dist.name} {entry.dist.version}"
    except Exception:  # noqa: S110 - a damaged installation: what it is called is only for the message
        pass
    return f"an unknown distribution ({entry.value})"
