"""Models of homogeneous tests as plain data: strips in tension, the biaxial patch, the tube.

Strips are those of the thesis, section 3.3.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .bubble_model import WithThicknessParameter
from .mesh import Array, Mesh, grid_quads, keep_levels, turned_over


def strip_mesh(
    width: float,
    length: float,
    across: int,
    along: int,
    gauge_length: float | None = None,
    symmetry: Literal["full", "half"] = "full",
) -> Mesh:
    """Mesh a rectangular strip in the xy plane, with y from 0 to `length` and its middle at x = 0.

    Parameters
    ----------
    width, length : float, mm
        Size of the WHOLE strip.
    across, along : int
        Number of quads of the part that is meshed; even across a whole strip.
    gauge_length : float, mm, optional
        Distance of the two nodes `gauge` on the middle line; the length unless given.
    symmetry : "full" or "half"
        Whether the whole strip is meshed, or the half x >= 0.

    Returns
    -------
    Mesh
        Node sets: `bottom`, `top`, `gauge` (the lower node first), `free_edges`; on a half also
        `symmetry_x`, where u_x = 0.

    Raises
    ------
    InputError
        If the gauge is longer than the strip, or there are too few rows for it.
    """
    gauge = length if gauge_length is None else gauge_length
    if gauge > length:
        raise InputError(None, "gauge_length", f"{gauge} mm is longer than the strip, {length} mm")
    y, lower = _levels(length, along, gauge)
    x = np.linspace(0.0 if symmetry == "half" else -0.5 * width, 0.5 * width, across + 1)
    middle = 0 if symmetry == "half" else across // 2
    x[middle] = 0.0
    row = across + 1
    points = np.zeros((row * (along + 1), 3))
    points[:, 0] = np.tile(x, along + 1)
    points[:, 1] = np.repeat(y, row)
    nodes = np.arange(len(points)).reshape(along + 1, row)
    quads = turned_over(grid_quads(nodes))
    sets = {
        "bottom": nodes[0],
        "top": nodes[-1],
        "gauge": nodes[[lower, along - lower], middle],
        "free_edges": nodes[:, -1] if symmetry == "half" else np.sort(nodes[:, [0, -1]].ravel()),
    }
    if symmetry == "half":
        sets["symmetry_x"] = nodes[:, 0]
    return Mesh(points, quads, sets)


def _levels(length: float, along: int, gauge: float) -> tuple[Array, int]:
    """Return positions (along + 1,) mm of the rows of nodes, and how many quads precede the gauge.

    The number of rows between the gauge marks suits the gauge's share of the length best.
    """
    if gauge == length:
        return np.linspace(0.0, length, along + 1), 0
    if along < 3:
        raise InputError(None, "along", f"a gauge inside the strip needs 3 rows, got {along}")
    candidates = np.arange(2 - along % 2, along - 1, 2)
    rows = int(candidates[np.argmin(np.abs(candidates / along - gauge / length))])
    rows_outside = (along - rows) // 2
    ends = 0.5 * (length - gauge), 0.5 * (length + gauge)
    below_gauge = np.linspace(0.0, ends[0], rows_outside + 1)
    above_gauge = np.linspace(ends[1], length, rows_outside + 1)
    between = np.linspace(*ends, rows + 1)[1:-1]
    return np.concatenate([below_gauge, between, above_gauge]), rows_outside


def yarn_direction(angle: float) -> Array:
    """Return the unit vector (3,) of a yarn at an angle (degrees) from the pull, y, towards x."""
    turn = math.radians(angle)
    return np.array([math.sin(turn), math.cos(turn), 0.0])


#: Supports by rollers on the top and on the symmetry line; the pulled end may contract in width.
ROLLERS: Mapping[str, tuple[int, ...]] = {"top": (1,), "symmetry_x": (0,)}
#: Supports of both ends as in the grips of the testing machine.
GRIPS: Mapping[str, tuple[int, ...]] = {"top": (0, 1), "bottom": (0,)}
#: Number of quads across and along in the thesis, for half a straight strip (Fig. 3.5) and for a
#: whole bias strip (Fig. 3.6).
QUADS = {"straight": (5, 8), "bias": (10, 30)}
#: Width of a strip, and distance of the grips, in mm (thesis, section 3.1).
WIDTH = 25.0
GRIP_DISTANCE = 75.0
#: Number of equal increments (thesis, section 3.3).
INCREMENTS = 100


@dataclass(frozen=True, eq=False)
class UniaxialModel(WithThicknessParameter):
    """A strip in the xy plane whose lower end is pulled along -y to given gauge elongations.

    Attributes
    ----------
    mesh : Mesh
        With the node sets `gauge` (two nodes), `pulled` and those of `supports`.
    warp : (3,) ndarray
        Direction of the warp.
    thickness : float, mm
    elongations : sequence of float, mm
        Elongations of the gauge at the ends of the law's increments: positive, and increasing
        unless `unloaded`.
    supports : mapping of str to tuple of int
        Directions in which the displacement is zero, by node set.
    pulled : str
        Node set that moves along -y as a whole.
    load_factor : float
        Load of the whole strip over the reaction of the mesh: 2 for half of a strip.
    unloaded : bool
        Whether elongations may also fall.
    """

    mesh: Mesh
    warp: NDArray[np.float64]
    thickness: float
    elongations: Sequence[float]
    supports: Mapping[str, tuple[int, ...]]
    pulled: str = "bottom"
    load_factor: float = 1.0
    unloaded: bool = False

    def __post_init__(self) -> None:
        keep_levels(self, " mm", self.unloaded, elongations=self.elongations)
        self.check_thickness()
        object.__setattr__(self, "warp", np.asarray(self.warp, float))

    @property
    def gauge_length(self) -> float:
        """Return the distance (mm) of the two nodes at the gauge marks, at rest."""
        lower, upper = self.mesh.points[self.mesh.node_sets["gauge"]]
        return float(np.linalg.norm(upper - lower))

    @property
    def driven(self) -> NDArray[np.intp]:
        """Return the numbers (n,) of the unknowns that the grip pulls, the y of its nodes."""
        return self.mesh.unknowns({self.pulled: (1,)})

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Return the numbers (n,) of the held unknowns: the supports', and z of all nodes."""
        flat = 3 * np.arange(len(self.mesh.points)) + 2
        return np.union1d(self.mesh.unknowns(self.supports), flat)


