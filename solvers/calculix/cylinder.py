"""Analysis of the inflated and bent cylinder in CalculiX: solids, decks, gas and results.

The wall is one layer of solids, and a second layer, twice as thick, lies on the outside of the
seam; if it lay inside, the gas would not load its edges, and the cylinder would bend. Shells are
not used, as CalculiX ties the rotations of shells that meet at an angle, and Newton's method then
stalls with contact.

In the step of bending, time is the motion of the collar in mm, after a pause (`BendingStep.pause`).
CalculiX has no enclosed gas: `analyse` repeats the run with corrected pressures over the motion.
"""

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.cylinder_model import SEAM_LAYERS, ClosedGas, CylinderModel
from ...meshes.mesh import Array, Numbers
from ...notes import Note, NoteKind
from .. import prescribed
from ..base import EARLY, History, extremes, log_strain
from ..prescribed import ABOVE, volumes
from .deck import CalculixRun, Converged, Setup, deck_files, warp_angle
from .frd import FrdFile
from .library import constants
from .sheets import ROUNDING, whole_times

GAS = NoteKind("gas")

log = logging.getLogger(__name__)

#: Solid element with incompatible modes, without which flat solids lock.
ELEMENT = "C3D8I"


@dataclass(frozen=True)
class InflationStep:
    """Settings of the step in which a cylinder is inflated."""

    #: Largest relative residual force and correction, smaller than CalculiX' defaults.
    tolerances: tuple[float, float] = (1e-4, 1e-3)
    #: First and smallest increment, as shares of an increment of the law; they are small because
    #: flat caps at first resist the pressure by bending only.
    first: float = 0.1
    smallest: float = 1e-5
    max_increments: int = 1000
    #: Newton's method gets more iterations than CalculiX gives it by default: contact needs them.
    time_incrementation: str = "6, 10, 9, 30, 14, 6, , 8"


@dataclass(frozen=True)
class BendingStep:
    """Settings of the step in which the collar moves; its time is the collar's way in mm."""

    #: Largest residual force and correction: enough, since the load is a sum over many nodes.
    tolerances: tuple[float, float] = (5e-3, 1e-2)
    #: Contact, MPa/mm, as the membrane solver's; what others give: docs/how-to/calculix.md.
    stiffness: float = 5.0
    pause: float = 1.5  #: time that the collar stands still
    first: float = 1.0  #: first increment, which must end before it moves
    longest: float = 5.0  #: mm, longest increment; its effect: docs/how-to/calculix.md
    smallest: float = 1e-4  #: mm, at which contact is given up


@dataclass(frozen=True)
class GasPasses:
    """Settings of the passes that find the pressure of the gas.

    Each is a run at pressures that are corrected by the volumes of the previous one.
    """

    max_passes: int = 4
    #: Largest difference between the pressures of the gas and the deck, over absolute pressure.
    tolerance: float = 3e-4


INFLATION = InflationStep()
BENDING = BendingStep()
GAS_PASSES = GasPasses()


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """A mesh of solids of eight nodes, for a wall that is given by its middle surface.

    Attributes
    ----------
    points : (n, 3) ndarray, mm
    elements : (m, 8) ndarray of int
        Nodes, numbered from 0, of the inner face and then the outer face. The inner layer comes
        first, quad by quad, then the second layer on the seam.
    inner, outer : ndarray of int
        For each node of the surface mesh, the two nodes of the inner layer whose mean represents
        it.
    element_sets : mapping
        `tube`, `caps`, `inside` (elements whose inner faces enclose the gas) and `outside`
        (elements whose outer faces are the outside of the cylinder).
    node_sets : mapping
        Sets of the surface mesh, through the thickness.
    """

    points: Array
    elements: Numbers
    inner: Numbers
    outer: Numbers
    element_sets: Mapping[str, Numbers]
    node_sets: Mapping[str, Numbers]

    def middle(self, values: Array) -> Array:
        """Return values at the nodes of the surface mesh, (..., nodes, k).

        Parameters
        ----------
        values : array
            At the nodes of the solids, (..., n, k).
        """
        return 0.5 * (values[..., self.inner, :] + values[..., self.outer, :])


