"""Forms with moduli in pieces: splines, the tri-linear form, and forms that users define.

The tri-linear form is that of Ambroziak and Klosowski.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from math import comb
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...errors import InputError
from ...light_dataclasses import dataclass
from ..cubic_curves import spline_slopes
from . import base
from .base import (
    COMPONENTS,
    GRID,
    ORDER,
    STRAIN_NAMES,
    UNLIMITED,
    Array,
    Offer,
    modulus_rows,
    register_form,
)

#: Number of parts of a piece at whose ends positivity and bounds are checked: a cubic that is
#: positive there can dip between them by no more than 4 % of its largest value in the piece.
PARTS = 12
MOST_KNOTS = 50


@dataclass(frozen=True)
class Spline(base.LawForm):
    """Moduli as splines; beta lists G12 (MPa) at its knots, then E2, then E1.

    The curve is a line with two knots, a parabola with three, and from four on a cubic spline,
    which contains every cubic; beyond the last knot it is constant.

    Attributes
    ----------
    knots : tuple of tuples of float
        Log strains that increase from 0, for each of eps1, eps2, gamma12.
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
        """Return the cubics (3, P, 4, size) of the moduli as rows of beta, highest power first.

        P is the largest number of knots; beyond the last knot a modulus is constant.
        """
        count = max(len(row) for row in self.knots)
        rows = np.zeros((3, count, 4, self.size))
        start = 0
        for name in ORDER:
            component = COMPONENTS[name]
            knots = self.knots[component]
            stop = start + len(knots)
            rows[component, : len(knots) - 1, :, start:stop] = _coefficients(knots)
            rows[component, len(knots) - 1 :, 3, stop - 1] = 1.0
            start = stop
        return rows

    def uppers(self) -> Array:
        count = max(len(row) for row in self.knots)
        repeated = [[UNLIMITED] * (count + 1 - len(row)) for row in self.knots]
        return np.array([[*row[1:], *ends] for row, ends in zip(self.knots, repeated, strict=True)])

    def grid(self, component: int, end: float) -> Array:
        ends = [*(knot for knot in self.knots[component] if knot < end), end]
        return _spread(ends, PARTS * (len(ends) - 1) + 1)

    def to_card(self) -> dict[str, Any]:
        return {"knots": dict(zip(STRAIN_NAMES, map(list, self.knots), strict=True))}

    def describe(self) -> str:
        shear, fill, warp = (len(self.knots[COMPONENTS[name]]) for name in ORDER)
        return (
            f"Cubic splines through their values at the knots: beta lists G12 at {shear} knots of "
            f"|gamma12|, then E2 at {fill} of eps2, then E1 at {warp} of eps1."
        )


def _spread(ends: Sequence[float], count: int) -> Array:
    """Return `count` strains from the first to the last of `ends`, equally many in each piece.

    They are equally spaced within a piece, however long it is.
    """
    positions = np.linspace(0.0, len(ends) - 1, count)
    return np.interp(positions, np.arange(len(ends)), ends)


def _coefficients(knots: Sequence[float]) -> Array:
    """Return (n - 1, 4, n), the derivatives of each piece's coefficients by the values at n knots.

    Coefficients are those of powers of strain, the highest first.
    """
    n = len(knots)
    steps = np.diff(knots)[:, None]
    slopes = spline_slopes(np.asarray(knots, dtype=float))
    secants = np.diff(np.eye(n), axis=0) / steps
    # Of powers of x - start, from the lowest on.
    by_power = (
        np.eye(n)[:-1],
        slopes[:-1],
        (3.0 * secants - 2.0 * slopes[:-1] - slopes[1:]) / steps,
        (slopes[:-1] + slopes[1:] - 2.0 * secants) / steps**2,
    )
    coefficients = np.zeros((n - 1, 4, n))
    for k, start in enumerate(knots[:-1]):
        for power in range(4):  # c (x - start)^power
            for lower in range(power + 1):
                share = comb(power, lower) * (-start) ** (power - lower)
                coefficients[k, 3 - lower] += share * by_power[power][k]
    return coefficients


