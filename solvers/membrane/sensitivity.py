"""Derivatives of a membrane's displacements by direct differentiation along the strain path."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...materials.law import law_slopes
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
from .membrane import Membrane

Array = NDArray[np.float64]
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
        self.columns: list[int] = []
        if sheet and at is not None:
            self.columns = [names.index(name) for name in sheet]
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
            self.green = np.empty((*shape[:3], len(sheet)))
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
        if self.columns:
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
            self.strain,
            self.stress,
        )
        if self.columns:
            to_strain, to_stress = (
                self.point[..., first : first + 9].reshape(*self.point.shape[:2], 3, 3)
                for first in (6, 15)
            )
            strain = to_strain @ self.green
            self.strain[..., :3, self.columns] += strain
            for first in range(3, self.strain.shape[2], 3):
                factor = self.point[..., POINT + first - 3 : POINT + first, None]
                self.strain[..., first : first + 3, self.columns] += factor * strain
            self.stress[..., self.columns] += to_stress @ strain

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