def solid_mesh(model: CylinderModel) -> SolidMesh:
    """Return the solids on both sides of a cylinder's middle surface.

    InputError if the wall does not have one thickness, and `SEAM_LAYERS` times that in the seam.
    """
    mesh = model.mesh
    count = len(mesh.points)
    quads = np.asarray(mesh.quads)
    numbers = np.arange(len(quads))
    seam = np.asarray(mesh.element_sets.get("seam", np.empty(0)), dtype=np.intp)
    caps = np.asarray(mesh.element_sets["caps"])
    layer = model.thickness[np.setdiff1d(numbers, seam)][0]
    layers = np.where(np.isin(numbers, seam), float(SEAM_LAYERS), 1.0)
    if not np.allclose(model.thickness, layer * layers, rtol=1e-9):
        problem = f"expected one thickness, and {SEAM_LAYERS} times that in the seam, on CalculiX"
        raise InputError(None, "thickness", problem)

    outward = _outward(mesh.points, quads, caps)
    on_seam = np.unique(quads[seam])
    inner = np.arange(count)
    outer = count + np.arange(count)
    last = np.full(count, -1)
    last[on_seam] = 2 * count + np.arange(len(on_seam))
    middle = np.asarray(mesh.points, float)
    out = layer * outward
    outermost = middle[on_seam] + (SEAM_LAYERS - 0.5) * out[on_seam]
    points = np.concatenate([middle - 0.5 * out, middle + 0.5 * out, outermost])
    base = np.concatenate([inner[quads], outer[quads]], axis=1)
    upon = np.concatenate([outer[quads[seam]], last[quads[seam]]], axis=1)
    elements = np.concatenate([base, upon])
    outer_nodes = numbers.copy()
    outer_nodes[seam] = len(quads) + np.arange(len(seam))
    tube = np.setdiff1d(np.arange(len(elements)), caps)
    sets = {"tube": tube, "caps": caps, "inside": numbers, "outside": outer_nodes}
    through = np.stack([inner, outer, last])
    node_sets = {
        name: np.unique(through[:, nodes][through[:, nodes] >= 0])
        for name, nodes in mesh.node_sets.items()
    }
    return SolidMesh(
        points,
        elements,
        inner,
        outer,
        sets,
        node_sets,
    )


def _outward(points: Array, quads: Numbers, caps: Numbers) -> Array:
    """Return the outward unit normals (n, 3) at the nodes; on a cap's rim, the sum of both.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (q, 4) array of int
    caps : (c,) array of int
        Numbers of the quads of the caps.
    """
    tube = np.unique(np.delete(quads, caps, axis=0))
    cap = np.unique(quads[caps])
    outward = np.zeros_like(points, dtype=float)
    radial = points[tube, :2]
    outward[tube, :2] = radial / np.linalg.norm(radial, axis=1)[:, None]
    outward[cap, 2] = np.sign(points[cap, 2])
    return outward