def straight_strip(
    direction: str,
    gauge_length: float,
    final_length: float,
    thickness: float,
    width: float = WIDTH,
    increments: int = INCREMENTS,
    across: int = QUADS["straight"][0],
    along: int = QUADS["straight"][1],
) -> UniaxialModel:
    """Return a tensile test along warp or fill, as half of the strip between its gauge marks.

    Lengths are in mm; `final_length` is that of the gauge at the end.

    Parameters
    ----------
    direction : {"warp", "fill"}
        Yarns along the pull.
    across, along : int
        Number of quads; 40 in all unless given (thesis, Fig. 3.5 and Table 3.1).
    """
    mesh = strip_mesh(width, gauge_length, across, along, symmetry="half")
    levels = _equal(gauge_length, final_length, increments)
    # Fill lies along the pull when warp is a quarter turn clockwise from it.
    warp = yarn_direction(0.0 if direction == "warp" else 90.0)
    return UniaxialModel(
        mesh,
        warp,
        thickness,
        levels,
        ROLLERS,
        load_factor=2.0,
    )


def bias_strip(
    gauge_length: float,
    final_length: float,
    thickness: float,
    width: float = WIDTH,
    length: float = GRIP_DISTANCE,
    angle: float = 45.0,
    increments: int = INCREMENTS,
    across: int = QUADS["bias"][0],
    along: int = QUADS["bias"][1],
) -> UniaxialModel:
    """Return a tensile test at an angle to the yarns, as the whole strip between its grips.

    Lengths are in mm: `gauge_length` and `final_length` of the gauge at the start and at the end,
    `length` between the grips.

    Parameters
    ----------
    angle : float, degrees
        From the pull to the warp.
    across, along : int
        Number of quads (thesis, Fig. 3.6).
    """
    mesh = strip_mesh(width, length, across, along, gauge_length)
    levels = _equal(gauge_length, final_length, increments)
    return UniaxialModel(mesh, yarn_direction(angle), thickness, levels, GRIPS)


def refined_quads(strip: Literal["straight", "bias"], factor: float) -> dict[str, int]:
    """Return the numbers of quads `across` and `along` of the thesis, multiplied by a factor.

    They are rounded to numbers with which the strip can be meshed.
    """
    across, along = (factor * count for count in QUADS[strip])
    if strip == "bias":
        return {"across": max(2, 2 * round(across / 2)), "along": max(3, round(along))}
    return {"across": max(1, round(across)), "along": max(1, round(along))}


