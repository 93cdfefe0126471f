"""The unknowns of a fit: moduli at the control strains of the law's form, and nuisance.

The coefficients of a law may be badly scaled (monomials: condition 1e8 against 6e3 in modulus
values). Bounds on coefficients and on moduli are linear in either."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials.closed_path import closed_path
from ..materials.forms.base import SHEAR, Array, Form, moduli_on_grid, modulus_rows, own_bounds
from ..materials.law import HypoelasticLaw, definite_rows
from .comparison import Comparison, NuisanceUnknowns


@dataclass(frozen=True, eq=False)
class LawBounds:
    """Bounds of a law's numbers.
    smallest, largest : MPa, by modulus, anywhere on the strain range; largest is None where the
    coefficients are bounded. lower, upper : (free,) MPa, of the free coefficients; None where the
    moduli are bounded. work : of the law's closed path at most, a share (`ClosedPath.share`)."""

    smallest: Mapping[str, float]
    largest: Mapping[str, float] | None = None
    lower: Array | None = None
    upper: Array | None = None
    work: float = np.inf

    @classmethod
    def of_moduli(cls, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return bounds (least, largest) of every modulus, MPa; starts draw modulus values."""
        return cls(
            {name: float(low) for name, (low, _) in ranges.items()},
            {name: float(high) for name, (_, high) in ranges.items()},
        )

    def with_constants(self, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return the bounds with those of a form's own constants, MPa."""
        smallest = {name: low for name, (low, _) in ranges.items()}
        smallest.update(self.smallest)
        largest = None
        if self.largest is not None:
            largest = {name: high for name, (_, high) in ranges.items()}
            largest.update(self.largest)
        return replace(self, smallest=smallest, largest=largest)

    def control(self, form: Form) -> tuple[Array, Array]:
        """Return least and largest (free,) modulus at the form's control strains, MPa."""
        assert self.largest is not None
        smallest = np.array([self.smallest[name] for name in form.modulus_of])
        return smallest, np.array([self.largest[name] for name in form.modulus_of])


SMALLEST = 1e-3  # MPa; a bound that is zero or negative says nothing of the size of a modulus
#: Corners (a, b) of the closed paths whose work is bounded, in ends of the range: that of a card
#: is as far as its test reached. Increments of a side.
CORNERS, SIDE = [(i / 8, j / 8) for i in range(2, 9) for j in range(2, 9)], 16
WITHIN = 0.04  # of that bound, by which steps keep off it: corners between these reach higher
ROUNDING = 1e-6  # of a scaled inequality: what violates it by less keeps it
SLOPE = 1e-5  # difference of an unknown by which that work is differentiated


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns y (count,) of a fit, their bounds, and their relation to the law.
    Moduli at control strains, each in units of its modulus' own size, then the nuisance: shared,
    then comparison by comparison. strain_range : ends over which bounds hold. definite_nu12 :
    Poisson's ratio of a law that has to be positive definite, None where it need not. nu12 : of the
    law, where it is no unknown."""

    form: Form
    strain_range: tuple[float, ...]
    bounds: LawBounds
    nuisance: NuisanceUnknowns = field(default_factory=NuisanceUnknowns)
    definite_nu12: float | None = None
    nu12: float = 0.0

    @classmethod
    def of(
        cls,
        form: Form,
        nu12: float,
        strain_range: ArrayLike,
        bounds: LawBounds,
        comparisons: Iterable[Comparison] = (),
    ) -> Unknowns:
        """Return the unknowns of a law and its comparisons.
        Raises InputError for a modulus without bounds."""
        bounds = bounds.with_constants(own_bounds(form))
        missing = [name for name in dict.fromkeys(form.modulus_of) if name not in bounds.smallest]
        if missing:
            raise InputError(None, f"bounds.{missing[0]}", "this key is missing; add it")
        several = tuple(comparisons)
        nuisance = NuisanceUnknowns({c.name: c.nuisance for c in several})
        # Where it is unknown, whatever it may be: the largest is the strictest.
        most = max([nu12, *(n.upper for n in nuisance.shared if n.law_parameter == "nu12")])
        return cls(
            form,
            tuple(np.asarray(strain_range, dtype=float).tolist()),
            bounds,
            nuisance,
            most if any(c.contracts for c in several) else None,
            nu12,
        )

    @property
    def free(self) -> tuple[int, ...]:
        """Return the place of each free coefficient in the law's beta."""
        return self.form.free

    @property
    def size(self) -> int:
        """Return the number of the law's unknowns."""
        return len(self.form.free)

    @property
    def count(self) -> int:
        """Return the number of all unknowns."""
        return self.size + len(self.nuisance.all)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.form.labels[i] for i in self.free)

    def nuisance_values(self, comparison: str, y: Array) -> dict[str, float]:
        """Return the nuisance of a comparison by plain name at unknowns y, in its units."""
        return self.nuisance.values(comparison, y[self.size :])

    def nuisance_places(self, comparison: str) -> NDArray[np.intp]:
        """Return the positions of a comparison's nuisance among the unknowns."""
        return self.size + self.nuisance.positions(comparison)

    @cached_property
    def shear(self) -> NDArray[np.bool_]:
        """Return (count,) which unknowns make the modulus that a loss of stability depends on."""
        extra = self.count - self.size
        return np.array([*(name == SHEAR for name in self.form.modulus_of), *[False] * extra])

    @cached_property
    def from_values(self) -> Array:
        """Return (size, size): free coefficients = this @ moduli (MPa) at control strains."""
        return self.form.from_values(self.strain_range)

    @cached_property
    def to_coefficients(self) -> Array:
        """Return (size, size) so that free coefficients (MPa) = this @ unknowns."""
        return self.from_values * self._sizes

    @cached_property
    def _sizes(self) -> Array:
        """Return (size,) MPa, the geometric mean of the bounds of each unknown's modulus."""
        if self.bounds.largest is not None:
            least, largest = self.bounds.control(self.form)
            return np.sqrt(least * largest)
        lower, upper = self.box
        sizes = {}
        for name, rows in self.moduli.items():
            # At zero strain, where the box says what a modulus can be.
            at_lower = rows[0] * lower
            at_upper = rows[0] * upper
            ends = np.minimum(at_lower, at_upper).sum(), np.maximum(at_lower, at_upper).sum()
            sizes[name] = np.sqrt(max(ends[0], SMALLEST) * max(ends[1], SMALLEST))
        return np.array([sizes[name] for name in self.form.modulus_of])

    def beta(self, y: Array) -> Array:
        """Return the law's beta (MPa) at unknowns y (count,)."""
        full = np.zeros(self.form.size)
        full[list(self.free)] = self.to_coefficients @ y[: self.size]
        return full

    def law(self, law: HypoelasticLaw, y: Array) -> HypoelasticLaw:
        """Return a law with the numbers of unknowns y (count,), nu12 where it is one of them."""
        return law.with_numbers(self.beta(y), self.nuisance.of_law(y[self.size :]))

    def at(self, coefficients: Array) -> Array:
        """Return unknowns (count,) of free coefficients (size,) MPa, nuisance at its beginning."""
        values = np.linalg.solve(self.to_coefficients, coefficients)
        return np.concatenate([values, self.nuisance.begin])

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Return lower and upper (size,) of the free coefficients, MPa.
        Of bounded moduli: the smallest box of all laws that keep them at the control strains."""
        if self.bounds.lower is not None and self.bounds.upper is not None:
            return self.bounds.lower, self.bounds.upper
        low, high = (self.from_values * ends for ends in self.bounds.control(self.form))
        return np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)

    def rows(self, name: str, strain: Array) -> Array:
        """Return (n, size): a modulus (MPa) at strains (n,) is this @ free coefficients."""
        return modulus_rows(self.form, name, strain, self.strain_range)[:, list(self.free)]

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """Return rows (n, size) by modulus: moduli on a grid are rows @ free coefficients."""
        columns = list(self.free)
        grids = moduli_on_grid(self.form, self.strain_range)
        return {name: rows[:, columns] for name, rows in grids.items()}

    @cached_property
    def positivity(self) -> tuple[Array, Array]:
        """Return A, margin of `A @ coefficients >= margin` for moduli on their grids, MPa."""
        margin = [
            np.full(len(rows), self.bounds.smallest[name]) for name, rows in self.moduli.items()
        ]
        return np.vstack(list(self.moduli.values())), np.concatenate(margin)

    @cached_property
    def ceiling(self) -> Array | None:
        """Return the largest modulus allowed in each row of `positivity`, MPa."""
        most = self.bounds.largest
        if most is None:
            return None
        return np.concatenate([np.full(len(r), most[name]) for name, r in self.moduli.items()])

    @cached_property
    def inequalities(self) -> tuple[Array, Array]:
        """Return A, c of `A @ y >= c`, rows scaled; the first rows are those of `positivity`."""
        t, (grid, margin), (lower, upper) = self.to_coefficients, self.positivity, self.box
        # A coefficient between equal bounds is scaled by itself.
        width = upper - lower
        width = np.where(width > 0, width, np.maximum(np.abs(upper), 1.0))
        moduli = grid @ t
        unit = 1.0 / np.abs(moduli).max(axis=1)
        a = [moduli * unit[:, None], t / width[:, None], -t / width[:, None]]
        c = [margin * unit, lower / width, -upper / width]
        if self.ceiling is not None:
            a.append(-moduli * unit[:, None])
            c.append(-self.ceiling * unit)
        if self.definite_nu12 is not None:
            rows = definite_rows(self.form, self.definite_nu12, self.strain_range)
            definite = rows[:, list(self.free)] @ t
            a.append(definite / np.abs(definite).max(axis=1, keepdims=True))
            c.append(np.zeros(len(definite)))
        law = np.vstack(a)
        extra = self.count - self.size
        # A law reloads along a tangent that is at most that of its unloading.
        own = [n.law_parameter for n in self.nuisance.shared]
        pairs = [
            (own.index(n.replace("re", "un", 1)), k)
            for k, n in enumerate(own)
            if n is not None and n.startswith("reloading_")
        ]
        box = np.vstack([np.eye(extra), -np.eye(extra), np.zeros((len(pairs), extra))])
        for row, (up, back) in enumerate(pairs, start=2 * extra):
            box[row, [up, back]] = 1.0, -1.0
        low, high = self.nuisance.bounds
        return scipy.linalg.block_diag(law, box), np.concatenate(
            [*c, low, -high, np.zeros(len(pairs))]
        )

    def keeps_bounds(self, y: Array) -> bool:
        """Return whether unknowns (count,) keep all bounds, those of the work included.

        Moduli above their margin, coefficients and moduli within their bounds, and the form's own
        inequalities: whatever moves the unknowns of a fit afterwards has to be looked at with it.
        """
        rows, limits = self.inequalities
        return bool((rows @ y >= limits - ROUNDING).all()) and self.within_work(y)

    def work(self, y: Array) -> Array:
        """Return the work of closed paths of the law to `CORNERS`, shares of that of loading."""
        warp, fill, _ = self.strain_range
        law = HypoelasticLaw(self.beta(y), self.nu12, np.array(self.strain_range), form=self.form)
        law = self.law(law, y)
        pairs = [(warp * a, fill * b) for a, b in CORNERS]
        return np.array([closed_path(law, pair, SIDE).share for pair in pairs])

    def within_work(self, y: Array) -> bool:
        most = self.bounds.work
        return not np.isfinite(most) or bool((np.abs(self.work(y)) <= most).all())

    def work_rows(self, y: Array) -> tuple[Array, Array]:
        """Return A, c of `A @ y >= c`, the bounds of that work, linear about y, if any."""
        if not np.isfinite(self.bounds.work):
            return np.empty((0, self.count)), np.empty(0)
        slope = np.zeros((len(CORNERS), self.count))
        steps = SLOPE * np.eye(self.count)
        for k in range(self.size + len(self.nuisance.shared)):
            slope[:, k] = (self.work(y + steps[k]) - self.work(y - steps[k])) / (2 * SLOPE)
        rest = self.work(y) - slope @ y
        most = (1 - WITHIN) * self.bounds.work
        a = np.vstack([slope, -slope])
        c = np.concatenate([-most - rest, rest - most])
        bad = ~np.isfinite(c)  # no law: nothing is within
        return np.where(bad[:, None], 0.0, a), np.where(bad, 1.0, c)

    def extreme(self, row: Array, sign: float) -> float:
        """Return the largest (sign 1) or smallest (-1) row @ y that the inequalities allow."""
        a, c = self.inequalities
        found = scipy.optimize.linprog(-sign * row, A_ub=-a, b_ub=-c, bounds=(None, None))
        return float(row @ found.x) if found.status == 0 else float(sign * np.inf)

    def modulus_row(self, name: str, strain: float) -> Array:
        """Return (count,) so that this @ y is a modulus (MPa) at a strain."""
        row = self.rows(name, np.array([strain]))[0] @ self.to_coefficients
        return np.concatenate([row, np.zeros(self.count - self.size)])

    def modulus_range(self, name: str, strain: float) -> tuple[float, float]:
        """Return the smallest and the largest modulus (MPa) that the bounds allow at a strain."""
        key = name, float(strain)
        if key not in self._ranges:
            row = self.modulus_row(name, strain)
            self._ranges[key] = self.extreme(row, -1.0), self.extreme(row, 1.0)
        return self._ranges[key]

    @cached_property
    def _ranges(self) -> dict[tuple[str, float], tuple[float, float]]:
        return {}

    @cached_property
    def stability_rows(self) -> Array:
        """Return the rows of `inequalities` with the modulus that stability depends on."""
        names = np.concatenate([[name] * len(rows) for name, rows in self.moduli.items()])
        return self.inequalities[0][: len(names)][names == SHEAR]


MOST_VALUES = 4  # values of one modulus that are drawn


def dimensions(unknowns: Unknowns) -> int:
    """Return how many numbers between 0 and 1 determine a law inside the bounds."""
    if unknowns.bounds.largest is None:
        return unknowns.size
    return _between(unknowns.form.modulus_of).shape[1]


def coefficients_at(unknowns: Unknowns, share: Array) -> Array:
    """Return free coefficients (count, size) MPa at places (count, dimensions) between 0 and 1.
    Even in the box of their bounds, or in the logarithm of bounded moduli at the control strains.
    """
    if unknowns.bounds.largest is None:
        lower, upper = unknowns.box
        return np.asarray(lower + (upper - lower) * share)
    between = _between(unknowns.form.modulus_of)
    ends = [np.log(end) for end in unknowns.bounds.control(unknowns.form)]
    values = np.exp(ends[0] + (ends[1] - ends[0]) * (share @ between.T))
    return np.asarray(values @ unknowns.from_values.T)


def _between(modulus_of: Sequence[str]) -> Array:
    """Return (size, drawn), from what is drawn to the control values of every modulus.
    Values of their own where a modulus has few; more are interpolated, because a curve through many
    independent ones hardly ever stays inside its bounds between them."""
    blocks = []
    for name in dict.fromkeys(modulus_of):
        count = sum(own == name for own in modulus_of)
        few = min(count, MOST_VALUES)
        at = np.linspace(0.0, few - 1.0, count)
        blocks.append(np.column_stack([np.interp(at, range(few), row) for row in np.eye(few)]))
    return np.asarray(scipy.linalg.block_diag(*blocks))


def allowed(unknowns: Unknowns, coefficients: Array) -> NDArray[np.bool_]:
    """Return (n,) which free coefficients (n, size) MPa make moduli inside their bounds."""
    grid, margin = unknowns.positivity
    moduli = coefficients @ grid.T
    good = (moduli >= margin).all(axis=1)
    if unknowns.ceiling is not None:
        good &= (moduli <= unknowns.ceiling).all(axis=1)
    return np.asarray(good)


MOST_DRAWS = 200_000
BATCH = 500
SOBOL_BATCH = 512  # points of a Sobol sequence that are even in every box come in powers of two


class Starts(Protocol):
    """A way to choose starts by their number alone, the same on any machine."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Yield free coefficients (size,) MPa of allowed moduli, the first to be tried first."""


