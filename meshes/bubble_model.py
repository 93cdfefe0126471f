"""Models of the bubble test as plain data: a sheet held at its rim and inflated (thesis ch. 4)."""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass
from .closed_surfaces import GAUSS_VALUES
from .cylinder_model import ForceTable, has_same_force
from .mesh import Array, Mesh, keep_levels, places_of

THICKNESS = "thickness"


def changes_anything(names: Sequence[str], values: Mapping[str, float]) -> bool:
    """Return whether a parameter differs from zero; InputError for one not among `names`."""
    unknown = [name for name in values if name not in names]
    if unknown:
        raise InputError(None, "parameters", f"{unknown} not among {tuple(names)}")
    return any(values.values())


class WithThicknessParameter:
    """Base class of models, dataclasses, whose only parameter is their `thickness`."""

    def check_thickness(self) -> None:
        """Raise InputError unless the thickness, which a fit may have changed, is positive."""
        model: Any = self
        if not model.thickness > 0:
            raise InputError(None, "thickness", f"expected > 0 mm, got {model.thickness}")

    @property
    def parameters(self) -> tuple[str, ...]:
        return (THICKNESS,)

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Return the model with its thickness changed by the value of the parameter (mm)."""
        if not changes_anything(self.parameters, values):
            return self
        model: Any = self
        return replace(model, thickness=model.thickness + values[THICKNESS])


#: Supports of a bubble: the rim is pinned, and symmetry lines, if any, stay in their planes.
RIM_AND_SYMMETRY: Mapping[str, tuple[int, ...]] = {
    "rim": (0, 1, 2),
    "symmetry_x": (0,),
    "symmetry_y": (1,),
}
#: Parameters of the stress-free sheet: its relative excess length along warp and fill.
SLACK = ("slack_warp", "slack_fill")
#: Parameters of the clamped sheet: its tension along warp and fill before the test, N/mm.
TENSION = ("tension_warp", "tension_fill")
#: The angle, in radians, by which the yarns are turned in the plane, from x to y.
TURN = "turn"
PRESSURE_OFFSET = "pressure_offset"


@dataclass(frozen=True, eq=False)
class SheetCord:
    """A straight cord that is bonded to a sheet.

    Attributes
    ----------
    ends : (2, 2) ndarray, mm
        Coordinates x, y of both ends on the flat sheet.
    table : ForceTable
        Force of the cord by its strain.
    prestrain : float
        Strain of the cord on the sheet `BubbleModel.stress_free`; the sheet's `strain` does not
        change it.
    tension_only : bool
        Whether the cord is slack in compression.
    """

    ends: Array
    table: ForceTable
    prestrain: float = 0.0
    tension_only: bool = True
    bonded: ClassVar[bool] = True
    initial_force: ClassVar[None] = None

    def __post_init__(self) -> None:
        ends = np.array(self.ends, dtype=float)
        if ends.shape != (2, 2) or not 0 < np.ptp(ends, axis=0).max() < np.inf:
            problem = f"expected two places [x, y] apart, got {ends.tolist()}"
            raise InputError(None, "ends", problem)
        object.__setattr__(self, "ends", ends)

    def lies_in(self, axis: int) -> bool:
        """Return whether the cord lies in the plane of symmetry normal to x (axis 0) or y (1)."""
        return bool(np.abs(self.ends[:, axis]).max() <= ROUNDING * np.abs(self.ends).max())

    def mirrors(self, candidate: "SheetCord", axis: int) -> bool:
        """Return whether the cord is the mirror image of another one along x (axis 0) or y (1)."""
        image = candidate.ends * np.where(np.arange(2) == axis, -1.0, 1.0)
        tolerance = ROUNDING * np.abs(image).max()
        is_image = (np.abs(self.ends - ends).max() <= tolerance for ends in (image, image[::-1]))
        return any(is_image) and has_same_force(self, candidate)


ROUNDING = 1e-6  # relative tolerance of lengths


@dataclass(frozen=True, eq=False)
class BubbleModel:
    """A sheet, flat or with the initial shape of its mesh, that is inflated by follower pressure.

    Attributes
    ----------
    mesh : Mesh
        Reference surface: x along the warp (unless the mesh has another), y along the fill, z the
        initial height.
    thickness : float, mm
    pressures : sequence of float, MPa
        Pressures that are reported, the frames.
    increments : sequence of float, MPa
        Pressures at which the law's increments end; they contain every reported pressure, and are
        these unless given.
    supports : mapping of str to tuple of int
        Directions in which the displacement is zero, by node set.
    modes : mapping of str to (nodes,) ndarray, mm
        Fields of height, by the name of the parameter that adds them to the initial height.
    slack : (float, float)
        Relative excess length of the stress-free sheet along x and y over the mesh.
    strain : (nodes, 3) ndarray or None
        Further strain of the stress-free yarns (warp, fill, engineering shear) over the sheet
        `stress_free`; None for zero.
    strains : mapping of str to (nodes, 3) ndarray
        Fields of strain, by the name of the parameter that adds them to `strain`.
    rim_motion : (increments, rim nodes, 3) ndarray, mm, or None
        Prescribed displacement of the rim; None if it does not move.
    unloaded : bool
        Whether pressures may also fall, in a history with unloading.
    tension : (float, float)
        Force per width, N/mm, along x and y under which the sheet is clamped; it adds to `slack`.
    cords : sequence of SheetCord
        Cords on the whole sheet, also where only a quarter is meshed.
    """

    mesh: Mesh
    thickness: float
    pressures: Sequence[float]
    increments: Sequence[float] = ()
    supports: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: RIM_AND_SYMMETRY)
    modes: Mapping[str, Array] = field(default_factory=dict)
    slack: tuple[float, float] = (0.0, 0.0)
    strain: Array | None = None
    strains: Mapping[str, Array] = field(default_factory=dict)
    rim_motion: Array | None = None
    unloaded: bool = field(default=False, kw_only=True)
    tension: tuple[float, float] = field(default=(0.0, 0.0), kw_only=True)
    cords: Sequence[SheetCord] = field(default=(), kw_only=True)

    def __post_init__(self) -> None:
        steps = self.increments if len(self.increments) else self.pressures
        keep_levels(self, " MPa", self.unloaded, pressures=self.pressures, increments=steps)
        pressures = np.array(self.pressures)
        distance = np.abs(np.array(self.increments)[self.reported] - pressures)
        if (distance > 1e-9 * pressures).any():
            raise InputError(None, "increments", "must contain every reported pressure")
        if self.rim_motion is not None and (np.diff(self.increments) < 0).any():
            raise InputError(None, "rim_motion", "is of pressures that rise, and these fall")
        if not self.thickness > 0:
            raise InputError(None, "thickness", f"expected > 0 mm, got {self.thickness}")
        if not min(self.slack) > -1:
            raise InputError(None, "slack", f"expected shares above -1, got {self.slack}")
        for i, cord in enumerate(self.cords):
            for axis in self.halved:
                if not any(cord.mirrors(cord_beside, axis) for cord_beside in self.cords):
                    problem = f"a quarter needs the mirror image in {'xy'[axis]} = 0, too; "
                    raise InputError(None, f"cord[{i}].ends", problem + 'or symmetry = "full"')

    @property
    def halved(self) -> tuple[int, ...]:
        """Return the axes normal to the planes of symmetry: 0 for x, 1 for y."""
        return tuple(k for k in (0, 1) if f"symmetry_{'xy'[k]}" in self.mesh.node_sets)

    def up_to_frame(self, frame: int) -> Self:
        """Return the model of the same test up to one of its frames.

        Later increments need not be run where later frames are not matched.

        Parameters
        ----------
        frame : int
            Index of the frame.
        """
        end = int(self.reported[frame]) + 1
        motion = None if self.rim_motion is None else self.rim_motion[:end]
        levels = self.pressures[: frame + 1], self.increments[:end]
        return replace(self, pressures=levels[0], increments=levels[1], rim_motion=motion)

    @property
    def parameters(self) -> tuple[str, ...]:
        return (PRESSURE_OFFSET, THICKNESS, *SLACK, *TENSION, TURN, *self.modes, *self.strains)

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Return the model with `values` added to its `parameters`; itself where all are zero."""
        if not changes_anything(self.parameters, values):
            return self
        points = np.array(self.mesh.points, dtype=float)
        for name, mode in self.modes.items():
            points[:, 2] += values.get(name, 0.0) * mode
        strain = self.strain
        for name in self.strains.keys() & values.keys():
            previous = np.zeros_like(points) if strain is None else strain
            strain = previous + values[name] * self.strains[name]
        offset = values.get(PRESSURE_OFFSET, 0.0)
        warp, fill, *tension = (
            value + values.get(name, 0.0)
            for value, name in zip((*self.slack, *self.tension), (*SLACK, *TENSION), strict=True)
        )
        yarns = self.mesh.warp
        if turn := values.get(TURN, 0.0):
            x, y, z = np.eye(3)[0] if yarns is None else yarns.T
            cos = np.cos(turn)
            sin = np.sin(turn)
            rotated = [x * cos - y * sin, x * sin + y * cos, z]
            yarns = np.array(np.broadcast_to(np.stack(rotated, axis=-1), (len(self.mesh.quads), 3)))
        return replace(
            self,
            mesh=replace(self.mesh, points=points, warp=yarns),
            thickness=self.thickness + values.get(THICKNESS, 0.0),
            pressures=[p + offset for p in self.pressures],
            increments=[p + offset for p in self.increments],
            slack=(warp, fill),
            tension=(tension[0], tension[1]),
            strain=strain,
        )

    @property
    def stress_free(self) -> Array:
        """Return the positions (nodes, 3) mm at which the sheet is free of stress, by its slack."""
        warp, fill = self.slack
        return np.asarray(self.mesh.points * (1.0 + warp, 1.0 + fill, 1.0), dtype=float)

    @property
    def stretch(self) -> Array:
        """Return the stretch of the stress-free yarns over the sheet `stress_free`.

        It is a tensor at each Gauss point in axes along warp and fill, (quads, 4, 2, 2).
        """
        none = np.zeros((len(self.mesh.points), 3))
        return np.eye(2) + self.strain_tensor(none if self.strain is None else self.strain)

    def strain_tensor(self, strain: Array) -> Array:
        """Return nodal strains (nodes, 3) as tensors at the Gauss points, (quads, 4, 2, 2).

        Parameters
        ----------
        strain : array
            Warp, fill, engineering shear.
        """
        warp, fill, shear = np.moveaxis(GAUSS_VALUES @ strain[self.mesh.quads], -1, 0)
        return np.stack([warp, 0.5 * shear, 0.5 * shear, fill], axis=-1).reshape(*warp.shape, 2, 2)

    @property
    def yarn(self) -> Array:
        """Return the unit vector (3,) of the warp in the plane of the sheet."""
        return np.eye(3)[0] if self.mesh.warp is None else self.mesh.warp[0]

    def sheet_slope(self, name: str) -> tuple[Array, Array, Array, Array]:
        """Return the derivatives of the sheet by one of its parameters.

        They are those of the reference positions (nodes, 3), of `stress_free` (nodes, 3), of `yarn`
        (3,) and of `stretch` (quads, 4, 2, 2).
        """
        surface = np.zeros_like(self.mesh.points)
        sheet = np.zeros_like(self.mesh.points)
        yarn = np.zeros(3)
        if name == TURN:
            yarn = np.cross([0.0, 0.0, 1.0], self.yarn)
        elif name in self.modes:
            surface[:, 2] = sheet[:, 2] = self.modes[name]
        elif name in SLACK:
            axis = SLACK.index(name)
            sheet[:, axis] = self.mesh.points[:, axis]
        stretch = np.zeros((len(self.mesh.quads), 4, 2, 2))
        if name in self.strains:
            stretch = self.strain_tensor(self.strains[name])
        return surface, sheet, yarn, stretch

    def prescribed(self, pressure: float) -> Array:
        """Return the prescribed displacements (fixed,) mm of the unknowns `fixed`.

        Parameters
        ----------
        pressure : float, MPa
            Between whose neighbouring increments the rim's motion is interpolated.
        """
        values = np.zeros((len(self.mesh.points), 3))
        if self.rim_motion is not None:
            ends = np.array([0.0, *self.increments])
            motion = np.concatenate([np.zeros((1, *self.rim_motion.shape[1:])), self.rim_motion])
            k = int(np.clip(np.searchsorted(ends, pressure), 1, len(ends) - 1))
            share = (pressure - ends[k - 1]) / (ends[k] - ends[k - 1])
            values[self.mesh.node_sets["rim"]] = motion[k - 1] + share * (motion[k] - motion[k - 1])
            for name, directions in self.supports.items():
                if name != "rim" and name in self.mesh.node_sets:
                    for direction in directions:
                        values[self.mesh.node_sets[name], direction] = 0.0
        return values.reshape(-1)[self.fixed]

    @property
    def reported(self) -> NDArray[np.intp]:
        """Return the increments (frames,) that reach the pressures of the frames.

        With unloading, where pressures recur, frames are matched in order, each to the last
        increment possible.
        """
        if not self.unloaded:
            return places_of(self.pressures, self.increments)
        places = list[int]()
        end = len(self.increments)
        for pressure in self.pressures[::-1]:
            ends = np.array(self.increments[:end])
            matches = np.flatnonzero(np.isclose(ends, pressure, rtol=1e-9, atol=0.0))
            end = int(matches[-1]) if len(matches) else 0
            places.append(end)
        return np.array(places[::-1])

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Return the numbers (fixed,) of the unknowns that the supports hold."""
        return self.mesh.unknowns(self.supports)


@dataclass(frozen=True, eq=False)
class MeasuredShape(BubbleModel):
    """A bubble with measured displacements, whose distance from equilibrium a solver computes.

    Attributes
    ----------
    displacements : (pressures, nodes, 3) array, mm
        The measured displacements.
    fields : (3 nodes, k) array
        Virtual displacements, orthonormal and zero at unknowns that are held.
    """

    displacements: Array = None  # type: ignore[assignment]
    fields: Array = None  # type: ignore[assignment]

    @classmethod
    def of(cls, model: BubbleModel, displacements: Array, fields: Array) -> Self:
        """Return a measured shape with the sheet, supports and pressures of a model.

        Parameters
        ----------
        displacements, fields : array
            See the class. The law's increments end at the model's pressures.
        """
        measured = {
            "increments": (),
            "rim_motion": displacements[:, model.mesh.node_sets["rim"]],
            "displacements": displacements,
            "fields": fields,
        }
        return cls(**vars(model) | measured)


def default_increments(pressures: Sequence[float]) -> tuple[float, ...]:
    """Return increments (MPa) for a bubble: the pressures, with smaller first steps.

    These help Newton's method, which starts from a flat sheet without stiffness.
    """
    first, *later = pressures
    between = [first + (p - first) * 18.0 / 37.0 for p in later[:1] if p > 1.5 * first]
    return (first * 6.0 / 22.0, first, *between, *later)
