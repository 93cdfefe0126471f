"""Moduli in pieces: splines by their values at knots; tri-linear (Ambroziak and Klosowski)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import comb
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from .base import COMPONENTS, GRID, ORDER, STRAIN_NAMES, UNLIMITED, Array, Offer, register_form

#: Parts of a piece between which positivity and bounds are asked: a cubic that is positive at
#: their ends can dip between them by no more than 4 % of its largest value in the piece.
PARTS = 12
MOST_KNOTS = 50


@dataclass(frozen=True)
class Spline:
    """Moduli (MPa) at knots: beta lists G12 at its knots, then E2, then E1.

    A line between two knots, a parabola through three, a cubic spline from four on, which contains
    every cubic; held beyond the last. knots : increasing strains from 0, of eps1, eps2, gamma12.
    """

    knots: tuple[tuple[float, ...], ...]

    name = "spline"

    @classmethod
    def at(cls, knots: Sequence[Sequence[float]]) -> Self:
        """Return the form with these knots; raise InputError unless they increase from 0."""
        if len(knots) != 3:
            raise InputError(None, "knots", f"expected those of 3 strains, got {len(knots)}")
        for key, row in zip(STRAIN_NAMES, knots, strict=True):
            if not _increasing(row):
                problem = f"expected at least two strains that increase from 0, got {row}"
                raise InputError(None, f"knots.{key}", problem)
        return cls(tuple(tuple(float(x) for x in row) for row in knots))

    @property
    def size(self) -> int:
        return sum(len(row) for row in self.knots)

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(range(self.size))

    @property
    def modulus_of(self) -> tuple[str, ...]:
        return tuple(name for name in ORDER for _ in self.knots[COMPONENTS[name]])

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(
            f"{name} at {knot:.{_digits(self.knots[COMPONENTS[name]])}f}"
            for name in ORDER
            for knot in self.knots[COMPONENTS[name]]
        )

    def piece_map(self) -> Array:
        return self._map.copy()

    @cached_property
    def _map(self) -> Array:
        most = max(len(row) for row in self.knots)
        whole, start = np.zeros((3, most, 4, self.size)), 0
        for name in ORDER:
            component = COMPONENTS[name]
            own = self.knots[component]
            stop = start + len(own)
            whole[component, : len(own) - 1, :, start:stop] = _coefficients(own)
            whole[component, len(own) - 1 :, 3, stop - 1] = 1.0
            start = stop
        return whole

    def uppers(self) -> Array:
        most = max(len(row) for row in self.knots)
        return np.array([[*row[1:], *[UNLIMITED] * (most + 1 - len(row))] for row in self.knots])

    def grid(self, component: int, end: float) -> Array:
        ends = [knot for knot in self.knots[component] if knot < end] + [end]
        at = np.linspace(0.0, len(ends) - 1, PARTS * (len(ends) - 1) + 1)
        return np.interp(at, np.arange(len(ends)), ends)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        return np.eye(self.size)

    def to_card(self) -> dict[str, Any]:
        return {"knots": dict(zip(STRAIN_NAMES, map(list, self.knots), strict=True))}

    def describe(self) -> str:
        shear, fill, warp = (len(self.knots[COMPONENTS[name]]) for name in ORDER)
        return (
            f"Cubic splines through their values at the knots: beta lists G12 at {shear} knots of "
            f"|gamma12|, then E2 at {fill} of eps2, then E1 at {warp} of eps1."
        )


def _coefficients(knots: Sequence[float]) -> Array:
    """Return (n - 1, 4, n): powers of strain, highest first, by the values at n knots."""
    from scipy.interpolate import CubicSpline  # half a second, and only splines need it

    spline = CubicSpline(knots, np.eye(len(knots)), bc_type="not-a-knot")
    whole = np.zeros((len(knots) - 1, 4, len(knots)))
    for k, start in enumerate(knots[:-1]):
        for power in range(4):  # c (x - start)^power
            for lower in range(power + 1):
                share = comb(power, lower) * (-start) ** (power - lower)
                whole[k, 3 - lower] += share * spline.c[3 - power, k]
    return whole


def _digits(knots: Sequence[float]) -> int:
    return next(
        n for n in range(3, 18) if n == 17 or len({f"{k:.{n}f}" for k in knots}) == len(knots)
    )


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool)


def _increasing(row: Any) -> bool:
    if not isinstance(row, (list, tuple)) or len(row) < 2 or not all(map(_is_number, row)):
        return False
    rising = all(a < b for a, b in pairwise(row))
    return bool(row[0] == 0 and rising and row[-1] < UNLIMITED)


def spline_named(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> Spline:
    """Return the form of `knots`: a number, strains, or either by direction."""
    given = settings.get("knots")
    if given is None:
        raise InputError(None, "knots", "a spline needs knots = 6, or {warp = [0, ...], ...}")
    if isinstance(given, Mapping):
        for key in given:
            if key not in STRAIN_NAMES:
                problem = f"unknown direction; allowed: {', '.join(STRAIN_NAMES)}"
                raise InputError(None, f"knots.{key}", problem)
    rows = []
    for key, end in zip(STRAIN_NAMES, strain_range, strict=True):
        own, field = (
            (given.get(key), f"knots.{key}") if isinstance(given, Mapping) else (given, "knots")
        )
        rows.append(_row(own, field, float(end)))
    return Spline.at(rows)


def _row(own: Any, field: str, end: float) -> list[float]:
    if own is None:
        raise InputError(None, field, "this key is missing")
    if isinstance(own, int) and not isinstance(own, bool):
        if not 2 <= own <= MOST_KNOTS:
            raise InputError(None, field, f"expected 2 to {MOST_KNOTS} knots, got {own}")
        if end >= UNLIMITED:
            raise InputError(
                None, field, "a number of knots needs a strain range to space them over"
            )
        # Rounded for whoever reads the card; the last is the end itself.
        return [*(float(f"{x:.10g}") for x in np.linspace(0.0, end, own)[:-1]), end]
    if not _increasing(own):
        problem = f"expected a number, or at least two strains that increase from 0, got {own}"
        raise InputError(None, field, problem)
    if len(own) > MOST_KNOTS or own[-1] > end * (1 + 1e-12):
        problem = f"expected at most {MOST_KNOTS} knots, the last at the end {end:g} of the range"
        raise InputError(None, field, f"{problem} or before it, got {own}")
    return [float(x) for x in own]


register_form(Offer("spline", spline_named, ("knots",)))


Pair = tuple[float, float]


@dataclass(frozen=True)
class TriLinear:
    """Three moduli up to the first break, between the breaks, and beyond the second.

    G12 is beta_3 to beta_1, E2 beta_7 to beta_5, E1 beta_11 to beta_9; a break belongs to the
    region below it. pairs : the two breaks of eps1, of eps2 and of gamma12.
    """

    pairs: tuple[Pair, Pair, Pair]

    name = "trilinear"
    size = 12
    labels = tuple(f"beta_{i}" for i in range(12))
    free = (1, 2, 3, 5, 6, 7, 9, 10, 11)
    modulus_of = tuple(name for name in ORDER for _ in range(3))

    @classmethod
    def at(cls, breaks: ArrayLike) -> Self:
        """Return the form with breaks (3, 2); raise InputError unless positive and increasing."""
        try:
            pairs = np.array(breaks, dtype=float)
        except (TypeError, ValueError):
            pairs = np.empty(0)
        good = pairs.shape == (3, 2) and np.isfinite(pairs).all()
        if not good or not (pairs[:, 0] > 0).all() or not (np.diff(pairs) > 0).all():
            raise InputError(
                None,
                "breaks",
                "expected two positive, increasing strains for each of (eps1, eps2, gamma12), "
                f"got {' '.join(str(breaks).split())}",
            )
        first, second, third = ((float(a), float(b)) for a, b in pairs)
        return cls((first, second, third))

    @property
    def breaks(self) -> Array:
        breaks = np.array(self.pairs)
        breaks.flags.writeable = False
        return breaks

    def piece_map(self) -> Array:
        whole = np.zeros((3, 3, 4, 12))
        for block, name in enumerate(ORDER):
            for piece in range(3):
                whole[COMPONENTS[name], piece, 3, 4 * block + 3 - piece] = 1.0
        return whole

    def uppers(self) -> Array:
        return np.column_stack([self.breaks, np.full(3, UNLIMITED)])

    def grid(self, component: int, end: float) -> Array:
        """Return as many strains in a narrow region as in a wide one."""
        breaks = self.breaks[component]
        knots = np.concatenate([[0.0], breaks[breaks < end], [end]])
        at = np.linspace(0.0, len(knots) - 1, GRID)
        return np.interp(at, np.arange(len(knots)), knots)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        return np.eye(len(self.free))

    def to_card(self) -> dict[str, Any]:
        return {"breaks": dict(zip(STRAIN_NAMES, self.breaks.tolist(), strict=True))}

    def describe(self) -> str:
        return (
            "Tri-linear moduli, beyond the second break, between the breaks, up to the first: "
            "beta_1..3: G12 of |gamma12|, beta_5..7: E2 of eps2, beta_9..11: E1 of eps1; the "
            "others are 0."
        )


def trilinear_named(
    name: str, settings: Mapping[str, Any], strain_range: Sequence[float]
) -> TriLinear:
    """Return the form of `breaks`, {warp = [first, second], fill = ..., shear = ...}."""
    breaks = settings.get("breaks")
    if not isinstance(breaks, Mapping):
        problem = "a trilinear law needs breaks = {warp = [first, second], fill = ..., shear = ...}"
        raise InputError(None, "breaks", problem)
    for key in breaks:
        if key not in STRAIN_NAMES:
            problem = f"unknown direction; allowed: {', '.join(STRAIN_NAMES)}"
            raise InputError(None, f"breaks.{key}", problem)
    pairs = []
    for key in STRAIN_NAMES:
        if key not in breaks:
            raise InputError(None, f"breaks.{key}", "this key is missing")
        pair = breaks[key]
        if not _rising(pair):
            problem = f"expected [first, second], 0 < first < second, got {pair}"
            raise InputError(None, f"breaks.{key}", problem)
        pairs.append(pair)
    return TriLinear.at(pairs)


def _rising(pair: Any) -> bool:
    numbers = isinstance(pair, (list, tuple)) and len(pair) == 2
    if not numbers or not all(type(x) in (int, float) for x in pair):
        return False
    return bool(0 < pair[0] < pair[1] < UNLIMITED)


register_form(Offer("trilinear", trilinear_named, ("breaks",)))
