"""The whole beam of a run: mirrored where a part was meshed, with the rigid bodies in place."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...meshes.mesh import Mesh
from ...meshes.mirror import with_mirror_image
from ...meshes.strain import surface_strain
from ...models.cylinder import CylinderModel
from ...reports import BeamBodies, plot_beam, write_vtu
from .record import BendingRun

Array = NDArray[np.float64]

#: Node sets that the picture draws as lines.
LINES = ("mid_span", "top_line", "bottom_line")


@dataclass(frozen=True, eq=False)
class Beam:
    """The whole cylinder: mesh (mm, with warp), displacements when inflated and at the end."""

    mesh: Mesh
    inflated: Array
    bent: Array


def whole_beam(model: CylinderModel, run: BendingRun) -> Beam:
    """What was meshed and its mirror images."""
    mesh = model.mesh
    assert mesh.warp is not None
    points, quads, warp = mesh.points, mesh.quads, mesh.warp
    moves = [run.inflated, run.bent]
    number = np.arange(len(points))
    lines = {name: np.isin(number, mesh.node_sets[name]) for name in LINES}
    for axis, name in ((0, "symmetry_x"), (2, "symmetry_z")):
        if name not in mesh.node_sets:
            continue
        count = len(points)
        points, quads, source = with_mirror_image(points, quads, axis)
        sign = np.ones((len(points), 3))
        sign[count:, axis] = -1.0
        moves = [u[source] * sign for u in moves]
        turned = np.ones(3)
        turned[axis] = -1.0
        warp = np.concatenate([warp, warp * turned])
        lines = {name: line[source] for name, line in lines.items()}
    sets = {name: np.flatnonzero(line) for name, line in lines.items()}
    return Beam(Mesh(points, quads, sets, {}, warp), moves[0], moves[1])


def bodies_of(model: CylinderModel, beam: Beam, deflection: float) -> BeamBodies:
    """Supports and collar, brought to touch the inflated beam; the collar then goes down."""
    at = beam.mesh.points + beam.inflated
    radius, half = 0.5 * model.supports.diameter, 0.5 * model.supports.span
    beside = np.abs(np.abs(at[:, 2]) - half)
    near = beside < radius
    height = float((at[near, 1] - np.sqrt(radius**2 - beside[near] ** 2)).min())
    inner = 0.5 * model.collar.inner_diameter
    inside = (np.abs(at[:, 2]) <= 0.5 * model.collar.length) & (np.abs(at[:, 0]) < inner)
    top = float((at[inside, 1] - np.sqrt(inner**2 - at[inside, 0] ** 2)).max())
    return BeamBodies(
        ((-half, height), (half, height)), radius, top - deflection, inner, model.collar.length
    )


def draw_beam(model: CylinderModel, run: BendingRun, path: Path, title: str) -> None:
    """The picture of the last frame."""
    beam = whole_beam(model, run)
    rest, sets = beam.mesh.points, beam.mesh.node_sets
    nodes, top, bottom = (sets[name] for name in LINES)
    around = np.argsort(np.arctan2(rest[nodes, 0], rest[nodes, 1]))
    ring = np.append(nodes[around], nodes[around[0]])
    top, bottom = (line[np.argsort(rest[line, 2])] for line in (top, bottom))
    outline = np.concatenate([top, bottom[::-1], top[:1]])
    inflated, bent = beam.mesh.points + beam.inflated, beam.mesh.points + beam.bent
    plot_beam(
        path,
        bent,
        beam.mesh.quads,
        surface_strain(beam.mesh, beam.bent)[:, 0],
        inflated[outline][:, [2, 1]],
        (inflated[ring, :2], bent[ring, :2]),
        bodies_of(model, beam, float(run.deflection[-1])),
        title,
    )


def write_beam(model: CylinderModel, run: BendingRun, path: Path) -> None:
    """The last frame for ParaView, with the inflated one as a further displacement."""
    beam = whole_beam(model, run)
    write_vtu(
        beam.mesh,
        beam.bent,
        path,
        {"inflated_displacement": beam.inflated},
        {
            "log_strain_1_2_12": surface_strain(beam.mesh, beam.bent),
            "inflated_log_strain_1_2_12": surface_strain(beam.mesh, beam.inflated),
        },
    )
