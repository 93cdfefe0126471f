"""Symmetries of a law: fewer coefficients, from which a linear map makes all moduli of its form.

A balanced law has E1 = E2 = E. An isotropic one also has G12 = E / (2 (1 + nu12)). Where E depends
on the strain, G12 at the shear gamma takes E at the strain gamma / (1 + nu12): that of a strip in
tension whose axes at 45 degrees have this shear. Moduli that depend on single components of strain
make no law that is exactly the same in all directions; with constants it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ...errors import InputError
from ...light_dataclasses import dataclass
from .base import (
    COMPONENTS,
    SHEAR,
    UNLIMITED,
    Array,
    LawForm,
    own_bounds,
    ratio_map,
)

Symmetry = Literal["orthotropic", "balanced", "isotropic"]
#: By symmetry the moduli that a law has beside those that follow from them, with their labels.
MODULI: Mapping[Symmetry, Mapping[str, str]] = {
    "orthotropic": {name: name for name in COMPONENTS},
    "balanced": {"E1": "E1 = E2", SHEAR: SHEAR},
    "isotropic": {"E1": "E"},
}


@dataclass(frozen=True)
class SymmetricForm(LawForm):
    """A form with the free coefficients of `MODULI` of another one alone.

    Attributes
    ----------
    orthotropic : LawForm
        The form whose E1 gives E, and whose G12 a balanced law has.
    symmetry : {"balanced", "isotropic"}
    nu12 : float
        Poisson's ratio of an isotropic law; 0 of a balanced one, which does not need it.
    """

    orthotropic: LawForm
    symmetry: Symmetry
    nu12: float

    @property
    def name(self) -> str:
        return self.orthotropic.name

    @cached_property
    def _positions(self) -> list[int]:
        """Return the positions of the coefficients among the free ones of the orthotropic form."""
        names = self.orthotropic.modulus_of
        return [i for i, name in enumerate(names) if name in MODULI[self.symmetry]]

    @cached_property
    def _entries(self) -> list[int]:
        """Return the entries of beta of the orthotropic form that the coefficients are."""
        return [self.orthotropic.free[i] for i in self._positions]

    @property
    def size(self) -> int:
        return len(self._entries)

    @property
    def labels(self) -> tuple[str, ...]:
        labels = (self.orthotropic.labels[i] for i in self._entries)
        return tuple(label.replace("E1", "E") for label in labels)

    @property
    def modulus_of(self) -> tuple[str, ...]:
        return tuple(self.orthotropic.modulus_of[i] for i in self._positions)

    @property
    def _shear_per_strain(self) -> float:
        """Return the shear at 45 degrees to a strip over the strain along it."""
        return 1.0 + self.nu12

    def piece_map(self) -> Array:
        rows = self.orthotropic.piece_map()[..., self._entries]
        rows[1] = rows[0]
        if self.symmetry == "isotropic":
            powers = self._shear_per_strain ** np.arange(-3.0, 1.0)
            rows[2] = rows[0] * powers[:, None] / (2.0 * self._shear_per_strain)
        return rows

    def uppers(self) -> Array:
        uppers = self.orthotropic.uppers().copy()
        uppers[1] = uppers[0]
        if self.symmetry == "isotropic":
            uppers[2] = np.minimum(self._shear_per_strain * uppers[0], UNLIMITED)
        return uppers

    def grid(self, component: int, end: float) -> Array:
        if component < 2:
            return self.orthotropic.grid(0, end)
        if self.symmetry == "balanced":
            return self.orthotropic.grid(2, end)
        return self._shear_per_strain * self.orthotropic.grid(0, end / self._shear_per_strain)

    def from_values(self, strain_range: Sequence[float]) -> Array:
        values_map = self.orthotropic.from_values(strain_range)
        return values_map[np.ix_(self._positions, self._positions)]

    def by_load_ratio(self) -> Array:
        """Return the derivatives (2, size) of E1 and E2 by the load ratio, as rows of beta."""
        gain = ratio_map(self.orthotropic)[0, self._entries]
        return np.array([gain, gain])

    def to_card(self) -> dict[str, Any]:
        return {**self.orthotropic.to_card(), "symmetry": self.symmetry}

    def describe(self) -> str:
        moduli = " and ".join(MODULI[self.symmetry].values())
        shear = ""
        if self.symmetry == "isotropic":
            shear = ", G12 at gamma is E at gamma / (1 + nu12) over 2 (1 + nu12)"
        return (
            f"{self.orthotropic.describe()} The law is {self.symmetry}: its beta lists the fitted "
            f"coefficients of {moduli} alone{shear}."
        )


def symmetric(form: LawForm, symmetry: Symmetry, nu12: float) -> LawForm:
    """Return a form with a symmetry.

    Parameters
    ----------
    form : LawForm
        Form of an orthotropic law.
    symmetry : {"orthotropic", "balanced", "isotropic"}
    nu12 : float
        Poisson's ratio of the law.

    Raises
    ------
    InputError
        Warp and fill of the form have other knots or breaks, or its moduli have no such symmetry.
    """
    if symmetry == "orthotropic":
        return form
    is_isotropic = symmetry == "isotropic"
    if own_bounds(form) or (is_isotropic and ratio_map(form).any()):
        raise InputError(None, "symmetry", f"a {form.name} law is orthotropic: leave this out")
    warp, fill, _ = form.uppers()
    if not np.array_equal(warp, fill):
        problem = f"a {symmetry} law has the same knots or breaks along warp and fill"
        raise InputError(None, "symmetry", problem)
    return SymmetricForm(form, symmetry, nu12 if is_isotropic else 0.0)


def at_nu12(form: LawForm, nu12: float) -> LawForm:
    """Return a form with another Poisson's ratio, on which G12 of an isotropic law depends."""
    if not isinstance(form, SymmetricForm) or form.symmetry != "isotropic" or form.nu12 == nu12:
        return form
    return replace(form, nu12=nu12)


def pooled_strains(
    strains: Sequence[Sequence[float]], symmetry: Symmetry, nu12: float
) -> tuple[list[float], list[float], list[float]]:
    """Return the strains (eps1, eps2, gamma12) that each modulus of a law is of.

    Parameters
    ----------
    strains : sequence of 3 sequences of float
        Strains of each component; those of moduli that follow from each other are pooled.
    symmetry : {"orthotropic", "balanced", "isotropic"}
    nu12 : float
    """
    warp, fill, shear = (list(values) for values in strains)
    if symmetry == "orthotropic":
        return warp, fill, shear
    pooled = warp + fill
    if symmetry == "isotropic":
        pooled += [strain / (1.0 + nu12) for strain in shear]
        shear = [strain * (1.0 + nu12) for strain in pooled]
    return pooled, pooled, shear


def pooled_ends(form: LawForm, ends: Array) -> Array:
    """Return ends (3,) of strains (eps1, eps2, gamma12), those of pooled ones the largest."""
    if not isinstance(form, SymmetricForm):
        return ends
    pooled = pooled_strains([[end] for end in ends.tolist()], form.symmetry, form.nu12)
    return np.array([max(strains) for strains in pooled])


def modulus_labels(form: LawForm) -> Mapping[str, str]:
    """Return labels of the moduli that do not follow from others, by their names."""
    symmetry = form.symmetry if isinstance(form, SymmetricForm) else "orthotropic"
    return MODULI[symmetry] if form.size else {}
