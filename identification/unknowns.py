"""The unknowns of a fit: moduli at the control strains of the law's form, and nuisance.

The coefficients of a law (the free entries of its beta, in MPa) may be badly scaled (monomials:
condition 1e8 against 6e3 in modulus values), so the fit works in values of the moduli at control
strains. Bounds on the coefficients and on the moduli are linear in either.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..materials.definite import definite_rows
from ..materials.forms.base import SHEAR, Form, moduli_on_grid
from ..materials.law import HypoelasticLaw
from .bounds import LawBounds
from .comparison import Comparison
from .nuisance import NuisanceOf

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: MPa; a bound that is zero or negative says nothing of the size of a modulus.
SMALLEST = 1e-3


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What a fit may change, between which bounds, and how the optimisers see it.

    Unknowns y (count,) are moduli at control strains, each in units of its modulus' own size, then
    the nuisance in its units: what comparisons share, then comparison by comparison.

    Parameters
    ----------
    form : how the law's numbers make its moduli.
    strain_range : ends (eps1, eps2, gamma12) over which bounds are asked.
    bounds : of the law.
    nuisance : of the comparisons.
    definite_nu12 : Poisson's ratio of a law that has to be positive definite where the fabric
        contracts, None where it need not.
    """

    form: Form
    strain_range: tuple[float, ...]
    bounds: LawBounds
    nuisance: NuisanceOf = field(default_factory=NuisanceOf)
    definite_nu12: float | None = None

    @classmethod
    def of(
        cls,
        form: Form,
        nu12: float,
        strain_range: ArrayLike,
        bounds: LawBounds,
        comparisons: Iterable[Comparison] = (),
    ) -> Unknowns:
        """Of a fit: the law's, and what its comparisons add.

        Raises
        ------
        InputError : bounds that do not go with the form.
        """
        bounds.check(form)
        several = tuple(comparisons)
        nuisance = NuisanceOf({c.name: c.nuisance for c in several})
        # Where it is unknown, whatever it may be: the largest is the strictest.
        most = max([nu12, *(n.upper for n in nuisance.shared if n.law_parameter == "nu12")])
        return cls(
            form,
            tuple(np.asarray(strain_range, dtype=float).tolist()),
            bounds,
            nuisance,
            most if any(c.contracts for c in several) else None,
        )

    # Their places and names

    @property
    def free(self) -> tuple[int, ...]:
        """Place of each free coefficient in the law's beta."""
        return self.form.free

    @property
    def size(self) -> int:
        """Number of the law's unknowns."""
        return len(self.form.free)

    @property
    def count(self) -> int:
        """Number of all unknowns."""
        return self.size + len(self.nuisance.all)

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the free coefficients, for histories and tables."""
        return tuple(self.form.labels[i] for i in self.free)

    @property
    def nuisance_names(self) -> tuple[str, ...]:
        """Of the nuisance, with its comparison where there are several."""
        return self.nuisance.names

    def nuisance_values(self, comparison: str, y: Array) -> dict[str, float]:
        """The nuisance of a comparison by plain name at unknowns y, in its units."""
        return self.nuisance.values(comparison, y[self.size :])

    def nuisance_places(self, comparison: str) -> NDArray[np.intp]:
        """Where the nuisance of a comparison lies among the unknowns."""
        return self.size + self.nuisance.places(comparison)

    @cached_property
    def shear(self) -> Flags:
        """(count,) which unknowns make the modulus that a loss of stability hangs on."""
        extra = self.count - self.size
        return np.array([*(name == SHEAR for name in self.form.modulus_of), *[False] * extra])

    # From unknowns to the law and back

    @cached_property
    def from_values(self) -> Array:
        """(size, size): free coefficients = this @ moduli (MPa) at the control strains."""
        return self.form.from_values(self.strain_range)

    @cached_property
    def to_coefficients(self) -> Array:
        """(size, size): free coefficients (MPa) = this @ unknowns."""
        return self.from_values * self._sizes

    @cached_property
    def _sizes(self) -> Array:
        """(size,) MPa: geometric mean of the bounds of each unknown's modulus."""
        if self.bounds.largest is not None:
            least, largest = self.bounds.control(self.form)
            return np.sqrt(least * largest)
        lower, upper = self.box
        sizes = {}
        for name, rows in self.moduli.items():
            # At zero strain, where the box says what a modulus can be.
            at_lower, at_upper = rows[0] * lower, rows[0] * upper
            ends = np.minimum(at_lower, at_upper).sum(), np.maximum(at_lower, at_upper).sum()
            sizes[name] = np.sqrt(max(ends[0], SMALLEST) * max(ends[1], SMALLEST))
        return np.array([sizes[name] for name in self.form.modulus_of])

    def beta(self, y: Array) -> Array:
        """The law's beta (MPa) at unknowns y (count,)."""
        full = np.zeros(self.form.size)
        full[list(self.free)] = self.to_coefficients @ y[: self.size]
        return full

    def law(self, law: HypoelasticLaw, y: Array) -> HypoelasticLaw:
        """A law with the numbers that unknowns y (count,) say, nu12 where it is one of them."""
        numbers: dict[str, Any] = {"beta": self.beta(y), **self.nuisance.of_law(y[self.size :])}
        return replace(law, **numbers)

    def at(self, coefficients: Array) -> Array:
        """Unknowns (count,) of free coefficients (size,) MPa, nuisance where a fit starts."""
        values = np.linalg.solve(self.to_coefficients, coefficients)
        return np.concatenate([values, self.nuisance.start])

    # What is allowed

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper (size,) of the free coefficients, MPa."""
        return self.bounds.box(self.form, self.from_values)

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """By modulus, rows (n, size): rows @ free coefficients are moduli on a strain grid."""
        columns = list(self.free)
        grids = moduli_on_grid(self.form, self.strain_range)
        return {name: rows[:, columns] for name, rows in grids.items()}

    @cached_property
    def positivity(self) -> tuple[Array, Array]:
        """A, margin of `A @ coefficients >= margin`: the moduli on their strain grids, MPa."""
        margin = [np.full(len(rows), self.bounds.least[name]) for name, rows in self.moduli.items()]
        return np.vstack(list(self.moduli.values())), np.concatenate(margin)

    @cached_property
    def ceiling(self) -> Array | None:
        """The largest modulus allowed in each row of `positivity`, MPa."""
        most = self.bounds.largest
        if most is None:
            return None
        return np.concatenate([np.full(len(r), most[name]) for name, r in self.moduli.items()])

    @cached_property
    def inequalities(self) -> tuple[Array, Array]:
        """A, c of `A @ y >= c`: what the law and the nuisance are allowed; rows scaled.

        The first rows are the moduli of `positivity`.
        """
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
        law, extra = np.vstack(a), self.count - self.size
        whole = np.zeros((len(law) + 2 * extra, self.count))
        whole[: len(law), : self.size] = law
        whole[len(law) :, self.size :] = np.vstack([np.eye(extra), -np.eye(extra)])
        low, high = self.nuisance.bounds
        return whole, np.concatenate([*c, low, -high])

    @cached_property
    def stability_rows(self) -> Array:
        """The rows of `inequalities` that keep up the modulus that stability hangs on."""
        names = np.concatenate([[name] * len(rows) for name, rows in self.moduli.items()])
        return self.inequalities[0][: len(names)][names == SHEAR]

    def is_positive(self, coefficients: Array) -> bool:
        """Every modulus above its margin on the grid, at coefficients (size,) MPa (Eq. 4.9)."""
        grid, margin = self.positivity
        return bool((grid @ coefficients >= margin).all())
