"""Derivatives of a membrane's displacements along the path of the analysis.

Those of sheets and strips follow by direct differentiation, those of closed membranes, with gas,
contact and wrinkles, by finite differences.
"""

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw, law_beside, law_slopes, usual_step
from .closed import ClosedMembrane
from .kernel import (
    POINT,
    SheetSlopes,
    State,
    StateSlopes,
    advance,
    by_sheet,
    element_slopes,
    explicit_residual_slopes,
)
from .membrane import Array, Membrane

#: For each parameter of a sheet, by name, the derivatives of: the reference positions (n, 3), the
#: stress-free positions (n, 3), the direction of the warp (3,), and the stretch of the yarns
#: (elements, 4, 2, 2).
SheetChanges = Mapping[str, tuple[Array, Array, Array, Array]]


class Derivatives:
    """Derivatives of displacement, strain and stress, updated from increment to increment.

    Parameters
    ----------
    membrane : Membrane
        In its unloaded state.
    parameters : sequence of str
        Names of the p parameters: of the law ("beta_i", "nu12", ...), "pressure_offset",
        "thickness", or in `sheet`.
    sheet : SheetChanges, optional
        Derivatives of the stress-free sheet by its own parameters.
    at : (stress_free, yarn, stretch), optional
        The sheet itself, which `sheet` needs: stress-free positions of the nodes (n, 3) mm,
        direction of the warp (3,), and stretch of the yarns (elements, 4, 2, 2).
    """

    def __init__(
        self,
        membrane: Membrane,
        parameters: Sequence[str],
        sheet: SheetChanges | None = None,
        at: tuple[Array, Array, Array] | None = None,
    ) -> None:
        self.membrane = membrane
        law = membrane.law
        names = list(parameters)
        shape = (len(membrane.quads), 4, 3, len(names))
        remembered = law.state - 3
        self.of_law = law_slopes(law, names, float(np.mean(membrane.thickness)))
        self.pressure_column = names.index("pressure_offset") if "pressure_offset" in names else -1
        self.stress = np.zeros(shape)
        self.fresh = np.empty(shape)
        self.strain = np.zeros((*shape[:2], law.state, len(names)))
        self.point = np.empty((len(membrane.quads), 4, POINT + remembered))
        self.residual_slopes = np.empty((membrane.reference.size, len(names)))
        sheet = sheet or {}
        self.columns = np.array([names.index(name) for name in sheet], dtype=np.intp)
        self.green = np.empty((*shape[:3], len(sheet)))
        if sheet and at is not None:
            surface, ways, turns, by = (
                np.stack(columns) for columns in zip(*sheet.values(), strict=True)
            )
            stress_free, yarn, stretch = at
            self.surface, self.ways = (
                np.ascontiguousarray(np.moveaxis(columns, 0, -1)) for columns in (surface, ways)
            )
            self.slopes, self.area = element_slopes(
                stress_free,
                membrane.quads,
                ways,
                yarn,
                turns,
                stretch,
                by,
            )
            self.sheet_residual_slopes = np.empty((membrane.reference.size, len(sheet)))

    def at_fixed_displacement(self, u: Array, pressure: float = 0.0) -> Array:
        """Return the derivatives (3 n, p) of the residual at fixed displacement.

        Parameters
        ----------
        u : (n, 3) array, mm
            An equilibrium.
        pressure : float, MPa
        """
        m = self.membrane
        law = m.law.compiled
        position = m.reference + u
        before = State(m.strain_old, m.stress_old)
        explicit_residual_slopes(
            position,
            m.compiled_elements,
            law,
            before,
            self.of_law,
            StateSlopes(self.strain, self.stress, self.fresh),
            self.pressure_column,
            self.point,
            self.residual_slopes,  # written
        )
        if len(self.columns):
            sheet = SheetSlopes(self.surface, self.slopes, self.area)
            by_sheet(
                position,
                m.compiled_elements,
                pressure,
                law,
                before,
                sheet,
                self.green,
                self.sheet_residual_slopes,  # written
            )
            self.residual_slopes[:, self.columns] += self.sheet_residual_slopes
            if m.cords is not None:
                self.residual_slopes[:, self.columns] += m.cords.slopes(
                    position, self.surface, self.ways
                )
        return self.residual_slopes

    def advance(self, du: Array) -> None:
        """Update the derivatives of strain and stress to the end of the increment.

        `at_fixed_displacement` comes first.

        Parameters
        ----------
        du : (3 n, p) array
            Derivatives of the displacement there.
        """
        m = self.membrane
        self.stress, self.fresh = self.fresh, self.stress
        advance(
            m.quads,
            m.elements.slopes,
            self.point,
            du,
            self.green,
            self.columns,
            self.strain,
            self.stress,
        )

    def increment(self, u: Array, pressure: float = 0.0) -> Array:
        """Return the derivatives (3 n, p) of the displacement, and update strain and stress.

        Parameters
        ----------
        u : (n, 3) array, mm
            An equilibrium which the membrane has not yet accepted and whose tangent is factorised.
        pressure : float, MPa
        """
        m = self.membrane
        slopes = self.at_fixed_displacement(u, pressure)
        du = np.zeros_like(slopes)
        du[m.free] = -m.tangent.solve(slopes[m.free])
        self.advance(du)
        return du


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
