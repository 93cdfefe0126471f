"""Define what a form of the moduli is, and register the forms of this package and of plug-ins.

A form says how the coefficients beta of a law make its moduli. In every form a modulus is a
PIECEWISE CUBIC of its own logarithmic strain, whose coefficients are linear in beta. A form may
also have a method `by_load_ratio`: its E1 and E2 are then those at equal loads, and grow with the
normalised load ratio of their own yarns by a gain linear in beta (`ratio_map`). A form with a
method `by_crimp` has yarns that exchange crimp (`crimp_map`), and bounds of the constants of this
(`own_bounds`).

The strain components are 0 (eps1, on which E1 depends), 1 (eps2, E2) and 2 (gamma12, on whose size
G12 depends). A piece holds for strains up to its upper end, which belongs to it. Beyond the end of
the strain range and below zero strain a modulus is constant.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError, did_you_mean
from ...light_dataclasses import dataclass
from ...plugins import Group, PlugIn, names_with_plug_ins, plug_in_named

Array = NDArray[np.float64]
#: The strain component that each modulus depends on.
COMPONENTS: Mapping[str, int] = {"E1": 0, "E2": 1, "G12": 2}
#: The moduli in the order in which beta lists them.
ORDER = ("G12", "E2", "E1")
#: The shear modulus, on which the stability of a membrane depends.
SHEAR = "G12"
#: Names of the strain components in files: of eps1, eps2, gamma12.
STRAIN_NAMES = ("warp", "fill", "shear")
#: The normalised load ratio n / sqrt(n_warp^2 + n_fill^2) of either yarn where both carry the same.
EVEN = math.sqrt(0.5)
#: Ends of that ratio, where one of the yarns carries all.
RATIO_ENDS = (0.0, 1.0)
#: Stands for the end of a strain range that has none.
UNLIMITED = 1e9
#: Number of strains at which a modulus of one piece is checked to be positive: between two of them
#: a cubic can dip by no more than 0.7 % of its largest value (Markov's bound on its curvature).
GRID = 31


@runtime_checkable
class LawForm(Protocol):
    """A form of the moduli, the map from beta to them; frozen, hashable and comparable by value.

    The defaults here are for a form of one piece whose beta are moduli at control strains.

    Attributes
    ----------
    name : str
        Name of the form in a project and in a card.
    size : int
        Number of entries of beta.
    labels : tuple of str
        Label of each entry of beta.
    free : tuple of int
        Indices of the entries that a fit may change; the others are zero.
    modulus_of : tuple of str
        The modulus ("E1", "E2", "G12"), or the bound of `own_bounds`, that each entry belongs to.
    """

    @property
    def name(self) -> str: ...

    @property
    def size(self) -> int: ...

    @property
    def labels(self) -> tuple[str, ...]: ...

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(range(self.size))

    @property
    def modulus_of(self) -> tuple[str, ...]: ...

    def piece_map(self) -> Array:
        """Return (3, P, 4, size), d (coefficients of each piece, highest power first) / d beta."""
        ...

    def uppers(self) -> Array:
        """Return (3, P) upper ends of the pieces, increasing; the last is UNLIMITED."""
        return np.full((3, 1), UNLIMITED)

    def grid(self, component: int, end: float) -> Array:
        """Return increasing strains from 0 to `end` at which positivity and bounds are checked."""
        ...

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the matrix (free, free) from moduli at control strains to free entries of beta."""
        return np.eye(len(self.free))

    def to_card(self) -> dict[str, Any]:
        """Return the settings that a card has beside beta, as knots, for `form_named` to read."""
        return {}

    def describe(self) -> str:
        """Describe the entries of beta in one sentence, for a card's header and a report."""
        ...

    def __hash__(self) -> int:
        return object.__hash__(self)


def components_of(form: LawForm) -> Mapping[str, int]:
    """Return the strain component of each modulus that a form has; none without a law."""
    return COMPONENTS if form.size else {}


def ratio_map(form: LawForm) -> Array:
    """Return (2, size), d (gain of E1 and E2 by their load ratio, from 0 to 1) / d beta."""
    by_load_ratio = getattr(form, "by_load_ratio", None)
    if by_load_ratio is None:
        return np.zeros((2, form.size))
    return np.asarray(by_load_ratio(), dtype=float)


def crimp_map(form: LawForm) -> Array:
    """Return (3, size), d (T1, T2, S of crimp interchange) / d beta, or (0, size) without."""
    by_crimp = getattr(form, "by_crimp", None)
    return np.zeros((0, form.size)) if by_crimp is None else np.asarray(by_crimp(), dtype=float)