def _digits(knots: Sequence[float]) -> int:
    """Return how many digits tell all knots apart, at least three."""
    return next(
        n for n in range(3, 18) if n == 17 or len({f"{k:.{n}f}" for k in knots}) == len(knots)
    )


def _is_number(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool)


def _increasing(row: Any) -> bool:
    """Return whether a value is a list of at least two finite strains that increase from zero."""
    if not isinstance(row, (list, tuple)) or len(row) < 2 or not all(map(_is_number, row)):
        return False
    rising = all(a < b for a, b in pairwise(row))
    return bool(row[0] == 0 and rising and row[-1] < UNLIMITED)


def knots_of(settings: Mapping[str, Any], strain_range: Sequence[float]) -> list[list[float]]:
    """Return the knots (log strains) of eps1, eps2 and gamma12 from the setting `knots`.

    It is a number of knots or a list of strains, for all three or by direction.
    """
    setting = settings.get("knots")
    if setting is None:
        raise InputError(None, "knots", "a spline needs knots = 6, or {warp = [0, ...], ...}")
    if not isinstance(setting, Mapping):
        return [_row(setting, "knots", end) for end in strain_range]
    ends = zip(_by_direction("knots", setting), strain_range, strict=True)
    return [_row(direction, f"knots.{key}", end) for (key, direction), end in ends]


