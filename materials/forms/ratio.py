"""Forms whose stiffness depends on the strains, by splines, and on the ratio of the loads.

`spline-ratio`: E1 and E2 grow with the normalised load ratio gamma of their own yarns, after
Galliot and Luchsinger (2009). `polynomial.LoadRatio` is their form, with moduli that do not depend
on strain; this one has splines of strain at equal loads:

    E1 = E1(eps1) + dE1 (gamma1 - 1/sqrt 2),    gamma1 = n1 / sqrt(n1^2 + n2^2), and E2 alike,

with n1, n2 the loads along warp and fill.

`spline-crimp`: two families that exchange crimp. Yarn axes are zigzags (Kawabata, Niwa and Kawai,
J. Textile Inst. 64 (1973) 21; the geometry is Peirce's, ibid. 28 (1937) T45) of small slopes r1,
r2 without load. The crossings move by w: the slopes become r1 - w and r2 + w, and the yarns
lengthen, in log strain, by

    c1 = r1^2 - (r1 - w)^2,    c2 = r2^2 - (r2 + w)^2   (r^2 is what a yarn gains when straight).

The forces at a crossing balance, s1 (r1 - w) = s2 (r2 + w) + S w, with s1, s2 the stresses along
the yarns and S (MPa) the stiffness of the bed that the coating makes for the crossings:

    w = (r1 s1 - r2 s2) / (S + s1 + s2),    deps = D(eps)^-1 ds + dc(s).

D(eps) is the plane stiffness by E1, E2 and nu12, so E1 and E2 are moduli without exchange of crimp.
The strain c is the derivative by s of a potential, (r1 s1 - r2 s2)^2 / (S + s1 + s2), which is
convex in tension: the compliance by c is symmetric and not negative, and does no work along a
closed path of stress. beta ends with T1 = r1 S, T2 = r2 S and S, all in MPa.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from .base import EVEN, Array, Offer, register_form
from .spline import Spline, knots_of

#: Largest slope r of a yarn without load; 45 degrees would be 0.7 in this measure.
STEEPEST = 0.5


class _MoreThanSpline(Spline):
    """A spline form whose beta has further entries at its end.

    Attributes
    ----------
    further_labels : tuple of str
        Labels of the further entries.
    further_moduli : tuple of str
        The modulus, or the bound of `own_bounds`, that each belongs to (`LawForm.modulus_of`).
    """

    further_labels: ClassVar[tuple[str, ...]]
    further_moduli: ClassVar[tuple[str, ...]]

    @property
    def size(self) -> int:
        return super().size + len(self.further_labels)

    @property
    def labels(self) -> tuple[str, ...]:
        return (*super().labels, *self.further_labels)

    @property
    def modulus_of(self) -> tuple[str, ...]:
        return (*super().modulus_of, *self.further_moduli)


@dataclass(frozen=True)
class SplineRatio(_MoreThanSpline):
    """A spline at equal loads, followed by the gains of E2 and E1 by their load ratios."""

    name = "spline-ratio"
    further_labels = ("dE2", "dE1")
    further_moduli = ("E2", "E1")

    def by_load_ratio(self) -> Array:
        """Return the derivatives (2, size) of E1 and E2 by the load ratio, as rows of beta."""
        rows = np.zeros((2, self.size))
        rows[1, -2] = rows[0, -1] = 1.0
        return rows

    def from_values(self, strain_range: Sequence[float]) -> Array:
        """Return the map from moduli at the knots, and at rest where one yarn carries all."""
        matrix = np.eye(self.size)
        share = 1.0 / (1.0 - EVEN)
        first = self.modulus_of.index
        for place, name in ((-2, "E2"), (-1, "E1")):
            matrix[place, first(name)] = -share
            matrix[place, place] = share
        return matrix

    def describe(self) -> str:
        return (
            f"{super().describe()} E2 and E1 are those at equal loads; dE2 and dE1 are what "
            "they gain where their load ratio n / sqrt(n1^2 + n2^2) goes from 0 to 1."
        )


@dataclass(frozen=True)
class SplineCrimp(_MoreThanSpline):
    """A spline of yarns without exchange, followed by T1, T2 and S of their crimp interchange."""

    name = "spline-crimp"
    further_labels = ("T1", "T2", "S")
    further_moduli = ("T", "T", "S")
    #: Bounds (MPa) of T, a slope times S, and of S.
    own_bounds: ClassVar[Mapping[str, tuple[float, float]]] = {"T": (0.01, 30.0), "S": (0.5, 200.0)}

    def by_crimp(self) -> Array:
        """Return rows (3, size) that take the constants of crimp, the last three, from beta."""
        return np.eye(self.size)[-3:]

    def own_rows(self, name: str) -> Array:
        """Return (n, size) rows whose products with beta keep the bounds of "T" or "S".

        Those of "S" are S, and S - T / STEEPEST of both yarns, which limits the slopes.
        """
        first, second, bed = self.by_crimp()
        if name == "T":
            return np.array([first, second])
        return np.array([bed, bed - first / STEEPEST, bed - second / STEEPEST])

    def describe(self) -> str:
        return (
            f"{super().describe()} E2 and E1 are those without exchange of crimp; then T1 and "
            "T2, slopes of the yarns times S, and S, the stress of the bed of the crossings."
        )


for _form in (SplineRatio, SplineCrimp):

    def _named(
        name: str,
        settings: Mapping[str, Any],
        strain_range: Sequence[float],
        spline_class: type[Spline] = _form,
    ) -> Spline:
        return spline_class.at(knots_of(settings, strain_range))

    register_form(Offer(_form.name, _named, ("knots",), of_load_ratio=True))
