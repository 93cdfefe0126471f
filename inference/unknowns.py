"""The unknowns of a fit: moduli at the control strains of the law's form, nuisance, their bounds.

Moduli are unknowns instead of coefficients because these may be badly scaled (a condition number of
1e8 with monomials, against 6e3 with moduli). Bounds on coefficients and bounds on moduli are both
linear in the unknowns; the work of the law along closed paths of strain is bounded as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials.admissibility import closed_path
from ..materials.forms.base import SHEAR, Array, LawForm, moduli_on_grid, modulus_rows, own_bounds
from ..materials.law import HypoelasticLaw, definite_rows
from .comparison import Comparison
from .nuisance import NuisanceUnknowns


@dataclass(frozen=True, eq=False)
class LawBounds:
    """Bounds of the moduli or of the coefficients of a law, and of the work of closed paths.

    Attributes
    ----------
    smallest : mapping of float, MPa
        Smallest value of each modulus ("E1", "E2", "G12") anywhere on the strain range, and of the
        form's other constants, if it has any with bounds.
    largest : mapping of float, MPa, optional
        Largest values likewise; None where the coefficients are bounded instead.
    lower, upper : (free,) arrays, MPa, optional
        Bounds of the free coefficients; None where the moduli are bounded.
    work : float
        Largest work that the law may do along a closed path of strain, as a share of the work of
        loading (`ClosedPath.share`).
    """

    smallest: Mapping[str, float]
    largest: Mapping[str, float] | None = None
    lower: Array | None = None
    upper: Array | None = None
    work: float = np.inf

    @classmethod
    def of_moduli(cls, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return bounds of the moduli from (smallest, largest) of each, MPa."""
        return cls(
            {name: float(low) for name, (low, _) in ranges.items()},
            {name: float(high) for name, (_, high) in ranges.items()},
        )

    def with_constants(self, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return these bounds and those of a form's own constants, (smallest, largest) in MPa."""
        smallest = {name: low for name, (low, _) in ranges.items()}
        smallest.update(self.smallest)
        largest = None
        if self.largest is not None:
            largest = {name: high for name, (_, high) in ranges.items()}
            largest.update(self.largest)
        return replace(self, smallest=smallest, largest=largest)

    def at_control_strains(self, form: LawForm) -> tuple[Array, Array]:
        """Return the smallest and largest moduli (free,) at the form's control strains, MPa."""
        assert self.largest is not None
        smallest = np.array([self.smallest[name] for name in form.modulus_of])
        return smallest, np.array([self.largest[name] for name in form.modulus_of])


#: Least size of a modulus, MPa, for bounds that are zero or negative.
MIN_MODULUS_SIZE = 1e-3
#: Corners (warp, fill) of the closed strain paths whose work is bounded, as shares of the ends of
#: the strain range. There are several because the range of a card ends where its test did.
CORNERS = tuple((i / 8, j / 8) for i in range(2, 9) for j in range(2, 9))
CLOSED_PATH_STEPS = 16  # increments of a side of a closed path
#: Share of the bound on the work by which steps keep off it, as the work may be larger on paths
#: between the corners.
WORK_MARGIN = 0.04
WORK_DIFFERENCE = 1e-5  # step of the unknowns in a finite difference of the work
TOLERATED_VIOLATION = 1e-6  # by which a scaled inequality may be violated


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns y (count,) of a fit, their bounds, and their relation to the law.

    Moduli at control strains come first, each divided by the typical size of its modulus; then the
    nuisance parameters, first those that comparisons share, then those of one comparison after the
    other.

    Attributes
    ----------
    form : LawForm
    strain_range : (3,) tuple
        Ends of the log strains (eps1, eps2, gamma12) up to which the bounds hold.
    bounds : LawBounds
    nuisance : NuisanceUnknowns
    definite_nu12 : float, optional
        Poisson's ratio with which the law has to be positive definite (the largest allowed, where
        it is unknown); None where it need not be.
    nu12 : float
        Poisson's ratio nu12 of the law, used where it is no unknown.
    """

    form: LawForm
    strain_range: tuple[float, ...]
    bounds: LawBounds
    nuisance: NuisanceUnknowns = field(default_factory=NuisanceUnknowns)
    definite_nu12: float | None = None
    nu12: float = 0.0

    @classmethod
    def of(
        cls,
        form: LawForm,
        nu12: float,
        strain_range: ArrayLike,
        bounds: LawBounds,
        comparisons: Iterable[Comparison] = (),
    ) -> Unknowns:
        """Return the unknowns of a law and its comparisons.

        Parameters
        ----------
        form : LawForm
        nu12 : float
            Poisson's ratio nu12 of the law, used where it is no unknown.
        strain_range : (3,) array
            Ends of the log strains (eps1, eps2, gamma12) up to which the bounds hold.
        bounds : LawBounds
        comparisons : iterable of Comparison
            Comparisons whose nuisance parameters are unknowns.

        Raises
        ------
        InputError
            A modulus has no bounds.
        """
        bounds = bounds.with_constants(own_bounds(form))
        missing = [name for name in dict.fromkeys(form.modulus_of) if name not in bounds.smallest]
        if missing:
            raise InputError(None, f"bounds.{missing[0]}", "this key is missing; add it")
        comparisons = tuple(comparisons)
        nuisance = NuisanceUnknowns({c.name: c.nuisance for c in comparisons})
        # Where nu12 is unknown, the law has to be definite with the largest, the strictest case.
        upper_bounds = [n.upper for n in nuisance.shared if n.law_parameter == "nu12"]
        largest_nu12 = max([nu12, *upper_bounds])
        contracts = any(comparison.contracts for comparison in comparisons)
        return cls(
            form,
            tuple(np.asarray(strain_range, dtype=float).tolist()),
            bounds,
            nuisance,
            largest_nu12 if contracts else None,
            nu12,
        )

    @property
    def free(self) -> tuple[int, ...]:
        """Return the index of each free coefficient in the law's beta."""
        return self.form.free

    @property
    def size(self) -> int:
        """Return the number of unknowns of the law, without nuisance parameters."""
        return len(self.form.free)

    @property
    def count(self) -> int:
        """Return the number of all unknowns."""
        return self.size + len(self.nuisance.all)

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the free coefficients."""
        return tuple(self.form.labels[i] for i in self.free)

    def nuisance_values(self, comparison: str, y: Array) -> dict[str, float]:
        """Return the nuisance of a comparison by plain name at unknowns y, in its units."""
        return self.nuisance.values(comparison, y[self.size :])

    def nuisance_positions(self, comparison: str) -> NDArray[np.intp]:
        """Return the positions of a comparison's nuisance among the unknowns."""
        return self.size + self.nuisance.positions(comparison)

    def columns_of(self, comparison: str) -> NDArray[np.intp]:
        """Return the unknowns of a comparison: those of the law, then its nuisance."""
        return np.concatenate([np.arange(self.size), self.nuisance_positions(comparison)])

    @cached_property
    def is_shear(self) -> NDArray[np.bool_]:
        """Return (count,) which unknowns are of G12, on which a membrane's stability depends."""
        extra = self.count - self.size
        return np.array([*(name == SHEAR for name in self.form.modulus_of), *[False] * extra])

    @cached_property
    def from_values(self) -> Array:
        """Return the matrix (size, size) from moduli (MPa) at control strains to coefficients."""
        return self.form.from_values(self.strain_range)

    @cached_property
    def to_coefficients(self) -> Array:
        """Return the matrix (size, size) from unknowns of the law to free coefficients (MPa)."""
        return self.from_values * self._sizes

    @cached_property
    def _sizes(self) -> Array:
        """Return (size,) MPa, the geometric mean of the bounds of each unknown's modulus."""
        if self.bounds.largest is not None:
            smallest, largest = self.bounds.at_control_strains(self.form)
            return np.sqrt(smallest * largest)
        lower, upper = self.box
        sizes = {}
        for name, rows in self.moduli.items():
            # At zero strain, where the box says what a modulus can be.
            at_lower = rows[0] * lower
            at_upper = rows[0] * upper
            smallest_modulus = max(np.minimum(at_lower, at_upper).sum(), MIN_MODULUS_SIZE)
            largest_modulus = max(np.maximum(at_lower, at_upper).sum(), MIN_MODULUS_SIZE)
            sizes[name] = np.sqrt(smallest_modulus * largest_modulus)
        return np.array([sizes[name] for name in self.form.modulus_of])

    def beta(self, y: Array) -> Array:
        """Return the law's beta (MPa) at unknowns y (count,)."""
        full = np.zeros(self.form.size)
        full[list(self.free)] = self.to_coefficients @ y[: self.size]
        return full

    def law(self, law: HypoelasticLaw, y: Array) -> HypoelasticLaw:
        """Return a law with the values of unknowns y (count,), all others as they are in it."""
        return law.with_numbers(self.beta(y), self.nuisance.of_law(y[self.size :]))

    def at(self, coefficients: Array) -> Array:
        """Return unknowns (count,) from free coefficients (size,) MPa; nuisance at its `begin`."""
        values = np.linalg.solve(self.to_coefficients, coefficients)
        return np.concatenate([values, self.nuisance.begin])

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (size,) of the free coefficients, MPa.

        Where moduli are bounded instead, it is the least box with all laws that keep their bounds
        at the control strains.
        """
        if self.bounds.lower is not None and self.bounds.upper is not None:
            return self.bounds.lower, self.bounds.upper
        low, high = (self.from_values * ends for ends in self.bounds.at_control_strains(self.form))
        return np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)

    def coefficient_rows(self, name: str, strain: Array) -> Array:
        """Return rows whose product with the free coefficients is a modulus.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains.

        Returns
        -------
        (n, size) array
            MPa per MPa.
        """
        return modulus_rows(self.form, name, strain, self.strain_range)[:, list(self.free)]

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """Return by modulus (n, size) rows whose product with the coefficients is it on a grid."""
        columns = list(self.free)
        grids = moduli_on_grid(self.form, self.strain_range)
        return {name: rows[:, columns] for name, rows in grids.items()}

    @cached_property
    def positivity(self) -> tuple[Array, Array]:
        """Return A and margin of `A @ coefficients >= margin`, the lower bounds of moduli, MPa.

        They are asked for on the grids of strain of the form.
        """
        margin = [
            np.full(len(rows), self.bounds.smallest[name]) for name, rows in self.moduli.items()
        ]
        return np.vstack([np.empty((0, self.size)), *self.moduli.values()]), np.concatenate(
            [np.empty(0), *margin]
        )

    @cached_property
    def ceiling(self) -> Array | None:
        """Return the largest modulus allowed in each row of `positivity`, MPa."""
        largest = self.bounds.largest
        if largest is None:
            return None
        return np.concatenate(
            [np.full(len(rows), largest[name]) for name, rows in self.moduli.items()]
        )

    @cached_property
    def inequalities(self) -> tuple[Array, Array]:
        """Return A, c of `A @ y >= c`, rows scaled; the first rows are those of `positivity`."""
        law_rows, law_limits = self._law_inequalities()
        nuisance_rows, nuisance_limits = self._nuisance_inequalities()
        rows = scipy.linalg.block_diag(law_rows, nuisance_rows)
        return rows, np.concatenate([*law_limits, *nuisance_limits])

    def _law_inequalities(self) -> tuple[Array, list[Array]]:
        """Return rows for the unknowns of the law (size,), and limits in parts."""
        if not self.size:
            return np.empty((0, 0)), []
        t = self.to_coefficients
        grid, margin = self.positivity
        lower, upper = self.box
        # A coefficient between equal bounds is scaled by itself.
        width = upper - lower
        width = np.where(width > 0, width, np.maximum(np.abs(upper), 1.0))
        moduli = grid @ t
        unit = 1.0 / np.abs(moduli).max(axis=1)
        # Least moduli on the grids of strain, least and largest coefficients, ...
        a = [moduli * unit[:, None], t / width[:, None], -t / width[:, None]]
        c = [margin * unit, lower / width, -upper / width]
        if self.ceiling is not None:  # ... largest moduli, ...
            a.append(-moduli * unit[:, None])
            c.append(-self.ceiling * unit)
        # ... and a tangent that is positive definite.
        if self.definite_nu12 is not None:
            rows = definite_rows(self.form, self.definite_nu12, self.strain_range)
            definite = rows[:, list(self.free)] @ t
            a.append(definite / np.abs(definite).max(axis=1, keepdims=True))
            c.append(np.zeros(len(definite)))
        return np.vstack(a), c

    def _nuisance_inequalities(self) -> tuple[Array, list[Array]]:
        """Return rows for the nuisance parameters, and limits in parts.

        They are the bounds, linear conditions on parameters of models, and for a law with an
        unknown memory, that its tangent of reloading is at most that of unloading.
        """
        count = self.count - self.size
        law_parameters = [n.law_parameter or "" for n in self.nuisance.shared]
        pairs = []
        for reloading, name in enumerate(law_parameters):
            quantity, _, strain = name.partition("_")
            if quantity == "reloading":
                pairs.append((law_parameters.index(f"unloading_{strain}"), reloading))
        within_bounds = [np.eye(count), -np.eye(count)]
        rows = np.vstack([*within_bounds, np.zeros((len(pairs), count))])
        for row, (unloading, reloading) in enumerate(pairs, start=2 * count):
            rows[row, [unloading, reloading]] = 1.0, -1.0
        lower, upper = self.nuisance.bounds
        conditions, limits = self.nuisance.conditions
        return np.vstack([rows, conditions]), [lower, -upper, np.zeros(len(pairs)), limits]

    def keeps_bounds(self, y: Array) -> bool:
        """Return whether unknowns y (count,) keep all inequalities and the bound on the work.

        Every change of the unknowns after a fit, as an extrapolation, has to be checked with it.
        """
        rows, limits = self.inequalities
        return bool((rows @ y >= limits - TOLERATED_VIOLATION).all()) and self.within_work(y)

    def work(self, y: Array) -> Array:
        """Return the work of the closed path to each of `CORNERS`, over that of its loading.

        Parameters
        ----------
        y : (count,) array
            Unknowns.
        """
        warp, fill, _ = self.strain_range
        law = HypoelasticLaw(self.beta(y), self.nu12, np.array(self.strain_range), form=self.form)
        law = self.law(law, y)
        pairs = [(warp * a, fill * b) for a, b in CORNERS]
        return np.array([closed_path(law, pair, CLOSED_PATH_STEPS).share for pair in pairs])

    def within_work(self, y: Array) -> bool:
        """Return whether the work of all closed paths is within its bound at y (count,)."""
        limit = self.bounds.work
        return not np.isfinite(limit) or bool((np.abs(self.work(y)) <= limit).all())

    def work_rows(self, y: Array) -> tuple[Array, Array]:
        """Return A (m, count) and c (m,) of `A @ y >= c`, bounds of the work linearised about y.

        There are no rows (m = 0) without a bound.
        """
        if not np.isfinite(self.bounds.work):
            return np.empty((0, self.count)), np.empty(0)
        slope = np.zeros((len(CORNERS), self.count))
        steps = WORK_DIFFERENCE * np.eye(self.count)
        for k in range(self.size + len(self.nuisance.shared)):
            difference = self.work(y + steps[k]) - self.work(y - steps[k])
            slope[:, k] = difference / (2 * WORK_DIFFERENCE)
        intercept = self.work(y) - slope @ y
        limit = (1 - WORK_MARGIN) * self.bounds.work
        a = np.vstack([slope, -slope])
        c = np.concatenate([-limit - intercept, intercept - limit])
        has_no_law = ~np.isfinite(c)  # nothing is within
        return np.where(has_no_law[:, None], 0.0, a), np.where(has_no_law, 1.0, c)

    def extreme(self, row: Array, sign: float) -> float:
        """Return the largest or smallest value of row @ y that the inequalities allow.

        It is infinite where they do not bound it.

        Parameters
        ----------
        row : (count,) array
        sign : float
            1 for the largest, -1 for the smallest.
        """
        return float(self._extremes(row[None, :], sign)[0])

    def _extremes(self, rows: Array, sign: float) -> Array:
        """Return the extreme (n,) of each of rows (n, count) @ y, from one linear programme.

        It has a copy of the unknowns for every row, of those only that inequalities couple to rows.
        """
        a, c = self.inequalities
        coupled = _coupled(a, np.asarray(rows.any(axis=0)))
        binding = a[:, coupled].any(axis=1)
        block = -a[np.ix_(binding, coupled)]
        costs = rows[:, coupled]
        solution = scipy.optimize.linprog(
            -sign * costs.reshape(-1),
            A_ub=scipy.sparse.block_diag([block] * len(rows), format="csr"),
            b_ub=np.tile(-c[binding], len(rows)),
            bounds=(None, None),
        )
        if solution.status == 0:
            return np.asarray((costs * solution.x.reshape(costs.shape)).sum(axis=1))
        if len(rows) == 1:
            return np.array([sign * np.inf])
        return np.array([self.extreme(row, sign) for row in rows])

    def modulus_row(self, name: str, strain: float) -> Array:
        """Return a row (count,) whose product with y is a modulus (MPa) at a log strain."""
        return self.modulus_rows(name, np.array([strain]))[0]

    def modulus_rows(self, name: str, strain: Array) -> Array:
        """Return rows (n, count) whose product with y is a modulus (MPa).

        Parameters
        ----------
        name : str
            Name of the modulus.
        strain : (n,) array
            Log strains.
        """
        rows = np.zeros((len(strain), self.count))
        rows[:, : self.size] = self.coefficient_rows(name, strain) @ self.to_coefficients
        return rows

    def modulus_limits(self, name: str, strain: Array, sign: float) -> Array:
        """Return the largest or smallest moduli that the bounds allow.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains.
        sign : float
            1 for the largest, -1 for the smallest.

        Returns
        -------
        (n,) array, MPa
        """
        limits = self._limits.setdefault((name, sign), {})
        strains = strain.tolist()
        uncomputed = [value for value in strains if value not in limits]
        if uncomputed:
            rows = self.modulus_rows(name, np.array(uncomputed))
            limits.update(zip(uncomputed, self._extremes(rows, sign), strict=True))
        return np.array([limits[value] for value in strains])

    @cached_property
    def _limits(self) -> dict[tuple[str, float], dict[float, float]]:
        """Return computed limits (MPa) of moduli by name and sign, and by strain."""
        return {}

    @cached_property
    def stability_rows(self) -> Array:
        """Return the rows of `inequalities` that are lower bounds of the shear modulus G12."""
        names = np.concatenate([[name] * len(rows) for name, rows in self.moduli.items()])
        return self.inequalities[0][: len(names)][names == SHEAR]


def _coupled(rows: Array, unknowns: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (count,) which unknowns inequalities couple to marked ones, directly or by others.

    Parameters
    ----------
    rows : (m, count) array
        Of the inequalities.
    unknowns : (count,) array of bool
        The marked ones.
    """
    while True:
        coupled = np.logical_or(unknowns, rows[rows[:, unknowns].any(axis=1)].any(axis=0))
        if (coupled == unknowns).all():
            return coupled
        unknowns = coupled