@dataclass(frozen=True)
class RandomStarts:
    """Starts drawn each by itself, from at most 200,000 draws."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        random = np.random.default_rng([seed, number])
        for _ in range(MOST_DRAWS // BATCH):
            draws = coefficients_at(unknowns, random.random((BATCH, dimensions(unknowns))))
            yield from draws[allowed(unknowns, draws)]


@dataclass(frozen=True, eq=False)
class EstimatedStarts:
    """One start at estimated coefficients (size,) MPa, the others drawn at random."""

    coefficients: Array

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        if number == 0:
            yield self.coefficients
        yield from RandomStarts().candidates(unknowns, seed, number)


@dataclass(frozen=True)
class SobolStarts:
    """Starts spread evenly: start k is allowed point k of the sequence that the seed scrambles.
    Where that cannot be analysed, random points follow."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        sequence = scipy.stats.qmc.Sobol(dimensions(unknowns), seed=seed)
        before = 0
        for _ in range(MOST_DRAWS // SOBOL_BATCH):
            points = coefficients_at(unknowns, sequence.random(SOBOL_BATCH))
            good = points[allowed(unknowns, points)]
            if number < before + len(good):
                yield good[number - before]
                break
            before += len(good)
        yield from RandomStarts().candidates(unknowns, seed, number)
