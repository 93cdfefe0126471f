"""The bent inflated beam as a whole, mirrored from the part that is meshed: picture and file."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ....experiments.cylinder.run import BendingRun, Model
from ....meshes.beam_model import BeamModel
from ....meshes.cylinder_model import CylinderModel
from ....meshes.mesh import Mesh, surface_strain, with_mirror_image
from ....solvers.base import Array
from ...beam_charts import BeamBodies, beam_charts
from ...maps import write_vtu
from ...vega import save

#: Node sets that the picture draws as lines.
DRAWN_LINES = ("mid_span", "top_line", "bottom_line")


class WholeBeam(NamedTuple):
    """The whole cylinder, inflated and bent.

    Attributes
    ----------
    mesh : Mesh
        Mesh at rest, mm, with the direction of the warp.
    inflated, bent : (nodes, 3) array
        Displacements of the nodes when inflated, and at the last deflection, mm.
    """

    mesh: Mesh
    inflated: Array
    bent: Array


def whole_beam(model: Model, run: BendingRun) -> WholeBeam:
    """Return the whole cylinder: the meshed part and its mirror images."""
    mesh = model.mesh
    assert mesh.warp is not None
    points = mesh.points
    quads = mesh.quads
    warp = mesh.warp
    displacements = [run.inflated, run.bent]
    number = np.arange(len(points))
    is_on_line = {name: np.isin(number, mesh.node_sets[name]) for name in DRAWN_LINES}
    for axis, name in ((0, "symmetry_x"), (2, "symmetry_z")):
        if name not in mesh.node_sets:
            continue
        mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
        count = len(points)
        points, quads, source = with_mirror_image(points, quads, axis)
        sign = np.where((np.arange(len(points)) < count)[:, None], 1.0, mirror)
        displacements = [u[source] * sign for u in displacements]
        warp = np.concatenate([warp, warp * mirror])
        is_on_line = {name: mask[source] for name, mask in is_on_line.items()}
    sets = {name: np.flatnonzero(mask) for name, mask in is_on_line.items()}
    return WholeBeam(Mesh(points, quads, sets, {}, warp), *displacements)


def bodies_of(model: Model, beam: WholeBeam, deflection: float) -> BeamBodies:
    """Return supports and collar where they touch the beam; straps lie on its axis.

    `deflection` : that of the collar from where it touches the inflated beam, mm.
    """
    if isinstance(model, BeamModel):
        return _rollers_and_straps(model, beam)
    return _supports_and_collars(model, beam, deflection)


def _rollers_and_straps(model: BeamModel, beam: WholeBeam) -> BeamBodies:
    """Return rollers and straps of a slender beam; a strap lies at the height of the bent axis."""
    radius = model.section.radius
    half_spacing = 0.5 * model.load_spacing
    half_span = 0.5 * model.supports.span
    roller_radius = 0.5 * model.supports.diameter
    # Nodes of a ring have the same z to within 0.001 mm.
    z, ring = np.unique(np.round(beam.mesh.points[:, 2], 3), return_inverse=True)
    # The axis is at the mean y of each ring of nodes.
    axis_height = np.bincount(ring, (beam.mesh.points + beam.bent)[:, 1]) / np.bincount(ring)
    strap_height = np.interp(half_spacing, z, axis_height)
    roller_height = -max(model.roller_below, radius + roller_radius)
    return BeamBodies(
        supports=((-half_span, roller_height), (half_span, roller_height)),
        support_radius=roller_radius,
        collar_height=strap_height,
        collar_radius=radius,
        collar_length=model.collar.length,
        collars=tuple(sorted({-half_spacing, half_spacing})),
    )


def _supports_and_collars(model: CylinderModel, beam: WholeBeam, deflection: float) -> BeamBodies:
    """Return supports, which touch the inflated cylinder from below, and the collar on its top.

    The collar is shown below its first contact by the deflection (mm).
    """
    position = beam.mesh.points + beam.inflated
    support_radius = 0.5 * model.supports.width
    half_span = 0.5 * model.supports.span
    distance = np.abs(np.abs(position[:, 2]) - half_span)
    is_over = distance < support_radius
    rise = np.sqrt(support_radius**2 - distance[is_over] ** 2)
    support_height = (position[is_over, 1] - rise).min()
    inner = 0.5 * model.collar.inner_diameter
    middle = 0.5 * model.collar.spacing
    is_along = np.abs(np.abs(position[:, 2]) - middle) <= 0.5 * model.collar.length
    is_inside = is_along & (np.abs(position[:, 0]) < inner)
    rise = np.sqrt(inner**2 - position[is_inside, 0] ** 2)
    collar_height = (position[is_inside, 1] - rise).max()
    return BeamBodies(
        supports=((-half_span, support_height), (half_span, support_height)),
        support_radius=support_radius,
        collar_height=collar_height - deflection,
        collar_radius=inner,
        collar_length=model.collar.length,
        collars=tuple(sorted({-middle, middle})),
    )


def draw_beam(model: Model, run: BendingRun, path: Path, title: str) -> None:
    """Draw the beam at its last deflection, and write the picture to `path`."""
    beam = whole_beam(model, run)
    points = beam.mesh.points
    sets = beam.mesh.node_sets
    ring, top, bottom = (sets[name] for name in DRAWN_LINES)
    ring = ring[np.argsort(np.arctan2(points[ring, 0], points[ring, 1]))]
    ring = np.append(ring, ring[0])
    top, bottom = (nodes[np.argsort(points[nodes, 2])] for nodes in (top, bottom))
    outline = np.concatenate([top, bottom[::-1], top[:1]])
    inflated = points + beam.inflated
    bent = points + beam.bent
    warp_strain = surface_strain(beam.mesh, beam.bent)[:, 0]  # the warp runs along the axis
    inflated_outline = inflated[outline][:, [2, 1]]
    sections = inflated[ring, :2], bent[ring, :2]
    charts = beam_charts(
        bent,
        beam.mesh.quads,
        warp_strain,
        inflated_outline,
        sections,
        bodies_of(model, beam, run.deflection[-1]),
        title,
    )
    save(path, charts)


def write_beam(model: Model, run: BendingRun, path: Path) -> None:
    """Write the beam at its last deflection for ParaView, with the inflated beam as a field."""
    beam = whole_beam(model, run)
    strains = {
        "log_strain_1_2_12": surface_strain(beam.mesh, beam.bent),
        "inflated_log_strain_1_2_12": surface_strain(beam.mesh, beam.inflated),
    }
    write_vtu(beam.mesh, beam.bent, path, {"inflated_displacement": beam.inflated}, strains)
