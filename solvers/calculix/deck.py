"""Parts that the CalculiX decks of all models share: shells, material, control of iterations."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import SolverFailure
from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import rim_form, rim_share
from ...meshes.mesh import Array, Mesh, fabric_frames
from ...notes import Note, NoteKind
from ...version import __version__
from ..decks import render
from .library import MATERIAL, STATE_VARIABLES

TILT = NoteKind("tilted sheet")

Element = Literal["S4", "S8R"]
ELEMENTS: tuple[Element, ...] = ("S8R", "S4")


@dataclass(frozen=True, eq=False)
class ShellMesh:
    """A mesh of shell elements, with numbers from 0.

    Attributes
    ----------
    points : (n, 3) array, mm
        Those of the surface mesh first.
    elements : (m, 4 or 8) array
    corners : int
        Number of nodes of the surface mesh.
    """

    points: NDArray[np.float64]
    elements: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    corners: int


def shell_mesh(mesh: Mesh, element: str) -> ShellMesh:
    """Return a surface mesh as S4 elements, or as S8R elements with midside nodes.

    Midside nodes of the rim are moved onto the ellipse of the rim.
    """
    points = np.asarray(mesh.points, float)
    quads = np.asarray(mesh.quads)
    if element == "S4":
        return ShellMesh(points, quads, mesh.node_sets, len(points))
    # Edge k of a quad joins corners k and k + 1: the order of S8R's midsides.
    following = np.roll(quads, -1, axis=1)
    ends = np.sort(np.stack([quads, following], axis=2), axis=2)
    edges, edge_of, used = np.unique(
        ends.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    midsides = points[edges].mean(axis=1)
    is_border_edge = used == 1
    sets = {}
    for name, nodes in mesh.node_sets.items():
        is_in_set = is_border_edge & np.isin(edges, nodes).all(axis=1)
        sets[name] = np.concatenate([nodes, len(points) + np.flatnonzero(is_in_set)])
        if name == "rim":
            form = rim_form(points[nodes, :2])
            midside_rows = np.flatnonzero(is_in_set)
            midsides[midside_rows, :2] /= rim_share(form, midsides[midside_rows, :2])[:, None]
    elements = np.concatenate([quads, len(points) + edge_of.reshape(quads.shape)], axis=1)
    return ShellMesh(np.concatenate([points, midsides]), elements, sets, len(points))


MESH_FILE = "mesh.inp"
#: Control of the increments, *CONTROLS, PARAMETERS=TIME INCREMENTATION: numbers of iterations after
#: which CalculiX judges convergence (8, 12), gives up (150: at large strains its symmetric tangent
#: converges slowly) and so on; increments are halved after divergence, and become four times as
#: long after two easy ones.
TIME_INCREMENTATION = "8, 12, 9, 150, 20, 4, , 10\n0.5, 0.5, 0.75, 0.85, , , 4"


def deck_files(
    deck: str,
    name: str,
    mesh: Any,
    element: str,
    tolerances: tuple[float, float],
    context: Mapping[str, Any],
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the text of the input files by name: `job.inp`, and the mesh.

    Parameters
    ----------
    deck : str
        Template of `job.inp`.
    name : str
        Name of the model, for the title.
    mesh : ShellMesh, or solids with `element_sets`
    element : str
        CalculiX' name of the element.
    tolerances : (float, float)
        Largest residual force over the mean force, and largest correction over the largest change.
    context : mapping
        Further variables of the template.
    folder : Path, optional
        Folder of the user's templates.

    Raises
    ------
    InputError
        If a template cannot be used.
    """
    element_sets = getattr(mesh, "element_sets", {})
    nodes = mesh.points.tolist()
    elements = (mesh.elements + 1).tolist()
    listed = {"element": element, "points": nodes, "elements": elements}
    for key, sets in (("node_sets", mesh.node_sets), ("element_sets", element_sets)):
        listed[key] = {
            name_of_set.upper(): (numbers + 1).tolist()
            for name_of_set, numbers in sets.items()
            if len(numbers)
        }
    kind, own_mesh = ("solids", "solids.inp.j2") if element_sets else ("shells", "mesh.inp.j2")
    common = {
        "version": __version__,
        "title": f"{name}, {len(elements)} {kind} {element}",
        "mesh_file": MESH_FILE,
        "mesh": listed,
        "material": MATERIAL,
        "state_variables": STATE_VARIABLES,
        "element": element,
        "force_tolerance": tolerances[0],
        "correction_tolerance": tolerances[1],
        "time_incrementation": TIME_INCREMENTATION,
    }
    # By our template where the user's decks do not have that of the mesh too.
    folder_of_mesh = folder if folder is not None and (folder / own_mesh).is_file() else None
    return {
        "job.inp": render("calculix", deck, {**common, **context}, folder),
        MESH_FILE: render("calculix", own_mesh, listed, folder_of_mesh),
    }


