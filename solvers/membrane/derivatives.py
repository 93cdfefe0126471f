"""Displacement derivatives along the strain path: one increment after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...materials.law_slopes import law_slopes
from .element_slopes import element_slopes
from .newton import Membrane
from .sensitivity import POINT, advance, explicit
from .sheet_sensitivity import by_sheet

Array = NDArray[np.float64]
#: By name of a parameter, derivatives (n, 3) of the reference places and of the stress-free ones.
SheetSlopes = Mapping[str, tuple[Array, Array]]


class Derivatives:
    """Derivatives of displacement, strain and stress, carried along the strain path.

    Parameters
    ----------
    parameters : "beta_i" (entry i of the law's beta), "nu12", "pressure_offset", "thickness" (of
        a sheet of one thickness), and those of `sheet`.
    stress_free : (n, 3) mm, places of the nodes without stress; needed with `sheet` only.
    sheet : of the parameters that are of the sheet.
    """

    def __init__(
        self,
        membrane: Membrane,
        parameters: Sequence[str],
        stress_free: Array | None = None,
        sheet: SheetSlopes | None = None,
    ) -> None:
        self.membrane = membrane
        law, names = membrane.law, list(parameters)
        shape = (len(membrane.quads), 4, 3, len(names))
        self.rows, self.by_coupling = law_slopes(law, names, float(np.mean(membrane.thickness)))
        self.push = names.index("pressure_offset") if "pressure_offset" in names else -1
        self.strain, self.stress, self.fresh = np.zeros(shape), np.zeros(shape), np.empty(shape)
        self.point = np.empty((len(membrane.quads), 4, POINT))
        self.rate = np.empty((membrane.reference.size, len(names)))
        self.sheet: Sheet | None = None
        if sheet and stress_free is not None:
            self.sheet = Sheet(membrane, stress_free, sheet, [names.index(n) for n in sheet])

    def at_fixed_displacement(self, u: Array, pressure: float = 0.0) -> Array:
        """Explicit derivative of the residual at the equilibrium u, (3 n, np)."""
        m, e, law = self.membrane, self.membrane.elements, self.membrane.law
        explicit(
            m.reference + u, m.quads, e.values, e.slopes, e.area, m.section, law.pieces,
            law.coupling, law.area_power, m.strain_old, m.stress_old, self.rows, self.by_coupling,
            self.push, self.strain, self.stress, self.fresh, self.point, self.rate,
        )  # fmt: skip
        if self.sheet is not None:
            self.rate[:, self.sheet.columns] += self.sheet.at_fixed_displacement(u, pressure)
        return self.rate

    def advance(self, du: Array) -> None:
        """Take strain and stress derivatives to the end of the increment, du (3 n, np)."""
        m = self.membrane
        self.stress, self.fresh = self.fresh, self.stress
        advance(m.quads, m.elements.slopes, self.point, du, self.strain, self.stress)
        if self.sheet is not None:
            strain, stress = self.sheet.at_points(self.point)
            self.strain[..., self.sheet.columns] += strain
            self.stress[..., self.sheet.columns] += stress

    def increment(self, u: Array, pressure: float = 0.0) -> Array:
        """d u / d parameters (3 n, np) at the equilibrium u, factorised and not yet accepted."""
        m = self.membrane
        rate = self.at_fixed_displacement(u, pressure)
        du = np.zeros_like(rate)
        du[m.free] = -m.tangent.solve(rate[m.free])
        self.advance(du)
        return du


class Sheet:
    """What the parameters of the stress-free sheet bring at fixed displacement.

    Parameters
    ----------
    columns : where these parameters stand among all.
    """

    def __init__(
        self, membrane: Membrane, stress_free: Array, slopes: SheetSlopes, columns: Sequence[int]
    ) -> None:
        self.membrane, self.columns = membrane, list(columns)
        self.surface = np.array([surface for surface, _ in slopes.values()])
        pairs = [element_slopes(stress_free, membrane.quads, way) for _, way in slopes.values()]
        self.slopes = np.array([slopes for slopes, _ in pairs])
        self.area = np.array([area for _, area in pairs])
        self.green = np.empty((len(membrane.quads), 4, 3, len(columns)))
        self.rate = np.empty((membrane.reference.size, len(columns)))

    def at_fixed_displacement(self, u: Array, pressure: float) -> Array:
        """Of the residual, (3 n, columns)."""
        m, e, law = self.membrane, self.membrane.elements, self.membrane.law
        by_sheet(
            m.reference + u, m.quads, e.values, e.slopes, e.area, m.section, pressure, law.pieces,
            law.coupling, law.area_power, m.strain_old, m.stress_old, self.surface, self.slopes,
            self.area, self.green, self.rate,
        )  # fmt: skip
        return self.rate

    def at_points(self, point: Array) -> tuple[Array, Array]:
        """Of log strain and stress (elements, 4, 3, columns); point : what `explicit` left."""
        to_strain = point[..., 6:15].reshape(*point.shape[:2], 3, 3)
        to_stress = point[..., 15:24].reshape(*point.shape[:2], 3, 3)
        strain = to_strain @ self.green
        return strain, to_stress @ strain
