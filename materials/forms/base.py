"""What every form of the moduli answers, and what is the same for all of them.

A form says how the numbers beta of a law make the three tangent moduli. Whatever the form, a
modulus is a PIECEWISE CUBIC of its own logarithmic strain, and its coefficients are linear in
beta: the compiled law, the material libraries, the exports and the fit know no more than that.
A form may also have `by_load_ratio`: its E1 and E2 are those cubics at equal loads along warp and
fill, and gain more or less, linear in beta, by the normalised load ratio of their own yarn
(`ratio_map`).

A strain component is 0 (eps1, of which E1 depends), 1 (eps2, E2) or 2 (gamma12, G12, which
depends on its size). A piece holds for strains up to its upper end, which belongs to it. Beyond
the strain range, and below zero strain, a modulus is held.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: The strain component that each modulus depends on.
COMPONENTS: Mapping[str, int] = {"E1": 0, "E2": 1, "G12": 2}
#: The moduli in the order in which beta lists them.
ORDER = ("G12", "E2", "E1")
#: The modulus whose loss of stability looks different from that of the other two.
SHEAR = "G12"
#: Names of the strain components in files: of eps1, eps2, gamma12.
STRAIN_NAMES = ("warp", "fill", "shear")
#: The normalised load ratio n / sqrt(n_warp^2 + n_fill^2) of either yarn where both carry the
#: same, and its ends, where one of them carries all.
EVEN, RATIO_ENDS = math.sqrt(0.5), (0.0, 1.0)
#: A strain that is never reached.
UNLIMITED = 1e9
#: Strains at which a modulus of one piece is asked whether it is positive. Between two of them a
#: cubic that is positive there can dip by no more than 0.7 % of its largest value (Markov's bound
#: on its curvature).
GRID = 31


@runtime_checkable
class Form(Protocol):
    """How beta makes the moduli. Forms are frozen, hashable, and equal when they say the same."""

    @property
    def name(self) -> str:
        """What a card and a project say: "cubic"."""
        ...

    @property
    def size(self) -> int:
        """Length of beta."""
        ...

    @property
    def labels(self) -> tuple[str, ...]:
        """(size,) what each entry of beta is called in histories and tables."""
        ...

    @property
    def free(self) -> tuple[int, ...]:
        """The entries of beta that a fit may change; the others are zero."""
        ...

    @property
    def modulus_of(self) -> tuple[str, ...]:
        """The modulus ("G12", "E2" or "E1") that each free entry belongs to."""
        ...

    def piece_map(self) -> Array:
        """(3, P, 4, size): d (coefficients of every piece, highest power first) / d beta.

        The coefficients are those of powers of the strain itself. A component with fewer pieces
        repeats its last one.
        """
        ...

    def uppers(self) -> Array:
        """(3, P) upper ends of the pieces, increasing; the last is UNLIMITED, repeated or not."""
        ...

    def grid(self, component: int, end: float) -> Array:
        """Increasing strains from 0 to `end` at which positivity and bounds are asked."""
        ...

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """(free, free): free entries of beta = this @ moduli at as many control strains.

        A fit works in these values: they have the size of a modulus and depend little on each
        other, as the entries of beta may not.
        """
        ...

    def to_card(self) -> dict[str, Any]:
        """What a card says beside beta, as `form_named` reads it: knots, breaks."""
        ...

    def describe(self) -> str:
        """One sentence for a card's header and a report: what the entries of beta are."""
        ...

    def __hash__(self) -> int: ...


def ratio_map(form: Form) -> Array:
    """(2, size): d (what E1 and E2 gain by their normalised load ratio, from 0 to 1) / d beta.

    Zero of a form that has no `by_load_ratio`, which is this.
    """
    own = getattr(form, "by_load_ratio", None)
    return np.zeros((2, form.size)) if own is None else np.asarray(own(), dtype=float)


