"""The inflated cylinder in three-point bending as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..meshes.mesh import Mesh
from .bodies import Collar, RigidSupports
from .gas import Gas
from .reading import CurveReading, curve_reading

Array = NDArray[np.float64]

NEAR = 1e-9  # of a length
#: Node sets of the mesh beside those of the planes of symmetry.
NEEDED = ("support", "support_bottom", "mid_span", "top_line", "bottom_line")


@dataclass(frozen=True, eq=False)
class CylinderModel:
    """A cylinder that is inflated, closed, and bent by a collar between two supports.

    First the gauge pressure rises over `inflation`, the bottom held in height at the supports
    (`held_on_inflation`). Then the gas is closed in, its mass constant, and the cylinder lies free
    on the supports while the collar goes down.

    Reported: the inflated state, then every one of `deflections`; load in N, pressure and volume,
    all of the WHOLE cylinder (`copies` of what is meshed).

    Parameters
    ----------
    mesh : mm, as `cylinder_mesh` makes it: z along the axis, y up, seam at the bottom, `warp` in
        each quad, and the rows `support` and `support_bottom` at z = span / 2.
    thickness : (quads,) mm in the reference state; the seam is three times as thick.
    inflation : MPa, strictly increasing: the increments of gauge pressure; the last one is the
        pressure at which the gas is closed in.
    deflections : mm that the collar has gone down since it touched the inflated cylinder,
        strictly increasing: the frames to report.
    increments : mm, likewise, containing every deflection: the steps over which the hypoelastic
        law is integrated. The deflections unless given.
    supports, collar : rigid, frictionless.
    gas : what is closed in.
    reading : where the curve of load over deflection is read, which changes no result; by the
        diameter unless given.

    Raises
    ------
    InputError : a mesh without warp directions or one of the node sets, thicknesses that are not
        positive or not one a quad, pressures or deflections that do not increase, increments
        without one of the deflections, supports that are not under the cylinder, a collar that
        does not go around it or reaches the supports.
    """

    mesh: Mesh
    thickness: Array
    inflation: Sequence[float]
    deflections: Sequence[float]
    collar: Collar
    supports: RigidSupports = field(default_factory=RigidSupports)
    gas: Gas = field(default_factory=Gas)
    increments: Sequence[float] = ()
    reading: CurveReading = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        self._check_mesh()
        if self.reading is None:
            object.__setattr__(self, "reading", curve_reading(self.diameter))
        steps = np.array(self.increments if len(self.increments) else self.deflections, float)
        levels = {
            "inflation": np.array(self.inflation, float),
            "deflections": np.array(self.deflections, float),
            "increments": steps,
        }
        for name, values in levels.items():
            good = len(values) and np.isfinite(values).all()
            if not good or not (np.diff(values, prepend=0.0) > 0).all():
                raise InputError(None, name, f"expected positive, increasing, got {values}")
            object.__setattr__(self, name, tuple(values.tolist()))
        near = np.abs(steps[:, None] - levels["deflections"]).min(axis=0)
        if (near > 1e-9 * levels["deflections"]).any():
            raise InputError(None, "increments", "must contain every reported deflection")
        self._check_bodies()

    def _check_mesh(self) -> None:
        if self.mesh.warp is None or self.mesh.warp.shape != (len(self.mesh.quads), 3):
            raise InputError(None, "mesh", "has no direction of the warp in each quad")
        for name in NEEDED:
            if not len(self.mesh.node_sets.get(name, ())):
                raise InputError(None, "mesh", f"has no node set {name!r}")
        thickness = np.array(self.thickness, float)
        if thickness.shape != (len(self.mesh.quads),):
            problem = f"expected one a quad, {len(self.mesh.quads)}, got shape {thickness.shape}"
            raise InputError(None, "thickness", problem)
        if not (np.isfinite(thickness) & (thickness > 0)).all():
            raise InputError(None, "thickness", f"expected > 0 mm, got {thickness.min()}")
        object.__setattr__(self, "thickness", thickness)

    def _check_bodies(self) -> None:
        p = self.mesh.points
        half, diameter = np.abs(p[:, 2]).max(), self.diameter
        row = np.abs(p[self.mesh.node_sets["support"], 2])
        if not np.allclose(row, 0.5 * self.supports.span, rtol=NEAR):
            problem = f"{self.supports.span:g} mm, but the mesh has its row at {row[0]:g} mm"
            raise InputError(None, "supports.span", problem)
        if not 0.5 * (self.supports.span + self.supports.diameter) < half:
            problem = f"{self.supports.span:g} mm does not fit under {2 * half:g} mm of cylinder"
            raise InputError(None, "supports.span", problem)
        if not self.collar.inner_diameter > diameter * (1 + NEAR):
            problem = f"expected more than the cylinder's {diameter:g} mm"
            raise InputError(None, "collar.inner_diameter", problem)
        if not self.collar.length < self.supports.span - self.supports.diameter:
            problem = f"{self.collar.length:g} mm reaches the supports"
            raise InputError(None, "collar.length", problem)

    @property
    def diameter(self) -> float:
        """mm, before inflation."""
        return self.diameter_at(self.mesh.points)

    def diameter_at(self, points: Array) -> float:
        """Of the circle (mm) with the area that the ring at mid-span encloses.

        points : (n, 3) mm, where the nodes are.
        """
        ring = self.mesh.node_sets["mid_span"]
        across, up = self.mesh.points[ring, :2].T
        x, y = points[ring[np.argsort(np.arctan2(across, -up))], :2].T
        # On a quarter the last side, from the top to the bottom, lies in the plane of symmetry.
        area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        return float(np.sqrt((8.0 if self._cut("x") else 4.0) * area / np.pi))

    @property
    def pressure(self) -> float:
        """Gauge pressure of the inflated cylinder, MPa."""
        return self.inflation[-1]

    @property
    def copies(self) -> int:
        """How many times the mesh makes the whole cylinder: 4 for a quarter."""
        return int(2 ** sum(f"symmetry_{axis}" in self.mesh.node_sets for axis in "xz"))

    @property
    def reported(self) -> NDArray[np.intp]:
        """Index of each reported deflection in `increments`, (frames - 1,)."""
        steps = np.array(self.increments)
        return np.array([int(np.argmin(np.abs(steps - d))) for d in self.deflections])

    @property
    def guides(self) -> Mapping[str, tuple[int, ...]]:
        """Directions held at zero throughout, by node set: the planes of symmetry.

        On the whole cylinder top and bottom line stay in the plane x = 0 and the ring at mid-span
        in z = 0, where symmetry has them anyway: frictionless supports hold it in height only.
        """
        sideways = ("symmetry_x",) if self._cut("x") else ("top_line", "bottom_line")
        along = "symmetry_z" if self._cut("z") else "mid_span"
        return {**{name: (0,) for name in sideways}, along: (2,)}

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Degrees of freedom held at zero throughout, 3 * node + direction, sorted."""
        held = [3 * self.mesh.node_sets[n] + k for n, ks in self.guides.items() for k in ks]
        return np.unique(np.concatenate(held)).astype(np.intp)

    @property
    def held_on_inflation(self) -> NDArray[np.intp]:
        """Degrees of freedom held at zero until the cylinder is inflated, sorted."""
        bottom = 3 * self.mesh.node_sets["support_bottom"] + 1
        return np.union1d(self.fixed, bottom).astype(np.intp)

    def _cut(self, axis: str) -> bool:
        return f"symmetry_{axis}" in self.mesh.node_sets
