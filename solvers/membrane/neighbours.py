"""Derivatives of closed membranes by finite differences, along the path of the analysis."""

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw, law_beside, usual_step
from .closed import ClosedMembrane

Array = NDArray[np.float64]


class Neighbours:
    """Copies of a membrane, each with one parameter changed by a small step, that follow its path.

    Each neighbour has its own strain and stress. Its equilibrium is found from the membrane's by
    two chord steps with the membrane's tangent, which includes gas, contact, cords and wrinkles;
    with one step a relative error of 1e-3 would remain in a derivative.

    Attributes
    ----------
    membranes : list of ClosedMembrane
        One for each of the k parameters.
    displacements : list of (n, 3) ndarray, mm
        Displacement of each neighbour at its last equilibrium.
    steps : (k,) ndarray
        Change of each parameter, in the parameter's unit.
    """

    def __init__(
        self, membrane: ClosedMembrane, parameters: Sequence[str], largest_change: float = 1e-5
    ) -> None:
        """Copy the membrane once for each parameter.

        Parameters
        ----------
        largest_change : float
            The largest relative change of a modulus by a step.
        """
        law = membrane.law
        self.membranes = []
        acting = {"nu12", *(f"beta_{i}" for i in law.form.free)}  # others of a form stay zero
        self.steps = np.array([usual_step(law, name, 1.0, largest_change) for name in parameters])
        for name, step in zip(parameters, self.steps.tolist(), strict=True):
            neighbour_law = law_beside(law, name, step) if name in acting else law
            self.membranes.append(_copied(membrane, neighbour_law))
        self.displacements = [np.zeros_like(membrane.reference) for _ in self.membranes]

    def continue_on(self, membrane: ClosedMembrane) -> None:
        """Replace the neighbours by copies of a membrane with other supports, and keep their state.

        The new membrane has the strain and stress of the previous one.
        """
        originals = self.membranes
        self.membranes = [_copied(membrane, original.law) for original in originals]
        for copied, original in zip(self.membranes, originals, strict=True):
            copied.strain_old[:] = original.strain_old
            copied.stress_old[:] = original.stress_old

    def follow(self, membrane: ClosedMembrane, u: Array) -> None:
        """Find and accept the equilibria of all neighbours next to that of the membrane.

        Parameters
        ----------
        u : array
            Displacement (n, 3) mm of the membrane, which must not have accepted it yet.

        Raises
        ------
        SolverFailure
            If a neighbour has no valid stress.
        """
        if not self.membranes:
            return
        # From the same wrinkles, equal sheets have equal stresses to the last digit.
        start = membrane.wrinkle.copy(), membrane.stress_new.copy()
        membrane.unbalance(u, membrane.pressure, with_tangent=True)
        membrane.factor()
        free = membrane.free
        for k, neighbour in enumerate(self.membranes):
            displacement = u.copy()
            neighbour.wrinkle[:], neighbour.stress_new[:] = start
            neighbour.unbalance(displacement, membrane.pressure, with_tangent=False)
            for _ in range(2):
                difference = (neighbour.residual - membrane.residual)[free]
                displacement.reshape(-1)[free] -= membrane.tangent.solve(difference)
                neighbour.wrinkle[:], neighbour.stress_new[:] = start
                norm = neighbour.unbalance(displacement, membrane.pressure, with_tangent=False)
                if not np.isfinite(norm):
                    raise SolverFailure("no derivative: no valid stress next to an equilibrium")
            neighbour.accept()
            self.displacements[k] = displacement

    def slopes(self, value: Array, neighbour_values: Sequence[Array]) -> Array:
        """Return the derivatives (..., k) of a quantity by the parameters.

        Parameters
        ----------
        value, neighbour_values
            The quantity (...) of the membrane, and of each neighbour.
        """
        columns = [
            (neighbour_value - value) / step
            for neighbour_value, step in zip(neighbour_values, self.steps, strict=True)
        ]
        return np.stack(columns, axis=-1) if columns else np.zeros((*value.shape, 0))


def _copied(membrane: ClosedMembrane, law: HypoelasticLaw) -> ClosedMembrane:
    """Return a copy of a membrane with another law, whose strain and stress are its own arrays."""
    copied = copy.copy(membrane)
    for name in ("strain_old", "stress_old", "strain_new", "stress_new", "wrinkle", "residual"):
        setattr(copied, name, getattr(membrane, name).copy())
    copied.law = law
    copied.cords = copy.deepcopy(membrane.cords)
    return copied