def ratios_of(form: Form, name: str) -> tuple[float, ...]:
    """Normalised load ratios at which "E1", "E2" or "G12" is asked whether it is positive.

    Equal loads first; the ends where the modulus depends on them: it is linear in between.
    """
    component = COMPONENTS[name]
    depends = name != SHEAR and ratio_map(form)[component].any()
    return (EVEN, *RATIO_ENDS) if depends else (EVEN,)


@lru_cache(maxsize=64)
def _in_range(form: Form, ends: tuple[float, ...]) -> tuple[Array, Array]:
    """Upper ends (3, P) and map (3, P, 4, size) without what begins at or beyond the range."""
    uppers, rows = form.uppers(), form.piece_map()
    lowers = np.column_stack([np.zeros(3), uppers[:, :-1]])
    # Of a repeated last piece the first is enough.
    used = (lowers < np.array(ends)[:, None]) & (lowers < UNLIMITED)
    count = used.sum(axis=1)
    place = np.minimum(np.arange(count.max()), count[:, None] - 1)
    uppers = np.minimum(np.take_along_axis(uppers, place, axis=1), np.array(ends)[:, None])
    rows = np.ascontiguousarray(rows[np.arange(3)[:, None], place])
    uppers.flags.writeable = rows.flags.writeable = False
    return uppers, rows


def map_in_range(form: Form, strain_range: Sequence[float]) -> Array:
    """(3, P, 4, size): `piece_map` without the pieces that the strain range cuts away."""
    return _in_range(form, tuple(float(end) for end in strain_range))[1]


def pieces_of(form: Form, beta: ArrayLike, strain_range: Sequence[float]) -> Array:
    """(3, P, 5) MPa, read-only: the moduli as the compiled law reads them.

    Piece k of a component holds for strains up to `[component, k, 0]` with the coefficients
    `[component, k, 1:]`, highest power of the strain first. The last upper end is that of the
    strain range; a component with fewer pieces than another repeats its last one.
    """
    uppers, rows = _in_range(form, tuple(float(end) for end in strain_range))
    pieces = np.empty((*uppers.shape, 5))
    pieces[..., 0] = uppers
    pieces[..., 1:] = rows @ np.asarray(beta, dtype=float)
    pieces.flags.writeable = False
    return pieces


def held_strain(component: int, strain: ArrayLike, end: float) -> Array:
    """The strain at which a modulus is taken: in [0, end], its size for shear."""
    x = np.asarray(strain, dtype=float)
    return np.clip(np.abs(x) if component == 2 else x, 0.0, end)


def modulus_rows(
    form: Form,
    name: str,
    strain: ArrayLike,
    strain_range: Sequence[float],
    ratio: float = EVEN,
) -> Array:
    """(n, size): d modulus / d beta at strains (n,) of "E1", "E2" or "G12", held ones included.

    ratio : the normalised load ratio of the modulus' own yarn.
    """
    component = COMPONENTS[name]
    uppers, rows = _in_range(form, tuple(float(end) for end in strain_range))
    held = held_strain(component, strain, uppers[component, -1])
    place = np.searchsorted(uppers[component, :-1], held)
    powers = np.vander(held, 4)
    own = np.asarray(np.einsum("ni,nij->nj", powers, rows[component, place]))
    return own if name == SHEAR else own + (ratio - EVEN) * ratio_map(form)[component]


def moduli_on_grid(form: Form, strain_range: Sequence[float]) -> dict[str, Array]:
    """Rows (n, size) for G12, E2, E1 on the form's own grids; rows @ beta are moduli.

    At equal loads first, from zero strain on; then at the other load ratios of `ratios_of`.
    """
    found = {}
    for name in ORDER:
        strain = form.grid(COMPONENTS[name], strain_range[COMPONENTS[name]])
        several = ratios_of(form, name)
        found[name] = np.vstack(
            [modulus_rows(form, name, strain, strain_range, ratio) for ratio in several]
        )
    return found
