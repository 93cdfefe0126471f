"""The unknowns of a fit: moduli at the control strains of the law's form, and nuisance.

The coefficients of a law may be badly scaled (monomials: condition 1e8 against 6e3 in modulus
values). Bounds on coefficients and on moduli are linear in either.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials.closed_path import closed_path
from ..materials.forms.base import SHEAR, Array, LawForm, moduli_on_grid, modulus_rows, own_bounds
from ..materials.law import HypoelasticLaw, definite_rows
from .comparison import Comparison
from .law_bounds import LawBounds
from .nuisance import NuisanceUnknowns

#: MPa; a bound that is zero or negative says nothing of the size of a modulus.
MIN_MODULUS_SIZE = 1e-3
#: Corners of the closed paths whose work is bounded, as shares of the ends of the range: that of a
#: card is as far as its test reached.
CORNERS = tuple((i / 8, j / 8) for i in range(2, 9) for j in range(2, 9))
CLOSED_PATH_STEPS = 16  # increments of a side of a closed path
WORK_MARGIN = 0.04  # of that bound, by which steps keep off it: between the corners it is higher
WORK_DIFFERENCE = 1e-5  # of an unknown, by which that work is differentiated
TOLERATED_VIOLATION = 1e-6  # of a scaled inequality: by so much it may be missed


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns y (count,) of a fit, their bounds, and their relation to the law.

    Moduli at control strains come first, in units of the size of their modulus, then the nuisance:
    what comparisons share, then comparison by comparison.

    Attributes
    ----------
    form : LawForm
    strain_range : (3,) tuple
        Ends of the strains over which the bounds hold.
    bounds : LawBounds
    nuisance : NuisanceUnknowns
    definite_nu12 : float, optional
        Poisson's ratio of a law that has to be positive definite; None where it need not be.
    nu12 : float
        Of the law, where it is no unknown.
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
            Of the law, where it is no unknown.
        strain_range : (3,) array, logarithmic
            Ends of the strains over which the bounds hold.
        bounds : LawBounds
        comparisons : iterable of Comparison
            With the nuisance.

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
        # Where it is unknown, whatever it may be: the largest is the strictest.
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
        """Return the labels of the free coefficients."""
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
            smallest, largest = self.bounds.control(self.form)
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
        """Return a law with the numbers of unknowns y (count,), nu12 where it is one of them."""
        return law.with_numbers(self.beta(y), self.nuisance.of_law(y[self.size :]))

    def at(self, coefficients: Array) -> Array:
        """Return unknowns (count,) of free coefficients (size,) MPa, nuisance at its beginning."""
        values = np.linalg.solve(self.to_coefficients, coefficients)
        return np.concatenate([values, self.nuisance.begin])

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Return lower and upper bounds (size,) of the free coefficients, MPa.

        Of bounded moduli: the smallest box of all laws that keep them at the control strains.
        """
        if self.bounds.lower is not None and self.bounds.upper is not None:
            return self.bounds.lower, self.bounds.upper
        low, high = (self.from_values * ends for ends in self.bounds.control(self.form))
        return np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)

    def rows(self, name: str, strain: Array) -> Array:
        """Return rows whose product with the free coefficients is a modulus.

        Parameters
        ----------
        name : str
        strain : (n,) array, logarithmic

        Returns
        -------
        (n, size) array
            MPa per MPa.
        """
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
        t = self.to_coefficients
        grid, margin = self.positivity
        lower, upper = self.box
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
        return np.vstack(a), c

    def _nuisance_inequalities(self) -> tuple[Array, list[Array]]:
        """Return rows for the nuisance, and limits in parts: its bounds, and unloading tangents.

        A law reloads along a tangent that is at most that of its unloading.
        """
        count = self.count - self.size
        law_parameters = [n.law_parameter for n in self.nuisance.shared]
        pairs = []
        for reloading, name in enumerate(law_parameters):
            if name is not None and name.startswith("reloading_"):
                pairs.append((law_parameters.index(name.replace("re", "un", 1)), reloading))
        rows = np.vstack([np.eye(count), -np.eye(count), np.zeros((len(pairs), count))])
        for row, (unloading, reloading) in enumerate(pairs, start=2 * count):
            rows[row, [unloading, reloading]] = 1.0, -1.0
        lower, upper = self.nuisance.bounds
        return rows, [lower, -upper, np.zeros(len(pairs))]

    def keeps_bounds(self, y: Array) -> bool:
        """Return whether unknowns (count,) keep all bounds, those of the work included.

        Moduli above their margin, coefficients and moduli within their bounds, and the form's own
        inequalities: whatever moves the unknowns of a fit afterwards has to be looked at with it.
        """
        rows, limits = self.inequalities
        return bool((rows @ y >= limits - TOLERATED_VIOLATION).all()) and self.within_work(y)

    def work(self, y: Array) -> Array:
        """Return the work of closed paths to `CORNERS` (corners,), as shares of that of loading."""
        warp, fill, _ = self.strain_range
        law = HypoelasticLaw(self.beta(y), self.nu12, np.array(self.strain_range), form=self.form)
        law = self.law(law, y)
        pairs = [(warp * a, fill * b) for a, b in CORNERS]
        return np.array([closed_path(law, pair, CLOSED_PATH_STEPS).share for pair in pairs])

    def within_work(self, y: Array) -> bool:
        """Return whether the work of all closed paths is within its bound."""
        limit = self.bounds.work
        return not np.isfinite(limit) or bool((np.abs(self.work(y)) <= limit).all())

    def work_rows(self, y: Array) -> tuple[Array, Array]:
        """Return A, c of `A @ y >= c`, the bounds of that work, linear about y, if any."""
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

        Parameters
        ----------
        row : (count,) array
        sign : float
            1 for the largest, -1 for the smallest.
        """
        a, c = self.inequalities
        solution = scipy.optimize.linprog(-sign * row, A_ub=-a, b_ub=-c, bounds=(None, None))
        return float(row @ solution.x) if solution.status == 0 else float(sign * np.inf)

    def modulus_row(self, name: str, strain: float) -> Array:
        """Return (count,) so that this @ y is a modulus (MPa) at a strain."""
        row = self.rows(name, np.array([strain]))[0] @ self.to_coefficients
        return np.concatenate([row, np.zeros(self.count - self.size)])

    def modulus_range(self, name: str, strain: float) -> tuple[float, float]:
        """Return the smallest and the largest modulus (MPa) that the bounds allow.

        Parameters
        ----------
        name : str
        strain : float
            Logarithmic.
        """
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