def own_bounds(form: LawForm) -> Mapping[str, tuple[float, float]]:
    """Return bounds (MPa) of entries of beta that are no moduli, by their name in `modulus_of`."""
    return getattr(form, "own_bounds", {})


def ratios_of(form: LawForm, name: str) -> tuple[float, ...]:
    """Return the load ratios at which a modulus is checked to be positive, equal loads first."""
    component = COMPONENTS[name]
    depends = name != SHEAR and ratio_map(form)[component].any()
    return (EVEN, *RATIO_ENDS) if depends else (EVEN,)


@lru_cache(maxsize=64)
def _pieces_in_range(form: LawForm, ends: tuple[float, ...]) -> tuple[Array, Array]:
    """Return `uppers` (3, P) and `piece_map` (3, P, 4, size) without pieces beyond the range."""
    uppers = form.uppers()
    rows = form.piece_map()
    lowers = np.column_stack([np.zeros(3), uppers[:, :-1]])
    # Of a repeated last piece the first is enough.
    used = (lowers < np.array(ends)[:, None]) & (lowers < UNLIMITED)
    count = used.sum(axis=1)
    place = np.minimum(np.arange(count.max()), count[:, None] - 1)
    uppers = np.minimum(np.take_along_axis(uppers, place, axis=1), np.array(ends)[:, None])
    rows = np.ascontiguousarray(rows[np.arange(3)[:, None], place])
    uppers.flags.writeable = rows.flags.writeable = False
    return uppers, rows


def map_in_range(form: LawForm, strain_range: Sequence[float]) -> Array:
    """Return `piece_map` (3, P, 4, size) without the pieces beyond the strain range."""
    return _pieces_in_range(form, tuple(strain_range))[1]


def pieces_of(form: LawForm, beta: ArrayLike, strain_range: Sequence[float]) -> Array:
    """Evaluate the pieces of the moduli.

    Parameters
    ----------
    form : LawForm
    beta : (size,) array_like, MPa
    strain_range : (3,) sequence of float
        Ends of (eps1, eps2, gamma12).

    Returns
    -------
    (3, P, 5) ndarray, MPa
        Upper end and coefficients of each piece, highest power first; read-only. The last upper end
        is that of the range; a component with fewer pieces repeats its last one.
    """
    uppers, rows = _pieces_in_range(form, tuple(strain_range))
    pieces = np.empty((*uppers.shape, 5))
    pieces[..., 0] = uppers
    pieces[..., 1:] = rows @ np.asarray(beta, dtype=float)
    pieces.flags.writeable = False
    return pieces


def held_strain(component: int, strain: ArrayLike, end: float) -> Array:
    """Return the strain at which a modulus is taken: within 0 to `end`, by its size for shear."""
    x = np.asarray(strain, dtype=float)
    return np.clip(np.abs(x) if component == 2 else x, 0.0, end)


def modulus_rows(
    form: LawForm,
    name: str,
    strain: ArrayLike,
    strain_range: Sequence[float],
    ratio: float = EVEN,
) -> Array:
    """Differentiate a modulus by beta.

    Parameters
    ----------
    form : LawForm
    name : {"E1", "E2", "G12"}
    strain : (n,) array_like
        Log strain; outside the range the modulus is that at its end.
    strain_range : (3,) sequence of float
        Ends of (eps1, eps2, gamma12).
    ratio : float
        Normalised load ratio of the modulus' own yarn.

    Returns
    -------
    (n, size) ndarray
    """
    component = COMPONENTS[name]
    uppers, rows = _pieces_in_range(form, tuple(strain_range))
    clamped_strain = held_strain(component, strain, uppers[component, -1])
    place = np.searchsorted(uppers[component, :-1], clamped_strain)
    powers = np.vander(clamped_strain, 4)
    at_even_loads = np.einsum("ni,nij->nj", powers, rows[component, place])
    if name == SHEAR:
        return at_even_loads
    return at_even_loads + (ratio - EVEN) * ratio_map(form)[component]


def moduli_on_grid(form: LawForm, strain_range: Sequence[float]) -> dict[str, Array]:
    """Return by modulus (n, size) rows whose product with beta is the modulus on the form's grid.

    A modulus that depends on the load ratio has the rows of its grid at each of `ratios_of`. The
    rows of the constants of `own_bounds` follow, by their names.
    """
    rows = {}
    for name in ORDER if form.size else ():
        strain = form.grid(COMPONENTS[name], strain_range[COMPONENTS[name]])
        by_ratio = [
            modulus_rows(form, name, strain, strain_range, ratio) for ratio in ratios_of(form, name)
        ]
        rows[name] = np.vstack(by_ratio)
    for name in own_bounds(form):
        rows[name] = np.asarray(form.own_rows(name))  # type: ignore[attr-defined]
    return rows