def _by_direction(name: str, by_direction: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield direction and value of each strain; InputError: one is missing, or not known."""
    for key in by_direction:
        if key not in STRAIN_NAMES:
            problem = f"unknown direction; allowed: {', '.join(STRAIN_NAMES)}"
            raise InputError(None, f"{name}.{key}", problem)
    for key in STRAIN_NAMES:
        if key not in by_direction:
            raise InputError(None, f"{name}.{key}", "this key is missing")
        yield key, by_direction[key]


def _row(knots: Any, field: str, end: float) -> list[float]:
    """Return the knots of a modulus as log strains from zero; InputError if they cannot be used.

    Parameters
    ----------
    knots : object
        Number of knots to be spaced evenly, or a list of strains.
    field : str
        Key of the setting, for the message.
    end : float
        End of the strain range.
    """
    if isinstance(knots, int) and not isinstance(knots, bool):
        if not 2 <= knots <= MOST_KNOTS:
            raise InputError(None, field, f"expected 2 to {MOST_KNOTS} knots, got {knots}")
        if end >= UNLIMITED:
            raise InputError(
                None, field, "a number of knots needs a strain range to space them over"
            )
        # Rounded for whoever reads the card; the last is the end itself.
        return [*(float(f"{x:.10g}") for x in np.linspace(0.0, end, knots)[:-1]), end]
    if not _increasing(knots):
        problem = f"expected a number, or at least two strains that increase from 0, got {knots}"
        raise InputError(None, field, problem)
    if len(knots) > MOST_KNOTS or knots[-1] > end * (1 + 1e-12):
        problem = f"expected at most {MOST_KNOTS} knots, the last at the end {end:g} of the range"
        raise InputError(None, field, f"{problem} or before it, got {knots}")
    return list(knots)


register_form(
    Offer("spline", lambda _, settings, ends: Spline.at(knots_of(settings, ends)), ("knots",))
)


Pair = tuple[float, float]


@dataclass(frozen=True)
class TriLinear(base.LawForm):
    """Moduli that are constant up to the first break, between the breaks, and beyond the second.

    From region to region G12 is beta_3, beta_2, beta_1, E2 is beta_7 to beta_5, E1 is beta_11 to
    beta_9. A break belongs to the region below it.

    Attributes
    ----------
    pairs : three tuples of two floats
        Log strains of the two breaks of eps1, of eps2 and of gamma12.
    """

    pairs: tuple[Pair, Pair, Pair]

    name = "trilinear"
    size = 12
    labels = tuple(f"beta_{i}" for i in range(12))
    free = (1, 2, 3, 5, 6, 7, 9, 10, 11)
    modulus_of = tuple(name for name in ORDER for _ in range(3))

    @classmethod
    def at(cls, breaks: Sequence[Sequence[float]]) -> Self:
        """Return the form with breaks (3, 2); raise InputError unless positive and increasing."""
        if len(breaks) != 3:
            raise InputError(None, "breaks", f"expected those of 3 strains, got {len(breaks)}")
        for key, pair in zip(STRAIN_NAMES, breaks, strict=True):
            two = isinstance(pair, (list, tuple, np.ndarray)) and len(pair) == 2
            if not two or not _increasing([0.0, *pair]):
                problem = f"expected [first, second], 0 < first < second, got {pair}"
                raise InputError(None, f"breaks.{key}", problem)
        first, second, third = ((float(a), float(b)) for a, b in breaks)
        return cls((first, second, third))

    @property
    def breaks(self) -> Array:
        """Return the breaks (3, 2) of eps1, eps2 and gamma12, log strains, as a read-only array."""
        breaks = np.array(self.pairs)
        breaks.flags.writeable = False
        return breaks

    def piece_map(self) -> Array:
        rows = np.zeros((3, 3, 4, 12))
        for block, name in enumerate(ORDER):
            for piece in range(3):
                rows[COMPONENTS[name], piece, 3, 4 * block + 3 - piece] = 1.0
        return rows

    def uppers(self) -> Array:
        return np.column_stack([self.breaks, np.full(3, UNLIMITED)])

    def grid(self, component: int, end: float) -> Array:
        """Return as many strains in a narrow region as in a wide one."""
        return _spread([0.0, *(b for b in self.pairs[component] if b < end), end], GRID)

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
    return TriLinear.at([pair for _, pair in _by_direction("breaks", breaks)])


register_form(Offer("trilinear", trilinear_named, ("breaks",)))


#: Nodes of a cubic in its piece, as shares of it.
NODES = np.array([0.0, 0.25, 0.75, 1.0])
#: Positions between them where it is compared.
BETWEEN = np.array([0.1, 0.5, 0.9])
#: Error of the cubics of a function over its largest value.
CLOSE = 1e-5
#: How often a piece is halved.
HALVINGS = 6
#: Strains at which a modulus is evaluated in all its pieces.
GRID_OF_PIECES = 60
#: Share of a function that the others cannot make, below which it depends on them.
DEPENDENT = 1e-7


@dataclass(frozen=True)
class Pieces:
    """Moduli as given piecewise cubics, linear in beta: how fits and cards hold a user's `Form`.

    Attributes
    ----------
    modulus_of : tuple of str
        The modulus of each entry of beta.
    upper, cubics : (3, P) and (3, P, 4, size) arrays
        As `LawForm.uppers` and `LawForm.piece_map` return them.
    """

    title: str
    labels: tuple[str, ...]
    modulus_of: tuple[str, ...]
    upper: tuple[tuple[float, ...], ...]
    cubics: tuple[Any, ...]

    name = "pieces"

    @property
    def size(self) -> int:
        return len(self.labels)

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(range(self.size))

    def piece_map(self) -> Array:
        return np.array(self.cubics)

    def uppers(self) -> Array:
        return np.array(self.upper)

    def grid(self, component: int, end: float) -> Array:
        ends = [0.0, *sorted({upper for upper in self.upper[component] if upper < end}), end]
        pieces = len(ends) - 1
        return _spread(ends, pieces * max(2, min(PARTS, GRID_OF_PIECES // pieces)) + 1)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from values where the functions differ most; InputError: they do not."""
        matrix = np.zeros((self.size, self.size))
        for name in ORDER:
            of_modulus = np.flatnonzero(np.array(self.modulus_of) == name)
            strain = self.grid(COMPONENTS[name], strain_range[COMPONENTS[name]])
            rows = modulus_rows(self, name, strain, strain_range)[:, of_modulus]
            scaled = rows / np.maximum(np.abs(rows).max(axis=0), 1e-300)
            _, sizes, places = scipy.linalg.qr(scaled.T, mode="economic", pivoting=True)
            if not np.abs(np.diag(sizes)).min() > DEPENDENT:
                problem = f"the functions of {name} are not independent up to a strain of "
                raise InputError(None, "form", f"{problem}{strain[-1]:g}; leave one out")
            matrix[np.ix_(of_modulus, of_modulus)] = np.linalg.inv(
                rows[np.sort(places[: len(of_modulus)])]
            )
        return matrix

    def to_card(self) -> dict[str, Any]:
        names = {"labels": self.labels, "modulus_of": self.modulus_of}
        arrays = {"uppers": self.uppers().tolist(), "map": self.piece_map().tolist()}
        return {"pieces": {"title": self.title, **{k: list(v) for k, v in names.items()}, **arrays}}

    def describe(self) -> str:
        labels = ", ".join(self.labels)
        return f"{self.title}, by the cubics of [pieces], highest power first; beta lists {labels}."


def pieces_named(name: str, settings: Mapping[str, Any], strain_range: Sequence[float]) -> Pieces:
    """Return the form of the table `pieces` of a card."""
    try:
        table = settings["pieces"]
        labels, owners = (tuple(map(str, table[key])) for key in ("labels", "modulus_of"))
        upper, cubics = (np.array(table[key], dtype=float) for key in ("uppers", "map"))
        good = (
            set(owners) == set(ORDER)
            and len(labels) == len(owners)
            and bool(
                cubics.shape == (3, upper.shape[1], 4, len(labels))
                and np.isfinite(cubics).all()
                and (np.diff(upper, prepend=0.0) >= 0).all()
                and (upper[:, -1] == UNLIMITED).all()
            )
        )
    except (TypeError, ValueError, KeyError, IndexError, OverflowError):
        good = False
    if not good:
        problem = "expected labels and modulus_of (n), uppers (3, P), that increase, and map "
        raise InputError(None, "pieces", f"{problem}(3, P, 4, n): copy them from the card of a fit")
    return Pieces(str(table.get("title", "")), labels, owners, _fixed(upper), _fixed(cubics))


def _fixed(values: Any) -> Any:
    """Return nested arrays of numbers as nested tuples."""
    return values.item() if np.ndim(values) == 0 else tuple(map(_fixed, values))


register_form(Offer("pieces", pieces_named, ("pieces",), of_card=True))


class Form:
    """Base class of a user's own form (`bf.Form`): moduli that are sums of functions of strain.

    A subclass defines `functions`. A fit uses piecewise cubics in place of the functions, so that
    worker processes, cards and other programs do not need the class.

    Attributes
    ----------
    labels : mapping of sequences of str
        Labels of the unknowns of each modulus ("E1", "E2", "G12").
    breaks : sequence of float
        Log strains at which a function has a kink or a jump; a break belongs to what is below it.
    of_strain : bool
        False if the moduli are constants.
    """

    labels: Mapping[str, Sequence[str]] = {}
    breaks: Sequence[float] = ()
    of_strain = True

    def functions(self, modulus: str, strain: Array) -> Sequence[ArrayLike]:
        """Return the values of the functions of a modulus at log strains of its own component.

        Each function gives an array (n,) or a number, and the modulus is the sum of each times an
        unknown in MPa.

        Parameters
        ----------
        modulus : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains, which are not negative; of G12 the size of the shear.
        """
        raise NotImplementedError(f"{type(self).__name__} needs functions(modulus, strain)")

    def pieces(self, strain_range: Sequence[float]) -> Pieces:
        """Return the form up to these strains (eps1, eps2, gamma12); InputError: no such form."""
        labels = list[str]()
        owners = list[str]()
        pieces = {}
        for name in ORDER:
            end = strain_range[COMPONENTS[name]]
            tolerance = CLOSE * np.abs(self._values(name, np.linspace(0.0, end, GRID))).max(axis=1)
            ends = [0.0, *sorted(b for b in self.breaks if 0 < b < end), end]
            parts = [p for a, b in pairwise(ends) for p in self._cubics(name, a, b, tolerance)]
            # Beyond the range the modulus is constant.
            last_values = np.vander([end], 4) @ parts[-1][1]
            parts.append((UNLIMITED, np.eye(4)[:, 3:] @ last_values))
            count = len(tolerance)
            own_labels = self.labels.get(name) or [f"{name} {k + 1}" for k in range(count)]
            if len(own_labels) != count:
                problem = f"expected {count} of {name}, one of each function, got {len(own_labels)}"
                raise InputError(None, "form.labels", problem)
            pieces[COMPONENTS[name]] = len(labels), parts
            labels = [*labels, *own_labels]
            owners = [*owners, *[name] * len(own_labels)]
        count = max(len(parts) for _, parts in pieces.values())
        upper = np.full((3, count), UNLIMITED)
        cubics = np.zeros((3, count, 4, len(labels)))
        for component, (start, parts) in pieces.items():
            for k in range(count):
                upper[component, k], piece = parts[min(k, len(parts) - 1)]
                cubics[component, k, :, start : start + piece.shape[1]] = piece
        title = type(self).__name__
        form = Pieces(title, tuple(labels), tuple(owners), _fixed(upper), _fixed(cubics))
        form.from_values(strain_range)  # says what is wrong with them
        return form

    def _values(self, name: str, strain: Array) -> Array:
        """Return the values (unknowns, n) of the functions of a modulus.

        Errors of the user's code other than of type and value pass through.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains.

        Raises
        ------
        InputError
            The functions cannot be evaluated or do not give finite values.
        """
        reason = ""
        try:
            rows = [
                np.broadcast_to(function_values, strain.shape)
                for function_values in self.functions(name, strain)
            ]
            values = np.array(rows, dtype=float)
        except (TypeError, ValueError) as error:
            values = np.empty((0, 0))  # no unknowns: refused below
            reason = f" ({error})"
        if not len(values) or not np.isfinite(values).all():
            problem = f"{type(self).__name__}.functions({name!r}, strain): expected finite values, "
            raise InputError(None, "form", f"{problem}(n,) for n strains, of each unknown{reason}")
        return values

    def _cubics(
        self,
        name: str,
        lower: float,
        upper: float,
        tolerance: Array,
        halvings: int = HALVINGS,
    ) -> list[tuple[float, Array]]:
        """Return upper end and cubics (4, unknowns) of as many pieces as the functions need.

        Parameters
        ----------
        tolerance : (unknowns,) array
            Largest deviation of a cubic from its function, MPa per MPa. Beyond it the piece is
            halved, at most `halvings` times.
        """
        nodes = lower + (upper - lower) * NODES
        # A break belongs to the piece below it, so this piece begins just above.
        nodes[0] = np.nextafter(lower, upper) if lower > 0 else 0.0
        scaled = np.linalg.solve(np.vander(nodes / upper, 4), self._values(name, nodes).T)
        cubics = scaled / upper ** np.arange(3.0, -1.0, -1.0)[:, None]
        between = lower + (upper - lower) * BETWEEN
        error = np.abs(np.vander(between, 4) @ cubics - self._values(name, between).T).max(axis=0)
        if halvings and (error > tolerance).any():
            ends = pairwise([lower, 0.5 * (lower + upper), upper])
            return [p for a, b in ends for p in self._cubics(name, a, b, tolerance, halvings - 1)]
        return [(upper, cubics)]
