"""Derivatives of closed membranes by differences: membranes of neighbouring laws, step by step."""

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw, law_beside, usual_step
from .closed import ClosedMembrane

Array = NDArray[np.float64]


class Neighbours:
    """Membranes of laws next to that of another one, a parameter and a step each, on its way.

    A neighbour has a state of its own. Its equilibrium follows from the membrane's in two steps by
    the tangent of that one (gas, contact, cords, wrinkles): one would leave 1e-3 of a slope.

    Attributes
    ----------
    membranes : list of ClosedMembrane
    displacements : list of (n, 3) ndarray, mm
        Of each at its last equilibrium.
    steps : (k,) ndarray
        Changes of the parameters, each in its unit.
    """

    def __init__(
        self, membrane: ClosedMembrane, parameters: Sequence[str], largest_change: float = 1e-5
    ) -> None:
        """Copy the membrane; largest_change : of a modulus, as a share of it."""
        law = membrane.law
        self.membranes = []
        acting = {"nu12", *(f"beta_{i}" for i in law.form.free)}  # others of a form stay zero
        self.steps = np.array([usual_step(law, name, 1.0, largest_change) for name in parameters])
        for name, step in zip(parameters, self.steps.tolist(), strict=True):
            neighbour_law = law_beside(law, name, step) if name in acting else law
            self.membranes.append(_copied(membrane, neighbour_law))
        self.displacements = [np.zeros_like(membrane.reference) for _ in self.membranes]

    def continue_on(self, membrane: ClosedMembrane) -> None:
        """Go on beside a membrane with other supports, which has the state of the one before."""
        originals = self.membranes
        self.membranes = [_copied(membrane, original.law) for original in originals]
        for copied, original in zip(self.membranes, originals, strict=True):
            copied.strain_old[:] = original.strain_old
            copied.stress_old[:] = original.stress_old

    def follow(self, membrane: ClosedMembrane, u: Array) -> None:
        """Move to the equilibria beside u (n, 3), that of the membrane, before it is accepted."""
        if not self.membranes:
            return
        membrane.unbalance(u, membrane.pressure, with_tangent=True)
        membrane.factor()
        free = membrane.free
        for k, neighbour in enumerate(self.membranes):
            displacement = u.copy()
            neighbour.unbalance(displacement, membrane.pressure, with_tangent=False)
            for _ in range(2):
                difference = (neighbour.residual - membrane.residual)[free]
                displacement.reshape(-1)[free] -= membrane.tangent.solve(difference)
                norm = neighbour.unbalance(displacement, membrane.pressure, with_tangent=False)
                if not np.isfinite(norm):
                    raise SolverFailure("no derivative: no valid stress next to an equilibrium")
            neighbour.accept()
            self.displacements[k] = displacement

    def slopes(self, value: Array, neighbour_values: Sequence[Array]) -> Array:
        """Return derivatives (..., k) of a quantity by its values at the neighbours."""
        columns = [
            (neighbour_value - value) / step
            for neighbour_value, step in zip(neighbour_values, self.steps, strict=True)
        ]
        return np.stack(columns, axis=-1) if columns else np.zeros((*value.shape, 0))


def _copied(membrane: ClosedMembrane, law: HypoelasticLaw) -> ClosedMembrane:
    """Return a membrane with a state of its own, that of the other one, and another law."""
    copied = copy.copy(membrane)
    for name in ("strain_old", "stress_old", "strain_new", "stress_new", "wrinkle", "residual"):
        setattr(copied, name, getattr(membrane, name).copy())
    copied.law = law
    copied.cords = copy.deepcopy(membrane.cords)
    return copied
