"""From the post file of a bent cylinder to its `History`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...meshes.volume import enclosed_volume
from ...models.cylinder import CylinderModel
from ...notes import Note, NoteKind
from ..base import History
from ..strains import extremes, log_strain
from .cylinder import APPROACH
from .results import NO_REACTIONS, REACTION, by_time, displacements, whole_times

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

#: Nodal vector of contact forces; its name is from memory.
CONTACT = "Contact Normal Force"
#: Nodes that may touch a body: mm to either side of a support and beyond the collar's edge, and
#: how low or high they lie, in radii.
BESIDE_SUPPORT, BESIDE_COLLAR, LOW, HIGH = 80.0, 60.0, -0.35, 0.1
#: Part of the collar's force by which it may differ from the supports' before a remark says so.
UNBALANCED = 0.02


def inflated(path: Path, model: CylinderModel) -> Array:
    """Displacement (nodes, 3) mm at the end of inflation; SolverFailure as `whole_times`."""
    return displacements(whole_times(path, model.mesh, len(model.inflation)))[-1]


def cylinder_history(
    path: Path, model: CylinderModel, iterations: int, ended: bool = True
) -> History:
    """The inflated cylinder, then every reported deflection; `load` of the collar in N.

    The cavity's pressure is not in the file: it is that of a constant mass in the volume found.

    Parameters
    ----------
    ended : the run ended well. If not, the history ends with the last increment that the file
        holds whole, and a remark says so.

    Raises
    ------
    SolverFailure : the file is not there or damaged, holds no forces or no increment of bending;
        or the run ended and one is missing.
    """
    filled = len(model.inflation)
    wanted = {filled: 0.0} | {
        filled + APPROACH + 1 + int(i): d
        for i, d in zip(model.reported, model.deflections, strict=True)
    }
    try:
        found = by_time(path, model.mesh, ended)
    except InputError as error:
        raise SolverFailure(f"no usable results: {error}", "marc") from None
    times = [time for time in wanted if time in found]
    # An increment that is missing ends the history there.
    whole = list(wanted)[: len(times)] == times
    if len(times) < 2 or not whole or (ended and len(times) < len(wanted)):
        problem = f"{path}: holds {len(times)} of {len(wanted)} frames"
        raise SolverFailure(f"no usable results: {problem}", "marc")
    u = displacements([found[time] for time in times])
    forces, remarks = _forces(model, [found[time] for time in times])
    early = ""
    if len(times) < len(wanted):
        last = wanted[times[-1]]
        early = f"the run stopped early; the last increment is at {last:g} mm of deflection"
        remarks.append(Note(NoteKind.EARLY, early))
    mesh = model.mesh
    volume = model.copies * np.array([enclosed_volume(mesh.points + one, mesh.quads) for one in u])
    full = float(volume[0])
    gas = model.gas.closed_in(model.pressure, full)
    pressure = [gas.pressure(float(v)) for v in volume]
    return History(
        -forces["collar"][:, 1],
        u,
        *extremes(log_strain(mesh, u, mesh.warp)),
        forces,
        cavity_pressure=np.array(pressure),
        cavity_volume=volume,
        iterations=iterations,
        path=u,
        remarks=tuple(remarks),
        early=early,
    )


def may_touch(model: CylinderModel) -> dict[str, Numbers]:
    """Nodes of the tube that collar and supports may touch."""
    p, tube = model.mesh.points, np.ones(len(model.mesh.points), bool)
    # The rim where caps and tube meet is the tube's.
    caps = np.setdiff1d(model.mesh.node_sets["caps"], model.mesh.node_sets["ends"])
    tube[caps] = False
    radius, z = float(np.abs(p[:, 1]).max()), np.abs(p[:, 2])
    collar = tube & (z < 0.5 * model.collar.length + BESIDE_COLLAR) & (p[:, 1] > HIGH * radius)
    support = tube & (np.abs(z - 0.5 * model.supports.span) < BESIDE_SUPPORT)
    support &= p[:, 1] < LOW * radius
    return {"supports": np.flatnonzero(support), "collar": np.flatnonzero(collar)}


def _forces(
    model: CylinderModel, frames: list[dict[str, Array]]
) -> tuple[dict[str, Array], list[Note]]:
    """What the bodies do to the whole cylinder, (frames, 3) N, and what is to be said of it."""
    name = CONTACT if all(CONTACT in frame for frame in frames[1:]) else REACTION
    if any(name not in frame for frame in frames[1:]):
        raise SolverFailure(NO_REACTIONS, "marc")
    found = {body: np.zeros((len(frames), 3)) for body in ("supports", "collar")}
    for body, nodes in may_touch(model).items():
        # Along x and z the forces of a quarter cancel against those of the others. The inflated
        # cylinder has not touched the bodies yet.
        found[body][1:, 1] = [model.copies * frame[name][nodes, 1].sum() for frame in frames[1:]]
    words = (
        f"the collar's force is the sum of {name!r}, which is not confirmed (bubblefit docs marc)"
    )
    remarks = [Note(NoteKind.UNCONFIRMED, words)]
    collar, supports = found["collar"][-1, 1], found["supports"][-1, 1]
    if abs(collar + supports) > UNBALANCED * abs(collar):
        words = (
            f"collar ({-collar:.4g} N) and supports ({supports:.4g} N) do not balance at the end: "
            "see run 5 in `bubblefit docs marc`"
        )
        remarks.append(Note(NoteKind.UNBALANCED, words))
    return found, remarks
