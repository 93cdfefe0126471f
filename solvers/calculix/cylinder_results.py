"""From the result file of a cylinder to its `History`."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import enclosed_volume
from ...notes import Note, NoteKind
from ..base import History, extremes, log_strain
from .bubble import NEAR, whole_times
from .cylinder import (
    ABOVE,
    GasCurve,
    SolidMesh,
    bending_context,
    better_pressure,
    body_nodes,
    compliance,
    cylinder_decks,
    gas_pressure,
    solid_mesh,
)
from .deck import Converged, Run, Setup
from .frd import FrdFile

Array = NDArray[np.float64]


def inflation_history(
    path: Path, model: CylinderModel, solids: SolidMesh, iterations: int
) -> History:
    """Inflation of a cylinder: a frame at every increment of pressure, `load` the gauge pressure.

    Displacements are those of the middle surface; the volume is the whole cylinder's inside it.

    Raises
    ------
    SolverFailure : the file is not there, damaged, or does not hold every increment.
    """
    displacement, _ = whole_times(path, len(model.inflation), len(solids.points))
    middle = np.ascontiguousarray(solids.middle(displacement))
    pressure = np.array(model.inflation)
    return History(
        pressure,
        middle,
        *extremes(log_strain(model.mesh, middle, model.mesh.warp)),
        cavity_pressure=pressure,
        cavity_volume=volumes(model, middle),
        iterations=iterations,
        path=middle,
    )


@dataclass(frozen=True, eq=False)
class BentCylinder:
    """The inflated state, then every increment of bending that converged.

    deflection (n,) mm that the collar has gone down since it met the inflated cylinder;
    displacement (n, nodes, 3) mm of the middle surface; forces of the cylinder's contacts on
    the whole (n, 3) N, `supports` and `collar`; volume (n,) mm^3 of the whole; iterations: those
    of the run; stopped: whether it ended early, and why.
    """

    deflection: Array
    displacement: Array
    reactions: Mapping[str, Array]
    volume: Array
    iterations: int
    stopped: bool
    why: str = ""


def bent_cylinder(
    path: Path,
    model: CylinderModel,
    solids: SolidMesh,
    iterations: int,
    converged: Collection[tuple[int, int]] | None = None,
    why: str = "",
) -> BentCylinder:
    """What the result file of a deck with both steps holds of bending.

    Parameters
    ----------
    converged : steps and increments that converged, of a run that stopped early. None: the run
        ended well.
    why : it stopped early.

    Raises
    ------
    SolverFailure : the file is not there or damaged, or holds nothing of bending; or the run
        ended and the last deflection is missing.
    """
    ended, inflated = converged is None, float(len(model.inflation))
    count = len(solids.points)
    support, collar = body_nodes(count)
    deflections, shapes = list[float](), list[Array]()
    forces: dict[str, list[Array]] = {"supports": [], "collar": []}
    damage = ""
    try:
        for frame in FrdFile(path).frames(ended):
            # A run that fails adds a frame of its best guess and residuals: not a result.
            if converged is not None and (frame.step, frame.increment) not in converged:
                continue
            if not {"DISP", "FORC"} <= frame.fields.keys() or frame.time < inflated - NEAR:
                continue
            moved, force = frame.fields["DISP"], frame.fields["FORC"]
            down = -float(moved[collar, 1].mean()) - ABOVE
            if frame.step > 1 and down <= 0:
                continue  # not on the cylinder yet
            deflections.append(max(down, 0.0))
            shapes.append(solids.middle(moved[:count]))
            # What holds the bodies in place is what the cylinder does to them, turned round.
            forces["supports"].append(_of_the_whole(model, force[support]))
            forces["collar"].append(_of_the_whole(model, force[collar]))
    except InputError as error:
        damage = str(error)
    last = model.deflections[-1]
    reached = deflections[-1] if len(deflections) > 1 else 0.0
    if not reached or (ended and (damage or reached < last * (1 - NEAR))):
        problem = damage or f"{path}: ends at {reached:g} of {last:g} mm of deflection"
        raise SolverFailure(f"no usable results: {problem}", "calculix")
    middle = np.ascontiguousarray(shapes)
    reactions = {name: np.array(values) for name, values in forces.items()}
    for values in reactions.values():
        values[0] = 0.0  # the bodies have no contact while the cylinder is inflated
    return BentCylinder(
        np.array(deflections),
        middle,
        reactions,
        volumes(model, middle),
        iterations,
        not ended,
        why,
    )


def bending_history(model: CylinderModel, bent: BentCylinder, gas: GasCurve) -> History:
    """Inflated state and reported deflections, between the increments by cubics; `load` in N.

    Parameters
    ----------
    gas : the pressure that the deck had.

    Raises
    ------
    SolverFailure : it stopped before the first reported deflection.
    """
    reached = float(bent.deflection[-1])
    wanted = np.array([0.0, *model.deflections])
    wanted = np.minimum(wanted[wanted <= reached * (1 + NEAR)], reached)
    if len(wanted) < 2:
        problem = f"bending stopped at {reached:g} mm, before the first reported deflection"
        raise SolverFailure(problem, "calculix")
    at = partial(_between, bent.deflection, wanted=wanted)
    reactions = {name: at(values) for name, values in bent.reactions.items()}
    early = ""
    if bent.stopped:
        early = f"the run stopped early; the last increment is at {reached:.4g} mm"
        early += f": {bent.why}" if bent.why else ""
    return History(
        -reactions["collar"][:, 1],
        at(bent.displacement),
        *extremes(log_strain(model.mesh, bent.displacement, model.mesh.warp)),
        reactions,
        cavity_pressure=gas.at(wanted),
        cavity_volume=at(bent.volume),
        iterations=bent.iterations,
        path=bent.displacement,
        remarks=(Note(NoteKind.EARLY, early),) if early else (),
        early=early if len(wanted) <= len(model.deflections) else "",
    )


def _between(x: Array, values: Array, wanted: Array) -> Array:
    """Values (n, ...) at x (n,), n > 1, at the `wanted` places.

    Cubics with slopes from neighbours only: linear in the values, so that forces in balance stay
    so, and what happens at one increment (a wrinkle) spreads no further than the next.
    """
    slopes = np.gradient(values, x, axis=0)
    return np.asarray(CubicHermiteSpline(x, values, slopes, axis=0)(wanted))


def volumes(model: CylinderModel, displacements: Array) -> Array:
    """(frames,) mm^3 inside the middle surface of the whole cylinder."""
    mesh = model.mesh
    inside = [enclosed_volume(mesh.points + u, mesh.quads) for u in displacements]
    return model.copies * np.array(inside)


def _of_the_whole(model: CylinderModel, force: Array) -> Array:
    """(3,) N: a quarter's forces along x and z cancel against those of the other quarters."""
    return np.array([0.0, model.copies * force[:, 1].sum(), 0.0])