def supports_of(supports: Mapping[str, Sequence[int]]) -> list[dict[str, Any]]:
    """Return the node sets of supports with their directions, numbered from 1, for templates."""
    return [
        {"set": name.upper(), "dofs": [d + 1 for d in directions]}
        for name, directions in supports.items()
    ]


T = TypeVar("T")
#: Function that reads results, from the .frd file and the number of iterations.
Reader = Callable[[Path, int], T]
#: Step and increment of all that converged in a run that stopped early.
Converged = Collection[tuple[int, int]]
#: Function that reads the results of a run that stopped early, from the .frd file, the number of
#: iterations, what converged, and why the run stopped.
Rescue = Callable[[Path, int, Converged, str], T]


class CalculixRun(Protocol):
    """A function that runs CalculiX on input files, in a scratch folder of their own."""

    def __call__(
        self, files: Mapping[str, str | bytes], read: Reader[T], rescue: Rescue[T] | None = None
    ) -> T:
        """Run the files (text by name) and return what `read` returns for the results.

        Parameters
        ----------
        rescue
            Reads the results of a run that stopped early; without it, or if it fails, such a run
            raises SolverFailure.
        """


@dataclass(frozen=True)
class Setup:
    """Settings of decks.

    Attributes
    ----------
    element : str
        "S8R" or "S4".
    templates : Path or None
        Folder of the user's templates.
    shells : callable
        Makes the shells of a surface mesh.
    """

    element: str
    templates: Path | None
    shells: Callable[[Mesh], ShellMesh]


#: Natural coordinates of the nodes of a shell in the square [-1, 1]^2: corners, then midsides.
_NATURAL = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]], float)
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def pressure_forces(points: Array, elements: NDArray[np.intp], pressure: float) -> Array:
    """Return the nodal forces (n, 3) N of a pressure (MPa) along the normals of shells.

    Parameters
    ----------
    points : array
        Deformed nodes, (n, 3) mm.
    elements : (m, 4 or 8) array
    """
    forces = np.zeros_like(points)
    corner = points[elements]
    for a, wa in zip(_GAUSS, _WEIGHTS, strict=True):
        for b, wb in zip(_GAUSS, _WEIGHTS, strict=True):
            values, slopes = _shape(np.array([a, b]), elements.shape[1])
            base = np.einsum("in,mnk->imk", slopes, corner)
            normal = np.cross(base[0], base[1])  # its length is the area
            part = wa * wb * pressure * values[None, :, None] * normal[:, None, :]
            np.add.at(forces, elements, part)
    return forces


def _shape(x: Array, nodes: int) -> tuple[Array, Array]:
    """Return shape functions (nodes,) and their derivatives (2, nodes) at x (2,)."""
    s = _NATURAL[:4] * x
    values = 0.25 * (1 + s[:, 0]) * (1 + s[:, 1])
    slopes = 0.25 * np.stack([_NATURAL[:4, 0] * (1 + s[:, 1]), _NATURAL[:4, 1] * (1 + s[:, 0])])
    if nodes == 4:
        return values, slopes
    middle = np.empty(4)
    rise = np.empty((2, 4))
    for k, (u, v) in enumerate(_NATURAL[4:]):
        along = 0 if u == 0 else 1  # the coordinate that runs along the edge
        across = 1 - along
        sign = v if u == 0 else u
        middle[k] = 0.5 * (1 - x[along] ** 2) * (1 + sign * x[across])
        rise[along, k] = -x[along] * (1 + sign * x[across])
        rise[across, k] = 0.5 * sign * (1 - x[along] ** 2)
    # A midside takes half from each of the corners beside it.
    between = 0.5 * (np.eye(4) + np.roll(np.eye(4), 1, axis=0))  # corner x midside
    return (
        np.concatenate([values - between @ middle, middle]),
        np.concatenate([slopes - rise @ between.T, rise], axis=1),
    )


