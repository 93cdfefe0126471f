"""Forms of the moduli by name: the modules beside this file, and those of other distributions."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from ...errors import BubblefitError, InputError
from ...files import Group, PlugIn, names_with, plug_in_named
from .base import Form

GROUP: Group = "bubblefit.laws"

#: From the name, the settings and the ends of the strain range (eps1, eps2, gamma12) to a form.
Maker = Callable[[str, Mapping[str, Any], Sequence[float]], Form]


@dataclass(frozen=True)
class Offer:
    """A form by name: what makes it, and the settings it takes beside the name.

    of_strain : whether its moduli depend on strain; a fit of moduli that do not needs no range.
    of_load_ratio : whether they depend on the ratio of the loads, which not every solver carries.
    """

    name: str
    make: Maker
    settings: tuple[str, ...] = ()
    of_strain: bool = True
    of_load_ratio: bool = False


_OFFERS: dict[str, Offer] = {}


def register_form(offer: Offer) -> None:
    """Add one of our own forms: the last statement of its module."""
    _OFFERS[offer.name] = offer


def form_names() -> tuple[str, ...]:
    """The names that a project's `[law] form` and a card's `form` may say: ours come first."""
    _import_forms()
    # By module, whichever was imported first.
    ours = sorted(_OFFERS.values(), key=lambda offer: offer.make.__module__)
    return names_with(GROUP, [offer.name for offer in ours])


def form_settings(name: str) -> tuple[str, ...]:
    """The settings that a form takes beside its name; none where there is no such form.

    Raises
    ------
    PlugInFailure : a plug-in that does not work.
    """
    offer, _ = _offer(name)
    return offer.settings if offer else ()


def of_strain(name: str) -> bool:
    """Whether the moduli of a form depend on strain, as far as is known.

    Raises
    ------
    PlugInFailure : as `form_settings`.
    """
    offer, _ = _offer(name)
    return getattr(offer, "of_strain", True)


def of_load_ratio(name: str) -> bool:
    """Whether the moduli of a form depend on the ratio of the loads, as far as is known.

    Raises
    ------
    PlugInFailure : as `form_settings`.
    """
    offer, _ = _offer(name)
    return getattr(offer, "of_load_ratio", False)


def form_named(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> Form:
    """The form of that name, as a project's `[law]` or a card says it.

    Parameters
    ----------
    settings : what stands beside the name: `breaks`, `knots`.
    strain_range : ends (eps1, eps2, gamma12) of the range; UNLIMITED where there is none.

    Raises
    ------
    InputError : a name that no form has, a setting that this form does not take, or does not like.
    PlugInFailure : a plug-in that does not work.
    """
    offer, plug_in = _offer(name)
    if offer is None:
        near = difflib.get_close_matches(name, form_names(), n=1, cutoff=0.5)
        meant = f"did you mean {near[0]!r}? " if near else ""
        problem = f"no form is called {name!r}; {meant}known: {', '.join(form_names())}"
        raise InputError(None, "form", problem)
    for key in settings:
        if key not in offer.settings:
            raise InputError(None, key, f"a {name} law has no {key}")
    if plug_in is None:
        return offer.make(name, settings, strain_range)
    return _made(plug_in, offer, settings, strain_range)


def _offer(name: str) -> tuple[Offer | None, PlugIn | None]:
    """Ours, else that of a plug-in, which never takes the place of one of ours."""
    _import_forms()
    if name in _OFFERS:
        return _OFFERS[name], None
    plug_in = plug_in_named(GROUP, name)
    if plug_in is None:
        return None, None
    offer: Offer = plug_in.load("form", ("name", "make", "settings"))
    if offer.name != name:
        raise plug_in.failure(f"calls its form {offer.name!r}; both must have one name")
    return offer, plug_in


def _made(
    plug_in: PlugIn, offer: Offer, settings: Mapping[str, Any], strain_range: Sequence[float]
) -> Form:
    try:
        form = offer.make(offer.name, settings, strain_range)
    except BubblefitError:
        raise
    except Exception as error:
        raise plug_in.failure("fails when it is made", error) from error
    if not isinstance(form, Form):
        known = [name for name in dir(Form) if not name.startswith("_")]
        missing = ", ".join(name for name in known if not hasattr(form, name))
        raise plug_in.failure(f"gives no form: {type(form).__name__} has no {missing}")
    return form


@cache
def _import_forms() -> None:
    """Each module beside this one registers its own forms when it is imported."""
    for module in iter_modules([str(Path(__file__).parent)]):
        import_module(f".{module.name}", __package__)
