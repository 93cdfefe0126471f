"""Figures of bent cylinders: load over deflection, pressure of the gas, and the bent beams.

A beam is drawn and written as a whole, mirrored from the part that is meshed.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ....experiments.cylinder.measures import BendingRun, Model
from ....experiments.cylinder.predicted import CylinderOutcome
from ....experiments.cylinder.test import CylinderTest
from ....experiments.data_files import CaptionedFile, Output
from ....materials.card import BAND, LEVEL
from ....meshes.beam_model import BeamModel
from ....meshes.cylinder_model import CylinderModel
from ....meshes.mesh import Mesh, surface_strain, with_mirror_image
from ....readers.bending import scatter
from ....solvers.base import Array
from ...bending_charts import (
    COLLAR_DEFLECTION,
    BeamBodies,
    BendLine,
    BendPanel,
    beam_charts,
    bending_charts,
    gas_charts,
)
from ...charts import Charts
from ...maps import write_vtu
from ...vega import save

#: Folders of the output.
FIGURES = "figures"
BEAMS = "beams"


def draw_figures(outcome: CylinderOutcome, out: Output) -> list[CaptionedFile]:
    """Draw loads, gas and beam of every test, and the loads of all tests in one picture.

    Returns
    -------
    list of (str, str)
        Pictures that the page shows, with their captions.
    """
    tests = tests_of(outcome)
    names = file_names([test.name for test in tests])
    panels = {test.name: _panel(test, outcome) for test in tests}
    figures = []
    for test in tests:
        numbers = _predicted_runs(test, outcome)
        if not numbers:
            continue
        stem = f"{FIGURES}/{names[test.name]}"
        panel = panels[test.name]
        save(out.path(f"{stem}-load.png"), bending_charts([panel], misses=True, columns=1))
        save(out.path(f"{stem}-gas.png"), gas_charts(panel))
        first = outcome.runs[numbers[0]]
        run = outcome.bent[numbers[0]]
        title = f"{test.name}, {first.card}, {run.deflection[-1]:g} mm"
        draw_beam(first.model, run, out.path(f"{stem}-beam.png"), title)
        figures += [
            (out.name(f"{stem}-beam.png"), f"{test.name}: the bent beam, card {first.card}"),
            (out.name(f"{stem}-gas.png"), f"{test.name}: the gas while bending"),
        ]
    if sum(bool(panel.lines) for panel in panels.values()) > 1:
        rows = _rows_of_panels(tests)
        columns = max(map(len, rows))
        grid = [
            panels[row[k].name] if k < len(row) else BendPanel("")
            for row in rows
            for k in range(columns)
        ]
        save(out.path(f"{FIGURES}/all-loads.png"), bending_charts(grid, columns=columns))
    return figures


def _rows_of_panels(tests: Sequence[CylinderTest]) -> list[Sequence[CylinderTest]]:
    """Return the tests in rows of charts.

    Where several diameters are tested at several pressures each row has one diameter, else a row
    has three tests.
    """
    by_diameter: dict[float, list[CylinderTest]] = {}
    for test in tests:
        by_diameter.setdefault(round(test.diameter, 6), []).append(test)
    rows = list(by_diameter.values())
    if len(rows) == 1 or max(map(len, rows)) == 1:
        return [tests[i : i + 3] for i in range(0, len(tests), 3)]
    return list(rows)


def load_charts(outcome: CylinderOutcome) -> list[Charts]:
    """Return charts of load over deflection of every test; none where no run ended."""
    panels = [_panel(test, outcome) for test in tests_of(outcome)]
    if not any(panel.lines for panel in panels):
        return []
    caption = "Load over deflection"
    if len(outcome.band) > 1:
        predicted, *ends = (end.name for end in outcome.band)
        caption += f"; line: {predicted}, dashed: {', '.join(ends)}"
    if outcome.spreads:
        caption += f". Shaded: {panels[0].spread}"
    return [bending_charts(panels, caption)]


def write_beams(outcome: CylinderOutcome, out: Output) -> list[CaptionedFile]:
    """Write the last deflection of every run for ParaView; return the files' descriptions."""
    tests = file_names([test.name for test in tests_of(outcome)])
    cards = file_names(list(dict.fromkeys(run.card for run in outcome.runs)))
    files = []
    for i, bent in outcome.bent.items():
        run = outcome.runs[i]
        description = f"the beam at {bent.deflection[-1]:g} mm, for ParaView"
        wall = ""
        if not run.predicted:
            wall = f"-{file_names([run.wall])[run.wall]}"
            description += f" ({run.wall})"
        name = f"{BEAMS}/{tests[run.test.name]}-{cards[run.card]}{wall}.vtu"
        write_beam(run.model, bent, out.path(name))
        files.append((out.name(name), description))
    return files


def tests_of(outcome: CylinderOutcome) -> list[CylinderTest]:
    """Return the tests of the runs, each once."""
    return list({id(run.test): run.test for run in outcome.runs}.values())


def file_names(names: Sequence[str]) -> dict[str, str]:
    """Return a name for files, without suffix, for each name; no two are the same."""
    files: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        is_used = plain.casefold() in (file.casefold() for file in files.values())
        files[name] = f"{plain}-{number}" if is_used else plain
    return files


def _predicted_runs(test: CylinderTest, outcome: CylinderOutcome) -> list[int]:
    """Return the indices of a test's runs that are the prediction itself and did not fail."""
    runs = outcome.runs
    return [i for i in outcome.bent if runs[i].test is test and runs[i].predicted]


def _panel(test: CylinderTest, outcome: CylinderOutcome) -> BendPanel:
    """Return the content of a test's chart: curves of all cards, and what was measured."""
    cards = list(dict.fromkeys(run.card for run in outcome.runs))
    lines = []
    for i in _predicted_runs(test, outcome):
        run = outcome.bent[i]
        m = outcome.measures[i]
        card = outcome.runs[i].card
        other_number = outcome.other_end(i)
        other_end = None if other_number is None else outcome.bent[other_number]
        sigma = outcome.spreads.get(i)
        bend_line = BendLine(
            name=card,
            rank=cards.index(card),
            deflection=run.deflection,
            load=run.load,
            pressure=run.pressure,
            volume=run.volume,
            knee=m.knee,
            limit=m.limit,
            rms=None if m.error is None else m.error.rms,
            other_limit=None if other_end is None else (other_end.deflection, other_end.load),
            half_band=None if sigma is None or np.isnan(sigma).all() else BAND * sigma,
        )
        lines.append(bend_line)
    measured = None
    if test.measured:
        spread = scatter(test.measured)
        # The mean is drawn only where all repetitions have readings: elsewhere it would jump.
        is_complete = spread.count == len(test.measured)
        measured = replace(
            spread,
            mean=np.where(is_complete, spread.mean, np.nan),
            deviation=np.where(is_complete, spread.deviation, np.nan),
        )
    is_beam = any(isinstance(run.model, BeamModel) for run in outcome.runs if run.test is test)
    return BendPanel(
        title=test.name,
        lines=lines,
        readings=test.measured,
        measured=measured,
        spread=f"{100 * LEVEL:g} % by the card",
        along="deflection of mid-span, mm" if is_beam else COLLAR_DEFLECTION,
    )


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