log = logging.getLogger(__name__)

#: Most passes at the pressures that the last one's volumes give, and what may be left between the
#: gas and the deck, over absolute pressure: p V is constant to that.
PASSES, SETTLED = 4, 3e-4


def analyse(model: CylinderModel, law: HypoelasticLaw, setup: Setup, run: Run) -> History:
    """History of inflation and bending with a constant mass of gas.

    CalculiX knows no gas: the deck has its pressure over the collar's way, and the volumes found
    give that for the next pass. The history's is the one the deck had; a remark says how far it
    is from the gas'. A run that stops early is reported up to there.

    Raises
    ------
    SolverFailure : inflation did not end well, or bending not even its first reported deflection.
    """
    solids, folder = solid_mesh(model), setup.templates

    def blown(frd: Path, iterations: int) -> tuple[Array, Array]:
        start = whole_times(frd, len(model.inflation), len(solids.points))[0]
        return start[-1], volumes(model, solids.middle(start))

    def bent(
        frd: Path, iterations: int, stopped: Converged | None = None, why: str = ""
    ) -> BentCylinder:
        return bent_cylinder(frd, model, solids, iterations, stopped, why)

    start, filling = run(cylinder_decks(model, law, solids, folder=folder), blown)
    rest = volumes(model, np.zeros((1, *model.mesh.points.shape)))
    slope = compliance(np.array([0.0, *model.inflation]), np.concatenate([rest, filling]))
    gas = GasCurve(np.zeros(1), np.full(1, model.pressure))
    for number in range(1, PASSES + 1):
        context = bending_context(model, solids, start, gas)
        found: BentCylinder = run(cylinder_decks(model, law, solids, context, folder), bent, bent)
        given = gas.at(found.deflection)
        closed = model.gas.closed_in(model.pressure, float(found.volume[0]))
        gap = gas_pressure(closed, found.volume) - given
        left = float(np.abs(gap).max()) / (model.pressure + model.gas.ambient)
        log.info("pass %d to %.4g mm: p V within %.1e", number, found.deflection[-1], left)
        if left <= SETTLED or number == PASSES:
            break
        better = better_pressure(closed, found.volume, given, slope)
        gas = GasCurve(found.deflection, better)
    history = bending_history(model, found, gas)
    rise = 1e3 * (float(gas.at(found.deflection)[-1]) - model.pressure)
    words = f"gas: pass {number}, p V constant within {left:.1e} (wanted: {SETTLED:g}), "
    words += f"pressure {rise:+.3g} kPa at the end"
    return replace(history, remarks=(*history.remarks, Note(NoteKind.GAS, words)))