def cylinder_decks(
    model: CylinderModel,
    law: HypoelasticLaw,
    solids: SolidMesh,
    bending: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> dict[str, str]:
    """Return the text of each input file by name; InputError if a template cannot be used.

    Parameters
    ----------
    bending : mapping or None
        From `bending_context`; None for inflation alone.
    folder : Path or None
        The user's templates.
    """
    # The plane of the caps is xy, where the warp runs along x or y.
    angle = warp_angle(model.mesh, np.asarray(model.mesh.warp), solids.element_sets["caps"][0])
    inflation_steps = len(model.inflation)
    tube = constants(law, normal_axis=1, whole_until=inflation_steps)
    caps = constants(law, angle=angle, whole_until=inflation_steps)
    context: dict[str, Any] = {
        "sections": [
            {"set": "TUBE", "constants": tube, "around": True},
            {"set": "CAPS", "constants": caps, "around": False},
        ],
        "supports": [
            {"set": name.upper(), "dof": direction + 1}
            for name, directions in model.guides.items()
            for direction in directions
        ],
        "inflation": list(model.inflation),
        "bending": bending,
        "first": INFLATION.first,
        "least": INFLATION.smallest,
        "most_increments": INFLATION.max_increments,
        "time_incrementation": INFLATION.time_incrementation,
    }
    tolerances = INFLATION.tolerances
    return deck_files(
        "cylinder.inp.j2",
        "Cylinder",
        solids,
        ELEMENT,
        tolerances,
        context,
        folder,
    )


#: Gauge pressure of the gas by the deflection: increasing deflections (n,) mm, and pressures (n,)
#: MPa there, which are constant beyond both ends.
GasCurve = tuple[Array, Array]


def compliance(pressures: Array, volumes: Array) -> float:
    """Return the compliance dV/dp (mm^3/MPa) of the cylinder at the end of inflation.

    Parameters
    ----------
    pressures, volumes : array
        During inflation, (n,) MPa and mm^3, n > 1.
    """
    order: Literal[1, 2] = 2 if len(volumes) > 2 else 1
    return float(np.gradient(volumes, pressures, edge_order=order)[-1])


def gas_pressure(gas: ClosedGas, volumes: Array) -> Array:
    """Return the gauge pressure (n,) MPa of the gas in volumes (n,) mm^3."""
    return np.array([gas.pressure(v) for v in volumes])


def better_pressure(
    gas: ClosedGas,
    volumes: Array,
    pressures: Array,
    slope: float,
) -> Array:
    """Return pressures (n,) MPa for the next pass, by Newton's method on gas(V(p)) = p.

    Parameters
    ----------
    gas : ClosedGas
    volumes, pressures : (n,) array
        Volumes (mm^3) of the last pass, and the pressures (MPa) that it prescribed.
    slope : float
        dV/dp in mm^3/MPa of the inflated cylinder, taken at any deflection.
    """
    stiffness = np.array([gas.stiffness(v) for v in volumes])
    return pressures + (gas_pressure(gas, volumes) - pressures) / (1.0 + stiffness * slope)


def bending_context(
    model: CylinderModel,
    solids: SolidMesh,
    inflated: Array,
    gas: GasCurve | None = None,
) -> dict[str, Any]:
    """Return the variables of the template for step 2, the bending.

    Parameters
    ----------
    inflated : array
        Displacement of the solids' nodes after inflation, (n, 3) mm.
    gas : GasCurve or None
        Constant pressure unless given.

    Raises
    ------
    InputError
        If the whole cylinder is meshed instead of a quarter.
    """
    under = solids.node_sets["support_bottom"]
    bodies = prescribed.bodies(model, solids.points + inflated, under, "CalculiX")
    mesh = model.mesh
    is_tube = ~np.isin(np.arange(len(mesh.quads)), mesh.element_sets["caps"])
    # Contact is not looked for everywhere.
    may_touch = prescribed.may_touch(model, mesh.points[mesh.quads].mean(axis=1))
    # Of each body: how many nodes and elements come before its own, which the template numbers from
    # 1 on; "elements" and "fabric" (the wall's elements that it may touch) are numbers from 1.
    listed = []
    nodes_before = len(solids.points)
    elements_before = len(solids.elements)
    names = ("SUPPORT_BODY", "COLLAR_BODY")
    for name, body, touches in zip(names, bodies, may_touch, strict=True):
        listed.append(
            {
                "name": name,
                "points": body.points.tolist(),
                "elements": (body.elements + 1 + nodes_before).tolist(),
                "first_node": nodes_before,
                "first_element": elements_before,
                "fabric": (solids.element_sets["outside"][is_tube & touches] + 1).tolist(),
            }
        )
        nodes_before = nodes_before + len(body.points)
        elements_before = elements_before + len(body.elements)
    travel = ABOVE + model.deflections[-1]
    gas = gas or (np.zeros(1), np.full(1, model.pressure))
    touch = BENDING.pause + ABOVE
    pressures = [(0.0, model.pressure), (touch, model.pressure)]
    for deflection, pressure in zip(*gas, strict=True):
        if deflection > 0:  # before, the collar is not on the cylinder
            pressures.append((touch + float(deflection), float(pressure)))
    end = BENDING.pause + travel
    largest_step = np.diff(model.increments, prepend=0.0).max()
    return {
        "bodies": listed,
        "stiffness": BENDING.stiffness,
        # (time, travel of the collar); after the pause, time is travel.
        "path": [[0.0, 0.0], [BENDING.pause, 0.0], [end, travel]],
        "pressures": pressures,
        "first": BENDING.first,
        "least": BENDING.smallest,
        "longest": min(BENDING.longest, largest_step),
        "duration": end,
        "force_tolerance": BENDING.tolerances[0],
        "correction_tolerance": BENDING.tolerances[1],
    }


def body_nodes(solids: int) -> tuple[slice, slice]:
    """Return the ranges of the nodes of support and collar in a result.

    Parameters
    ----------
    solids : int
        Number of nodes of the solids, which come first.
    """
    around, across = prescribed.CONTACT.support_counts
    support = 2 * (around + 1) * (across + 1)
    return slice(solids, solids + support), slice(solids + support, None)


@dataclass(frozen=True, eq=False)
class BentCylinder:
    """Results of a bending: the inflated state, then every converged increment.

    Parameters
    ----------
    deflection : (n,) array, mm
        Motion of the collar since it touched the inflated cylinder.
    displacement : (n, nodes, 3) array, mm
        Displacement of the middle surface.
    reactions : dict of (n, 3) arrays, N
        Forces on the whole cylinder by the name of the body.
    volume : (n,) array, mm^3
        Volume of the whole cylinder.
    iterations : int
        Number of iterations of the run.
    stopped : bool
        Whether the run stopped early.
    reason : str
        Why it did.
    """

    deflection: Array
    displacement: Array
    reactions: Mapping[str, Array]
    volume: Array
    iterations: int
    stopped: bool
    reason: str = ""


class BendingFrames:
    """Reader of the frames of bending in a result file; see `bent_cylinder`."""

    def __init__(self, model: CylinderModel, solids: SolidMesh) -> None:
        self.model = model
        self.solids = solids
        self.support, self.collar = body_nodes(len(solids.points))
        self.deflections: list[float] = []
        self.shapes: list[Array] = []
        self.forces: dict[str, list[Array]] = {"supports": [], "collar": []}

    def read(self, path: Path, converged: Collection[tuple[int, int]] | None) -> str:
        """Read the converged frames; return what is wrong with the file, or "".

        Parameters
        ----------
        converged
            See `bent_cylinder`.
        """
        inflated = float(len(self.model.inflation))
        try:
            for frame in FrdFile(path).frames(converged is None):
                # A run that fails adds a frame of its best guess and residuals: not a result.
                if converged is not None and (frame.step, frame.increment) not in converged:
                    continue
                has_fields = {"DISP", "FORC"} <= frame.fields.keys()
                if has_fields and frame.time >= inflated - ROUNDING:
                    self._add(frame.step, frame.fields["DISP"], frame.fields["FORC"])
        except InputError as error:
            return str(error)
        return ""

    def _add(self, step: int, displacement: Array, force: Array) -> None:
        """Add a frame in which the collar lies on the cylinder: deflection, shape and forces.

        Parameters
        ----------
        step : int
            Number of the step of the deck.
        displacement, force : (nodes, 3) array, mm and N
            At all nodes of the deck.
        """
        deflection = -displacement[self.collar, 1].mean() - ABOVE
        if step > 1 and deflection <= 0:
            return  # not on the cylinder yet
        self.deflections.append(max(deflection, 0.0))
        self.shapes.append(self.solids.middle(displacement[: len(self.solids.points)]))
        # What holds the bodies in place is what the cylinder does to them, turned round. Along
        # x and z a quarter's forces cancel against those of the other quarters.
        for name, nodes in (("supports", self.support), ("collar", self.collar)):
            upward = self.model.copies * force[nodes][:, 1].sum()
            self.forces[name].append(np.array([0.0, upward, 0.0]))


def bent_cylinder(
    model: CylinderModel,
    solids: SolidMesh,
    path: Path,
    iterations: int,
    converged: Converged | None = None,
    reason: str = "",
) -> BentCylinder:
    """Read the results of a bending from a result file.

    Parameters
    ----------
    model : CylinderModel
    solids : SolidMesh
        Of the deck.
    path : Path
    iterations : int
        Of the run.
    converged : collection of (int, int), optional
        Steps and increments that converged in a run that stopped early; None if it ended well.
    reason : str
        Why it stopped.

    Returns
    -------
    BentCylinder

    Raises
    ------
    SolverFailure
        If the file holds no bending, or not all of it after a run that ended well.
    """
    ended_well = converged is None
    frames = BendingFrames(model, solids)
    damage = frames.read(path, converged)
    last = model.deflections[-1]
    reached = frames.deflections[-1] if len(frames.deflections) > 1 else 0.0
    if not reached or (ended_well and (damage or reached < last * (1 - ROUNDING))):
        problem = damage or f"{path}: ends at {reached:g} of {last:g} mm of deflection"
        raise SolverFailure(f"no usable results: {problem}", "calculix")
    middle = np.ascontiguousarray(frames.shapes)
    reactions = {name: np.array(values) for name, values in frames.forces.items()}
    for values in reactions.values():
        values[0] = 0.0  # the bodies have no contact while the cylinder is inflated
    deflection = np.array(frames.deflections)
    volume = volumes(model, middle)
    return BentCylinder(
        deflection,
        middle,
        reactions,
        volume,
        iterations,
        not ended_well,
        reason,
    )


def bending_history(model: CylinderModel, bent: BentCylinder, gas: GasCurve) -> History:
    """Return the history of the inflated state and the reported deflections.

    Parameters
    ----------
    gas : GasCurve
        Pressures of the deck.

    Raises
    ------
    SolverFailure
        If the run stopped before the first deflection.
    """
    reached = bent.deflection[-1]
    reported = np.array([0.0, *model.deflections])
    reported = np.minimum(reported[reported <= reached * (1 + ROUNDING)], reached)
    if len(reported) < 2:
        problem = f"bending stopped at {reached:g} mm, before the first reported deflection"
        raise SolverFailure(problem, "calculix")
    interpolated = partial(_between, bent.deflection, positions=reported)
    reactions = {name: interpolated(values) for name, values in bent.reactions.items()}
    early = ""
    if bent.stopped:
        early = f"the run stopped early; the last increment is at {reached:.4g} mm"
        early += f": {bent.reason}" if bent.reason else ""
    return History(
        -reactions["collar"][:, 1],
        interpolated(bent.displacement),
        *extremes(log_strain(model.mesh, bent.displacement, model.mesh.warp)),
        reactions,
        cavity_pressure=np.interp(reported, *gas),
        cavity_volume=interpolated(bent.volume),
        iterations=bent.iterations,
        path=bent.displacement,
        remarks=(Note(EARLY, early),) if early else (),
        early=early if len(reported) <= len(model.deflections) else "",
    )


def _between(x: Array, values: Array, positions: Array) -> Array:
    """Interpolate values by cubics whose slopes come from the neighbours.

    This is linear in the values, so that forces in equilibrium stay so.

    Parameters
    ----------
    x, values : (n,) and (n, ...) arrays
        Places in rising order, and the values there.
    positions : (m,) array
        Places at which values (m, ...) are returned.
    """
    slopes = np.gradient(values, x, axis=0)
    return scipy.interpolate.CubicHermiteSpline(x, values, slopes, axis=0)(positions)


def _inflated_cylinder(
    model: CylinderModel,
    solids: SolidMesh,
    frd: Path,
    iterations: int,
) -> tuple[Array, Array]:
    """Return the displacement of the inflated solids, and the volumes during inflation.

    They are (n, 3) mm and (increments,) mm^3.
    """
    start = whole_times(frd, len(model.inflation), len(solids.points))[0]
    return start[-1], volumes(model, solids.middle(start))


def analyse(
    model: CylinderModel,
    law: HypoelasticLaw,
    setup: Setup,
    run: CalculixRun,
) -> History:
    """Inflate and bend a cylinder with a constant mass of gas, in passes at corrected pressures.

    The pressure in the history is that of the deck; a remark says how far it is from that of the
    gas. The history of a run that stops early ends there. SolverFailure if it does not reach the
    first deflection.
    """
    prescribed.without_cords(model, "CalculiX")
    solids = solid_mesh(model)
    folder = setup.templates

    decks = cylinder_decks(model, law, solids, folder=folder)
    inflated, inflated_volumes = run(decks, partial(_inflated_cylinder, model, solids))
    read_bending = partial(bent_cylinder, model, solids)
    # Volumes (mm^3) without pressure and at each pressure of the inflation give dV/dp.
    initial_volume = volumes(model, np.zeros((1, *model.mesh.points.shape)))
    pressures = np.array([0.0, *model.inflation])
    volume_slope = compliance(pressures, np.concatenate([initial_volume, inflated_volumes]))
    gas_curve = np.zeros(1), np.full(1, model.pressure)
    for number in range(1, GAS_PASSES.max_passes + 1):
        context = bending_context(model, solids, inflated, gas_curve)
        decks = cylinder_decks(model, law, solids, context, folder)
        bent: BentCylinder = run(decks, read_bending, read_bending)
        deck_pressure = np.interp(bent.deflection, *gas_curve)
        closed = model.gas.closed_in(model.pressure, bent.volume[0])
        gap = gas_pressure(closed, bent.volume) - deck_pressure
        largest_gap = np.abs(gap).max() / (model.pressure + model.gas.ambient)
        log.info("pass %d to %.4g mm: p V within %.1e", number, bent.deflection[-1], largest_gap)
        if largest_gap <= GAS_PASSES.tolerance or number == GAS_PASSES.max_passes:
            break
        gas_curve = (
            bent.deflection,
            better_pressure(closed, bent.volume, deck_pressure, volume_slope),
        )
    history = bending_history(model, bent, gas_curve)
    rise = 1e3 * (np.interp(bent.deflection, *gas_curve)[-1] - model.pressure)
    words = f"gas: pass {number}, p V constant within {largest_gap:.1e} "
    words += f"(wanted: {GAS_PASSES.tolerance:g}), pressure {rise:+.3g} kPa at the end"
    return replace(history, remarks=(*history.remarks, Note(GAS, words)))