#: Time for which the rim rests at the start of a step in which it moves, and longest first
#: increment of such a step.
FIRST_OF_STEP = 0.01
#: Slope of a tilted shell at which its stiffness is 2 % too low.
STEEP = 0.1


def without_stress(shells: ShellMesh, model: BubbleModel) -> ShellMesh:
    """Return the shells at the stress-free positions of a bubble's sheet.

    Parameters
    ----------
    shells : ShellMesh
        On the reference surface.

    Raises
    ------
    SolverFailure
        For a sheet with a stress-free strain.
    """
    if model.strains or model.strain is not None:
        raise SolverFailure("takes no metric of the sheet, use the membrane", "calculix")
    warp, fill = model.slack
    return replace(shells, points=shells.points * (1.0 + warp, 1.0 + fill, 1.0))


def rim_paths(shells: ShellMesh, model: BubbleModel) -> list[dict[str, object]]:
    """Return the prescribed motion of the rim for the template: nothing if it does not move.

    Each entry has a node and a direction, from 1, and its path of pairs (time, displacement in mm).
    The rim rests in the first increment of a step (`FIRST_OF_STEP`), because CalculiX begins with a
    linear iteration, from which a membrane under pressure does not recover if the rim moves.
    SolverFailure for a mesh with lines of symmetry: CalculiX 2.20 crashes where a rim moves at
    shells that are held against rotation.
    """
    if model.rim_motion is None and not any(model.slack):
        return []
    if {"symmetry_x", "symmetry_y"} & set(shells.node_sets):
        problem = "takes a slack sheet, or a rim that moves, on the full disk only"
        raise SolverFailure(problem, "calculix")
    rim = shells.node_sets["rim"]
    back = shells.points - without_stress(shells, model).points
    times = [0.0]
    places = [np.zeros_like(back)]
    for i in range(len(model.increments)):
        displaced = back.copy()
        if model.rim_motion is not None:
            displaced += _with_midsides(shells, model, model.rim_motion[i])
        times += [i + FIRST_OF_STEP, i + 1.0]
        places += [places[-1], displaced]
    return [
        {
            "node": node + 1,
            "dof": axis + 1,
            "path": [(t, float(at[node, axis])) for t, at in zip(times, places, strict=True)],
        }
        for node in rim
        for axis in model.supports["rim"]
    ]


def _with_midsides(shells: ShellMesh, model: BubbleModel, motion: Array) -> Array:
    """Return (nodes, 3) mm: a midside of the rim moves as the middle of its two ends does.

    Parameters
    ----------
    motion : (rim nodes, 3) array, mm
        Displacement of the model's nodes on the rim.
    """
    displacement = np.zeros_like(shells.points)
    displacement[model.mesh.node_sets["rim"]] = motion
    if shells.elements.shape[1] == 8:
        ends = shells.elements[:, :4]
        displacement[shells.elements[:, 4:]] = 0.5 * (
            displacement[ends] + displacement[np.roll(ends, -1, axis=1)]
        )
    return displacement


def warp_angle(mesh: Mesh, warp: ArrayLike, element: int = 0) -> float:
    """Return the angle in degrees from x to the warp in an element that lies across z.

    Raises
    ------
    InputError
        The warp is zero, or normal to an element of the mesh.
    """
    fabric_frames(mesh, warp)
    x, y, _ = np.broadcast_to(warp, (len(mesh.quads), 3))[element]
    return math.degrees(math.atan2(y, x))


def tilt_remarks(shells: ShellMesh) -> tuple[Note, ...]:
    """Return a note where a slope s of the sheet, by 2 s^2, costs it over 2 % of its stiffness."""
    corner = shells.points[shells.elements[:, :4]]
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    horizontal = np.hypot(normal[:, 0], normal[:, 1])
    slope = (horizontal / np.abs(normal[:, 2])).max()
    if slope <= STEEP:
        return ()
    lower = f"the sheet's slopes of up to {slope:.2f} lower its stiffness there by up to"
    words = f"CalculiX takes warp and fill as x and y: {lower} {200 * slope**2:.1f} %"
    return (Note(TILT, words),)