GROUP: Group = "bubblefit.laws"
#: From the name, the settings and the ends of the strain range (eps1, eps2, gamma12) to a form.
Maker = Callable[[str, Mapping[str, Any], Sequence[float]], LawForm]


@dataclass(frozen=True)
class Offer:
    """A form by name, with what makes it, as this package and plug-ins register it.

    Parameters
    ----------
    name : str
        Name of the form in a project and in a card.
    make : callable
        Function of the name, the settings and the ends of the strain range, which returns a
        `LawForm`.
    settings : tuple of str
        Keys that the form has beside its name, in `[law]` of a project and in a card.
    of_strain : bool
        Whether its moduli depend on the strain.
    of_load_ratio : bool
        Whether stiffness depends on the ratio of the loads.
    of_card : bool
        Whether only cards use the name, for forms that a project cannot choose by a name.
    """

    name: str
    make: Maker
    settings: tuple[str, ...] = ()
    of_strain: bool = True
    of_load_ratio: bool = False
    of_card: bool = False


_OFFERS: dict[str, Offer] = {}


def register_form(offer: Offer) -> None:
    """Add a form to those that a project file can name."""
    _OFFERS[offer.name] = offer


def form_names() -> tuple[str, ...]:
    """Return the names of all forms that a project may choose; those of plug-ins come last."""
    _import_forms()
    # By module, whichever was imported first.
    ours = sorted(_OFFERS.values(), key=lambda offer: offer.make.__module__)
    return names_with_plug_ins(GROUP, [offer.name for offer in ours if not offer.of_card])


def form_settings(name: str) -> tuple[str, ...]:
    """Return the names of the settings of a form; none if the form is not offered."""
    offer, _ = _offer(name)
    return offer.settings if offer else ()


def of_strain(name: str) -> bool:
    """Return whether the moduli of a form depend on the strain."""
    offer, _ = _offer(name)
    return getattr(offer, "of_strain", True)


def of_load_ratio(name: str) -> bool:
    """Return whether the moduli of a form depend on the load ratio."""
    offer, _ = _offer(name)
    return getattr(offer, "of_load_ratio", False)


def form_named(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> LawForm:
    """Make a form by its name.

    Parameters
    ----------
    name : str
    settings : mapping
        Values of the keys beside the name in a project's `[law]` or a card, by key.
    strain_range : (3,) sequence of float
        Ends of (eps1, eps2, gamma12); UNLIMITED where there is none.

    Returns
    -------
    LawForm

    Raises
    ------
    InputError
        For an unknown name or setting.
    PlugInFailure
        For a plug-in that makes no form.
    """
    offer, plug_in = checked_offer(name)
    for key in settings:
        if key not in offer.settings:
            raise InputError(None, key, f"a {name} law has no {key}")
    if plug_in is None:
        return offer.make(name, settings, strain_range)
    with plug_in.calling("fails when it is made"):
        form = offer.make(name, settings, strain_range)
    if not isinstance(form, LawForm):
        names = [name for name in dir(LawForm) if not name.startswith("_")]
        missing = ", ".join(name for name in names if not hasattr(form, name))
        raise plug_in.failure(f"gives no form: {type(form).__name__} has no {missing}")
    return form


def checked_offer(name: str) -> tuple[Offer, PlugIn | None]:
    """Return the offer of a form, and the plug-in that makes it; InputError: no such form."""
    offer, plug_in = _offer(name)
    if offer is None:
        names = form_names()
        words = f"no form is called {name!r}{did_you_mean(name, names) or ';'} known: "
        raise InputError(None, "form", words + ", ".join(names))
    return offer, plug_in


def _offer(name: str) -> tuple[Offer | None, PlugIn | None]:
    """Return the offer of a form and its plug-in; a form of this package takes precedence."""
    _import_forms()
    if name in _OFFERS:
        return _OFFERS[name], None
    plug_in = plug_in_named(GROUP, name)
    if plug_in is None:
        return None, None
    offer: Offer = plug_in.load("form", ("name", "make", "settings"))
    return offer, plug_in


@cache
def _import_forms() -> None:
    """Import all modules of this package, so that their forms are registered."""
    for module in iter_modules([str(Path(__file__).parent)]):
        import_module(f".{module.name}", __package__)
