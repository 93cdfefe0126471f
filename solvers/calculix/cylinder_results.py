"""From the result file of a cylinder to its `History`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...meshes.volume import enclosed_volume
from ...models.cylinder import CylinderModel
from ..base import History
from .cylinder_bending import WAITING, body_nodes
from .frd import FrdFile, FrdFrame
from .results import NEAR, extremes, log_strain, whole_times
from .solids import SolidMesh

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


def bending_history(
    path: Path,
    model: CylinderModel,
    solids: SolidMesh,
    pressures: Array,
    iterations: int,
    converged: Collection[tuple[int, int]] | None = None,
) -> History:
    """Bending: the inflated cylinder, then every reported deflection; `load` of the collar in N.

    Parameters
    ----------
    pressures : (increments,) MPa, gauge, that the deck had at every increment of bending.
    converged : steps and increments that converged, of a run that stopped early: the history then
        ends with the last of them, and a remark says so. None: the run ended well.

    Raises
    ------
    SolverFailure : the file is not there or damaged, or holds no increment of bending; or the run
        ended and one is missing.
    """
    ended, converged = converged is None, converged or ()
    count, start = len(solids.points), len(model.inflation)
    support, collar = body_nodes(count)
    wanted = {start: 0.0} | {
        start + WAITING + 1 + int(i): d
        for i, d in zip(model.reported, model.deflections, strict=True)
    }
    found: dict[int, tuple[Array, Array, Array]] = {}
    try:
        for frame in FrdFile(path).frames(ended):
            time = round(frame.time)
            # A run that fails adds a frame of its best guess and residuals: not a result.
            if not ended and (frame.step, frame.increment) not in converged:
                continue
            if time in wanted and abs(frame.time - time) < NEAR and _complete(frame):
                force = frame.fields["FORC"]
                found[time] = (
                    solids.middle(frame.fields["DISP"][:count]),
                    _of_the_whole(model, force[support]),
                    _of_the_whole(model, force[collar]),
                )
    except InputError as error:
        if ended or len(found) < 2:
            raise SolverFailure(f"no usable results: {error}", "calculix") from None
    times = [time for time in wanted if time in found]
    if len(times) < 2 or (ended and len(times) < len(wanted)):
        problem = f"{path}: holds {len(times)} of {len(wanted)} frames"
        raise SolverFailure(f"no usable results: {problem}", "calculix")
    middle = np.ascontiguousarray([found[time][0] for time in times])
    # What holds the bodies in place is what the cylinder does to them, turned round.
    reactions = {
        "supports": np.array([found[time][1] for time in times]),
        "collar": np.array([found[time][2] for time in times]),
    }
    remarks: tuple[str, ...] = ()
    if len(times) < len(wanted):
        last = wanted[times[-1]]
        remarks = (f"the run stopped early; the last increment is at {last:g} mm of deflection",)
    gauge = np.concatenate([[model.pressure], np.asarray(pressures)[model.reported]])
    return History(
        -reactions["collar"][:, 1],
        middle,
        *extremes(log_strain(model.mesh, middle, model.mesh.warp)),
        reactions,
        cavity_pressure=gauge[: len(times)],
        cavity_volume=volumes(model, middle),
        iterations=iterations,
        path=middle,
        remarks=remarks,
    )


def volumes(model: CylinderModel, displacements: Array) -> Array:
    """(frames,) mm^3 inside the middle surface of the whole cylinder."""
    mesh = model.mesh
    inside = [enclosed_volume(mesh.points + u, mesh.quads) for u in displacements]
    return model.copies * np.array(inside)


def _of_the_whole(model: CylinderModel, force: Array) -> Array:
    """(3,) N: a quarter's forces along x and z cancel against those of the other quarters."""
    return np.array([0.0, model.copies * force[:, 1].sum(), 0.0])


def _complete(frame: FrdFrame) -> bool:
    return {"DISP", "FORC"} <= frame.fields.keys()