def _equal(gauge_length: float, final_length: float, increments: int) -> tuple[float, ...]:
    """Return equal increments of the elongation (mm), from the gauge's length to its final one."""
    if not final_length > gauge_length:
        raise InputError(
            None, "final_length", f"expected more than {gauge_length} mm, got {final_length}"
        )
    return tuple(np.linspace(0.0, final_length - gauge_length, increments + 1)[1:].tolist())


#: Side of the square patch in mm; results do not depend on it.
SIDE = 100.0
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
SQUARE = Mesh(SIDE * CORNERS, np.array([[0, 1, 2, 3]]), {})
#: Supports of the patch: the edges x = 0 and y = 0 stay in their lines.
ROLLERS_PATCH: Mapping[str, tuple[int, ...]] = {"symmetry_x": (0,), "symmetry_y": (1,)}
#: Node sets of the edges that are pulled, along x and along y.
PULLED = ("right", "top")
#: The corner whose displacement over the side is the strain of the patch.
FAR_CORNER = 2


@dataclass(frozen=True, eq=False)
class PatchModel(WithThicknessParameter):
    """A square patch under biaxial loads, with the warp along x.

    Attributes
    ----------
    loads : (n, 2) array
        N/mm along warp and fill, per undeformed width.
    thickness : float, mm
    """

    loads: Array
    thickness: float

    def __post_init__(self) -> None:
        self.check_thickness()
        object.__setattr__(self, "loads", np.array(self.loads, dtype=float))

    @cached_property
    def mesh(self) -> Mesh:
        sets = {"symmetry_x": [0, 3], "symmetry_y": [0, 1], "right": [1, 2], "top": [2, 3]}
        return replace(SQUARE, node_sets={name: np.array(nodes) for name, nodes in sets.items()})

    def displacements(self, elongation: ArrayLike) -> Array:
        """Return the displacements (n, 4, 3) mm of the corners.

        Parameters
        ----------
        elongation : (n, 2) array_like
            Engineering strains along warp and fill.
        """
        e = np.asarray(elongation, dtype=float)
        displacement = np.zeros((len(e), 4, 3))
        displacement[:, :, :2] = self.mesh.points[:, :2] * e[:, None, :]
        return displacement


def elongations(displacement: ArrayLike) -> Array:
    """Return the engineering strains (n, 2, ...) along warp and fill of a patch.

    Parameters
    ----------
    displacement : (n, 4, 3, ...) array_like, mm
        Of its corners.
    """
    return np.asarray(displacement, dtype=float)[:, FAR_CORNER, :2] / SIDE


@dataclass(frozen=True, eq=False)
class TubeModel(WithThicknessParameter):
    """The homogeneous wall of a long, closed, inflated tube in tension and torsion.

    It is a square patch with x and the warp along the tube, and y around it.

    Attributes
    ----------
    loads : (n, 3) ndarray
        Gauge pressure in MPa; axial force in N, in addition to that of the pressure on the ends;
        torque in N mm.
    radius, thickness : float, mm
        Of the undeformed tube.
    """

    loads: Array
    radius: float
    thickness: float

    def __post_init__(self) -> None:
        self.check_thickness()
        object.__setattr__(self, "loads", np.array(self.loads, dtype=float))

    mesh: ClassVar[Mesh] = SQUARE

    def strains(self, displacement: ArrayLike) -> Array:
        """Return the strains (n, 3) of the tube: axial, hoop and shear.

        They are the relative changes of length and of radius, and the undeformed radius times the
        twist per undeformed length.

        Parameters
        ----------
        displacement : (n, 4, 3) array_like, mm
            Of the patch's corners.
        """
        u = np.asarray(displacement, dtype=float) / SIDE
        along = u[:, 1, 0]
        across = u[:, 3, 1]
        shear = u[:, 1, 1] / (1.0 + across)
        return np.stack([along, across, shear], axis=1)

    def strain_slopes(self, displacement: ArrayLike, slope: ArrayLike) -> Array:
        """Return the derivatives (n, 3, parameters) of `strains`.

        Parameters
        ----------
        displacement : (n, 4, 3) array, mm
        slope : (n, 4, 3, parameters) array_like
            Its derivatives.
        """
        u, du = (np.asarray(a, dtype=float) / SIDE for a in (displacement, slope))
        hoop = 1.0 + u[:, 3, 1, None]
        twist = du[:, 1, 1] / hoop - u[:, 1, 1, None] * du[:, 3, 1] / hoop**2
        return np.stack([du[:, 1, 0], du[:, 3, 1], twist], axis=1)
