"""Presenter of bubble inflation tests.

`findings` gives numbers and words, `show` the page of a fit, `examine` that of the data before a
fit, `residuals` the table of all matched values, `simulate` the results of forward analyses.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ...errors import SolverFailure
from ...experiments.base import Findings, FittedTest
from ...experiments.bubble import PART, BubbleKind, BubbleTest, apex_heights
from ...experiments.bubble import findings as wording
from ...experiments.bubble.field_shape import MIN_STRAIN_POINTS, smooth_strains
from ...experiments.bubble.findings import fitted_model, objective_of
from ...experiments.bubble.measured_view import MeasuredView
from ...experiments.bubble.objective import OFFSETS, amounts_of
from ...experiments.bubble.point_files import PointFiles
from ...experiments.bubble.prepared import PreparedBubble
from ...experiments.bubble.prepared_readings import PreparedReadings
from ...experiments.bubble.recorded_frames import RecordedFrames
from ...experiments.bubble.registration import CameraRegistration
from ...experiments.bubble.section import DIRECTIONS, CorrelationSection, SheetSettings
from ...experiments.bubble.sheet import interpolated_at_nodes, states
from ...experiments.data_files import CaptionedFile, Output
from ...experiments.forward import Cards, Runs, Simulation, by_strain, strains_of
from ...experiments.measured import compared
from ...inference.objective import Blocks
from ...inference.reported import moduli_error
from ...lazy_modules import pandas as pd
from ...materials.forms.base import COMPONENTS
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import Outline
from ...presenting import KINDS
from ...readers.clock_offset import ClockOffset
from ...readers.fields import DisplacementField, surface_table
from ...solvers.base import STRAIN_DATA, STRESS_DATA, Array, History
from ...wording import percent
from .. import bubbles
from ..charts import Chart, Charts, dots
from ..content import Exhibit, Facts, Part, Table, Words
from ..maps import (
    ROUNDING,
    Maps,
    Panel,
    Solid,
    maps_of,
    pack,
    warp_arrow,
    write_pvd,
    write_vtu,
)
from ..presenter import PagePresenter
from ..vega import save, saved
from . import bubble_readings

#: Words for each choice of the plane that heights are measured from.
PLANES = {
    "clamp": "through the points beyond the rim",
    "edge": "through the edge of the sheet",
    "camera": "the camera's own x and y",
}
NOT_GIVEN = "not given"
GUIDE = (
    "The fields that the good practices guide of the International Digital Image Correlation "
    "Society asks for. What is not given stands in no file that was read: give it in "
    "[bubble.data.points.correlation] before the report leaves the laboratory."
)
#: Names on the page of the entries on camera and correlation in the project file, by their key.
CORRELATION_NAMES = {
    key: field.title for key, field in CorrelationSection.model_fields.items() if field.title
}
#: Columns of inflations.csv, with their headings on the page.
INFLATIONS = {
    "inflation": "inflation",
    "pressure_kPa": "pressure, kPa",
    "first_mm": "apex in the first, mm",
    "release_mm": "in the release before, mm",
    "apex_mm": "in this inflation, mm",
    "higher_mm": "higher by, mm",
    "higher_percent": "%",
}
NOT_MATCHED = "for the record: the fit matched the points themselves"
#: Largest number of points drawn at one pressure.
POINTS = 120
LABELS = ("x (warp), mm", "y (fill), mm")
#: Signs of x and y of the mirror images that make up the sheet: four of a quarter.
WHOLE_SHEET = ((1, 1),)
QUARTERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
STRAIN_LABELS = ("strain along the warp ε1", "strain along the fill ε2", "shear strain γ12")
SHORT_STRAIN_LABELS = ("warp strain", "fill strain", "shear strain")
STRESSES = ("stress along the warp σ1", "stress along the fill σ2", "shear stress τ12")


def findings(prepared: PreparedBubble, fitted: FittedTest) -> Findings:
    """Return what the best fit means for the test: numbers, warnings, and words."""
    test = prepared.test
    objective = objective_of(fitted)
    mean = objective.mean_absolute(fitted.histories[0].displacement, fitted.nuisance)
    offset = amounts_of(OFFSETS, fitted.reported_nuisance)
    numbers: dict[str, Any] = {
        "mean_abs_mm": mean,
        "nuisance": {
            "displacement_offset_mm": offset.tolist() if test.displacement_offset else None,
            "pressure_offset_kPa": fitted.reported_nuisance.get("pressure_offset"),
        },
        "data": {
            "matched_by": test.match_by,
            "places": [len(t.displacement) for t in objective.targets],
            "doubtful_dropped": prepared.dropped_count,
            **wording.read_numbers(prepared),
            "outside_dropped": prepared.points_beyond,
        },
    }
    lines = [f"mean |dx|+|dy|+|dz|: {mean:.3g} mm"]
    outlying = int(sum(mask.sum() for mask in prepared.outlying_points))
    if outlying and test.match_by == "points":
        numbers["data"]["outlying_dropped"] = outlying
        lines.append(f"data: {outlying} points far off the smooth surface of their frame left out")
    recorded = test.data.recorded
    if recorded is not None:
        numbers["data"]["pressures"] = wording.recorded_numbers(recorded)
        lines += wording.recorded_lines(recorded)
    numbers["sheet"] = wording.sheet_numbers(prepared, fitted)
    if prepared.surfaces:
        numbers["surface_r_squared"] = [s.r_squared for s in prepared.surfaces]
    remarks = dict.fromkeys(note for field in prepared.fields for note in field.source.notes)
    lines += [f"data: {remark}" for remark in remarks]
    if prepared.known is not None:
        error_numbers, line = _moduli_errors(fitted, prepared.known)
        numbers |= error_numbers
        lines.append(line)
    if prepared.registration is not None:
        numbers["registration"] = wording.registration_numbers(prepared.registration)
        lines.append(wording.registration_line(prepared.registration))
    lines += [*wording.sheet_lines(numbers["sheet"]), *_nuisance_lines(fitted)]
    quality = f"mean |dx|+|dy|+|dz| {mean:.4g} mm"
    summary = f"mean |dx| + |dy| + |dz| = {mean:.3g} mm"
    notes = (*wording.warnings_of(prepared), *wording.notes_of_slack(numbers["sheet"]))
    return Findings(numbers, notes, tuple(lines), quality, summary)


def _moduli_errors(fitted: FittedTest, known_law: HypoelasticLaw) -> tuple[dict[str, Any], str]:
    """Return the errors of the moduli against the law that computed the data, also in words."""
    errors = moduli_error(fitted.law, known_law, fitted.reached)
    ends = {name: fitted.reached[c] for name, c in COMPONENTS.items()}
    words = ", ".join(
        f"{name} {percent(errors[name])} (up to {100 * end:.3g} %)" for name, end in ends.items()
    )
    ranges = {name: [0.0, end] for name, end in ends.items()}
    line = f"largest error of the moduli over the strain reached: {words}"
    return {"moduli_error": errors, "moduli_error_range": ranges}, line


def _nuisance_lines(fitted: FittedTest) -> list[str]:
    """Return a line on the fitted offsets that have no prior, if there are any."""
    units = {n.name: n.unit for c in fitted.comparisons for n in c.nuisance if n.prior is None}
    values = fitted.reported_nuisance
    words = ", ".join(f"{name} {values[name]:.3f} {unit}" for name, unit in units.items())
    return [f"nuisance: {words}"] if units else []


def residuals(prepared: PreparedBubble, fitted: FittedTest) -> pd.DataFrame:
    """Return a table with a row for each place, pressure and direction of displacement.

    Modelled values include the fitted offsets. The column `frame` counts pressures from 1.
    """
    objective = objective_of(fitted)
    frames = []
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    fields = objective.modelled(fitted.histories[0].displacement, fitted.nuisance)
    for frame, (target, modelled) in enumerate(zip(objective.targets, fields, strict=True), 1):
        places = target.at_places(nodes)
        labels = {
            "part": "bubble",
            "frame": frame,
            "pressure_kPa": 1e3 * target.pressure,
            "x_mm": places[:, 0],
            "y_mm": places[:, 1],
        }
        for axis, name in enumerate(DIRECTIONS):
            measured = target.displacement[:, axis]
            frames.append(compared(name, measured, modelled[:, axis], objective.unit, **labels))
    return pd.concat(frames, ignore_index=True)


def show(prepared: PreparedBubble, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
    """Write the test's figures and files of a fit, and return what the page shows of it.

    The files are surfaces.csv, and bubble.pvd with its series of files for ParaView.
    """
    residuals_at_nodes = left_at_nodes(fitted)
    cuts = profile_charts(prepared, fitted)
    name = prepared.test.name
    heights = _height_charts(prepared, fitted)
    series = out.path("bubble.pvd")
    write_series(fitted_model(fitted), fitted.histories[0], fitted.law, series, residuals_at_nodes)
    figures, sheet_files = sheet_exhibit(prepared, fitted, out)
    tables = [misfit_table(prepared, fitted)]
    files = []
    if prepared.surfaces:
        words = "polynomial surfaces of the data"
        files.append(out.write("surfaces.csv", surface_table(prepared.surfaces), words, None))
        tables.append(_surfaces_table(prepared))
    files += [
        (series.name, "the inflated bubble pressure by pressure, for ParaView"),
        saved(out, "profiles.png", cuts, f"{name}: cuts through the bubble along warp and fill"),
        saved(out, "heights.png", heights, f"{name}: modelled against measured height"),
        *sheet_files,
    ]
    if prepared.registration is not None:
        figures.append(registration_picture(prepared.fields, prepared.test.outline, out))
        tables.insert(0, registration_table(prepared.registration))
    recorded = prepared.test.data.recorded
    if recorded is not None:
        tables.insert(0, recorded_table(recorded))
        if recorded.clock is not None:
            figures.append(clock_picture(recorded, recorded.clock, out))
    parts: list[Part] = [
        cuts,
        field_maps(prepared, fitted),
        strain_maps(prepared, fitted),
        bubble_solid(prepared, fitted, residuals_at_nodes),
        residual_chart(prepared, fitted),
    ]
    facts = _facts(findings.numbers)
    return Exhibit(facts, figures, tables, files, parts, correlation_table(prepared))


def _height_charts(prepared: PreparedBubble, fitted: FittedTest) -> Charts:
    """Return charts of modelled over measured heights at all matched places."""
    objective = objective_of(fitted)
    modelled = objective.modelled(fitted.histories[0].displacement, fitted.nuisance)
    return bubbles.height_charts(
        [target.pressure for target in objective.targets],
        [target.displacement[:, 2] for target in objective.targets],
        [displacement[:, 2] for displacement in modelled],
        measured_label=prepared.source,
    )


def _surfaces_table(prepared: PreparedBubble) -> Table:
    """Return a table of R² of the polynomial surfaces fitted to the data at each pressure."""
    rows = [
        [1e3 * pressure, *(f"{r:.5f}" for r in surface.r_squared)]
        for pressure, surface in zip(prepared.test.pressures, prepared.surfaces, strict=True)
    ]
    title = f"R² of polynomial surfaces of degree {prepared.test.match_degree}"
    note = "" if prepared.test.match_by == "surfaces" else NOT_MATCHED
    return Table(title, ["pressure, kPa", "x", "y", "z"], rows, note)


def _facts(numbers: Mapping[str, Any]) -> list[tuple[str, object]]:
    """Return labels and values: misfit, points left out, fitted offsets and the sheet."""
    facts = [("mean |dx| + |dy| + |dz|, mm", numbers["mean_abs_mm"])]
    doubtful = numbers["data"]["doubtful_dropped"]
    out_of_rim = numbers["data"]["outside_dropped"]
    if doubtful or out_of_rim:
        facts.append(("points left out", f"{doubtful} doubtful, {out_of_rim} beyond the rim"))
    outlying = numbers["data"].get("outlying_dropped")
    if outlying:
        facts.append(("points far off the surface of their frame, left out", outlying))
    shift = numbers["nuisance"]["displacement_offset_mm"]
    pressure = numbers["nuisance"]["pressure_offset_kPa"]
    if shift is not None:
        facts.append(("displacement offset, mm", ", ".join(f"{v:.3f}" for v in shift)))
    if pressure is not None:
        facts.append(("pressure offset, kPa", f"{pressure:.3f}"))
    (sheet,) = wording.sheet_lines(numbers["sheet"])
    facts.append(("sheet", sheet.removeprefix("sheet: ")))
    return facts


def left_at_nodes(fitted: FittedTest) -> list[Array | None]:
    """Return the differences measured minus modelled, interpolated at the nodes of the mesh.

    Returns
    -------
    list of (nodes, 3) array or None
        Differences of displacement, mm, at each reported pressure; None at a pressure that the
        fit does not match.
    """
    objective = objective_of(fitted)
    history = fitted.histories[0]
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    residuals_at_nodes: list[Array | None] = [None] * len(history.displacement)
    differences = objective.differences(history.displacement, fitted.nuisance)
    for number, (target, off) in enumerate(zip(objective.targets, differences, strict=True)):
        frame = number if target.frame is None else target.frame
        residuals_at_nodes[frame] = interpolated_at_nodes(nodes, target.at_places(nodes), -off)
    return residuals_at_nodes


def misfit_table(prepared: PreparedBubble, fitted: FittedTest) -> Table:
    """Return a table of the errors of displacement in x, y and z at each pressure."""
    objective = objective_of(fitted)
    residual = objective.residual(fitted.histories[0], fitted.nuisance)
    norms = Blocks(objective.sizes).norms(residual).reshape(-1, 3).tolist()
    unit = "over the largest measured value" if prepared.test.objective == "e" else "in mm"
    targets = objective.targets
    rows = [[1e3 * target.pressure, *norm] for target, norm in zip(targets, norms, strict=True)]
    header = ["pressure, kPa", "x", "y", "z"]
    return Table("Misfit by pressure", header, rows, f"RMS error {unit}, direction by direction")


def profile_charts(prepared: PreparedBubble, fitted: FittedTest) -> Charts:
    """Return charts of modelled (lines) and measured (dots) profiles along both axes.

    Displacements count from the reference state, or from the frame of `from_pressure`. Offsets are
    added to the model; a fitted tilt or shift, and a constant field, are not.
    """
    test = prepared.test
    nodes = fitted.comparisons[0].model.mesh.points
    frames = fitted.histories[0].displacement + amounts_of(OFFSETS, fitted.nuisance)
    targets = objective_of(fitted).targets
    pressures = [target.pressure for target in targets]
    modelled = [target.nodal_displacement(frames, k) for k, target in enumerate(targets)]
    measured = [(field.points, field.displacement) for field in prepared.fields]
    caption = f"{test.name}: lines are the model, dots are {prepared.source}"
    if test.sheet.reference_frame is not None:
        measured = [(t.at_places(nodes[:, :2]), t.displacement) for t in targets]
        caption += ", both counted from the loaded frame"
    name = f"{test.name} cuts"
    return bubbles.cut_charts(name, pressures, nodes, modelled, measured, f"{caption}.")


def residual_chart(prepared: PreparedBubble, fitted: FittedTest) -> Charts:
    """Return charts of the residuals of dx, dy and dz over the measured dz."""
    objective = objective_of(fitted)
    differences = objective.differences(fitted.histories[0].displacement, fitted.nuisance)
    targets = objective.targets
    source = prepared.source
    rounding = ROUNDING * max(np.abs(t.displacement).max() for t in targets)
    numbers = bubbles.drawn_indices(len(targets))
    charts = []
    for axis, name in enumerate(DIRECTIONS):
        series = []
        for rank, k in zip(bubbles.ranks(len(numbers)), numbers, strict=True):
            step = max(1, -(-len(differences[k]) // POINTS))
            height = targets[k].displacement[::step, 2]
            pressure = bubbles.in_kilopascal(targets[k].pressure)
            series.append(dots(pressure, height, differences[k][::step, axis], rank=rank))
        values = np.concatenate([difference[:, axis] for difference in differences])
        rms = np.sqrt(np.mean(values**2))
        title = f"{name}: RMS {rms:.2g} mm"
        alt = f"modelled less {source} {name} over the {source} height, {rms:.2g} mm RMS"
        axes = f"{source} dz, mm", f"modelled − {source}, mm"
        ends = (-rounding, rounding) if np.abs(values).max() < rounding else None
        charts.append(Chart(title, *axes, series, alt, level=0.0, y_range=ends))
    test = prepared.test.name
    omitted = bubbles.words_on_omitted(len(targets))
    caption = f"{test}: what is left, over the {source} height.{omitted}"
    return Charts(f"{test} residual", charts, caption)


def field_maps(prepared: PreparedBubble, fitted: FittedTest) -> Maps:
    """Return maps of dx, dy and dz at all matched places: measured, modelled, difference."""
    objective = objective_of(fitted)
    name = prepared.test.name
    displacement = fitted.histories[0].displacement
    measured = [target.displacement for target in objective.targets]
    modelled = objective.modelled(displacement, fitted.nuisance)
    differences = objective.differences(displacement, fitted.nuisance)
    caption = (
        f"{name}: displacement {prepared.source}, modelled, and their difference. Colours "
        "end at the least and the largest value of the pressure shown."
    )
    if objective.constant:
        caption += " From the difference a field is taken out that is the same at all pressures."
    fields = measured, modelled, differences
    return _maps(prepared, fitted, DIRECTIONS, "mm", fields, f"{name} maps", caption)


def _maps(
    prepared: PreparedBubble,
    fitted: FittedTest,
    quantities: Sequence[str],
    unit: str,
    fields: tuple[Sequence[Array], ...],
    name: str,
    caption: str,
) -> Maps:
    """Return maps of quantities at all matched places.

    Parameters
    ----------
    fields : tuple of sequences of arrays
        Data, model and their difference; of each an (n, quantities) array for each pressure.
    """
    targets = objective_of(fitted).targets
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    rows = []
    for k, quantity in enumerate(quantities):
        data, model, difference = ([field[:, k] for field in frames] for frames in fields)
        rows.append((quantity, unit, data, model, difference))
    return maps_of(
        name,
        "pressure",
        [bubbles.in_kilopascal(target.pressure) for target in targets],
        [target.at_places(nodes) for target in targets],
        rows,
        LABELS,
        caption,
        f"maps of {', '.join(quantities)} of {prepared.test.name}",
        source=prepared.source,
    )


def strain_maps(prepared: PreparedBubble, fitted: FittedTest) -> Maps | Words:
    """Return maps of the strain at all matched places: of the data, of the model, difference.

    Both are derived from displacements in the same way; words say why where that is not possible.
    """
    objective = objective_of(fitted)
    targets = objective.targets
    source = prepared.source
    name = prepared.test.name
    fewest = min(len(target.displacement) for target in targets)
    if prepared.test.sheet.reference_frame is not None:
        reason = "displacements count from a loaded frame, whose shape is not known"
        return Words([f"{name}: no maps of {source} strain: {reason}."])
    if fewest < MIN_STRAIN_POINTS:
        reason = f"it takes {MIN_STRAIN_POINTS} points at each pressure, and there are {fewest}"
        return Words([f"{name}: no maps of {source} strain: {reason}."])
    mesh = fitted_model(fitted).mesh
    warp = None if mesh.warp is None else np.reshape(mesh.warp, (-1, 3))[0]
    pairs = []
    differences = objective.differences(fitted.histories[0].displacement, fitted.nuisance)
    for target, difference in zip(targets, differences, strict=True):
        place = target.at_places(mesh.points)
        measured = target.displacement
        fields = measured, measured + difference
        pairs.append(smooth_strains(place[:, :2], place[:, 2], fields, warp))
    data, model = ([100 * pair[k] for pair in pairs] for k in range(2))
    fields_of_maps = data, model, [b - a for a, b in zip(data, model, strict=True)]
    caption = (
        f"{name}: logarithmic strain along the yarns. Smooth polynomials through the displacements "
        f"of each pressure are differentiated, {source} and modelled ones at the same places and "
        "in the same way; near the rim this is good to some tenths of a percent of strain. Strain "
        "counts from the picture before the test."
    )
    if objective.constant:
        caption += " The field that is the same at all pressures is added to the model."
    title = f"{name} strain maps"
    return _maps(prepared, fitted, SHORT_STRAIN_LABELS, "%", fields_of_maps, title, caption)


def bubble_solid(
    prepared: PreparedBubble, fitted: FittedTest, residuals_at_nodes: Sequence[Array | None]
) -> Solid:
    """Return the modelled bubble at every pressure as a surface that a reader can turn.

    Parameters
    ----------
    prepared : PreparedBubble
        The test.
    fitted : FittedTest
        Its part of the fit.
    residuals_at_nodes : sequence of (nodes, 3) array or None
        Residuals at each pressure, mm, as `left_at_nodes` returns them.
    """
    test = prepared.test
    model = fitted_model(fitted)
    mesh = model.mesh
    history = replace(fitted.histories[0], model=model, law=fitted.law)
    signs = np.array(QUARTERS if test.symmetry == "quarter" else WHOLE_SHEET, dtype=float)
    points = mesh.points + history.displacement
    mirrored_points = [points * (sx, sy, 1.0) for sx, sy in signs]
    quads = [mesh.quads + k * len(mesh.points) for k in range(len(signs))]
    caption = (
        f"{test.name}: the modelled bubble. Strain is "
        "logarithmic, stress Cauchy stress, both in the middle of each element; the residual "
        f"is the distance of modelled and {prepared.source}, grey where there are no data. The "
        "arrow is the warp."
    )
    alt = f"the inflated bubble of {test.name}, {points[-1, :, 2].max():.3g} mm high at the end"
    return Solid(
        f"{test.name} bubble",
        [bubbles.in_kilopascal(load) for load in history.load],
        "pressure",
        pack(np.concatenate(mirrored_points, axis=1)),
        pack(np.concatenate(quads)),
        [
            _residual_panel(history, residuals_at_nodes, len(signs)),
            *_element_panels(history, signs),
        ],
        caption,
        alt,
        warp_arrow(np.concatenate(mirrored_points, axis=1)),
    )


def _residual_panel(
    history: History, residuals_at_nodes: Sequence[Array | None], parts: int
) -> Panel:
    """Return the length of the residual vector in every element of the whole sheet.

    Parameters
    ----------
    residuals_at_nodes : sequence of (nodes, 3) array or None, mm
        One a pressure, None where the fit matches nothing.
    parts : int
        Number of mirror images.
    """
    mesh = history.mesh
    unmatched = np.full((len(mesh.points), 3), np.nan)
    lengths = [
        np.linalg.norm(unmatched if field is None else field, axis=1)
        for field in residuals_at_nodes
    ]
    # The value of an element is the mean over its corners, NaN where a corner has no data.
    residual = np.tile(np.array([length[mesh.quads].mean(axis=1) for length in lengths]), parts)
    residual[residual < ROUNDING * np.abs(history.displacement).max()] = 0.0
    return Panel("residual, length", "mm", pack(residual))


def _element_panels(history: History, signs: Array) -> list[Panel]:
    """Return strain and stress in every element of the whole sheet.

    `signs` : signs of x and y of each mirror image, whose product is the sign of its shear.
    """
    panels = []
    fields = ((STRAIN_LABELS, "%", 100 * history.strain()), (STRESSES, "MPa", history.stress()))
    for names, unit, values in fields:
        parts = np.concatenate([values * (1.0, 1.0, sx * sy) for sx, sy in signs], axis=1)
        panels += [
            Panel(name, unit, pack(parts[..., k]), "about zero" if k == 2 else "from least")
            for k, name in enumerate(names)
        ]
    return panels


def examine(prepared: PreparedBubble, out: Output) -> Exhibit:
    """Write maps and curves of the measured data; return what the page of a check shows."""
    view = prepared.view
    rises = replace(view, fields=prepared.fields).rises
    tables = [_frames_table(prepared, rises)]
    if prepared.registration is not None:
        tables.insert(0, registration_table(prepared.registration))
    if view.apexes:
        tables.append(_equilibrium(view))
    curve = np.array([field.pressure for field in prepared.fields]), np.asarray(rises)
    rise_charts = bubbles.rise_charts("rises", "rise about the centre, mm", [curve])
    figures = [
        registration_picture(prepared.fields, prepared.test.outline, out),
        saved(out, "rises.png", rise_charts, "rise about the centre against pressure"),
    ]
    files = []
    recorded = prepared.test.data.recorded
    if recorded is not None and recorded.inflations:
        inflations = recorded.inflations
        table = pd.DataFrame(inflations.rows, columns=list(INFLATIONS))
        files.append(out.write("inflations.csv", table, "apex of each inflation beside the first"))
        cells = table.to_numpy().tolist()
        tables.append(Table("Inflations", list(INFLATIONS.values()), cells, inflations.line))
        apexes = bubbles.rise_charts("inflations", "height of the apex, mm", inflations.curves)
        figures.append(saved(out, "inflations.png", apexes, "apex in each inflation and release"))
    return Exhibit(facts=_view_facts(view), figures=figures, tables=tables, files=files)


def _frames_table(prepared: PreparedBubble, rises: Sequence[float] | Array) -> Table:
    """Return a table of the frames: file, points, points dropped, and rise, mm, of the sheet."""
    rows = []
    for field, rise in zip(prepared.fields, rises, strict=True):
        dropped = ", ".join(f"{count} {reason}" for reason, count in field.dropped.items())
        name = "computed" if prepared.known is not None else "array"
        if field.path is not None:
            name = field.path.name
        cells = [1e3 * field.pressure, name, len(field.points), dropped or "none", rise]
        rows.append(cells)
    header = ["pressure, kPa", "file", "points", "dropped", "rise about the centre, mm"]
    return Table("Frames", header, rows, text=(1, 3))


def _view_facts(view: MeasuredView) -> list[tuple[str, object]]:
    """Return the centre about which the sheet rises, and the axes about which it is symmetric."""
    facts: list[tuple[str, object]] = []
    if view.rim is not None:
        centre = f"{view.rim.x:.2f}, {view.rim.y:.2f} (+- {view.rim.error:.2g})"
        facts.append(("the sheet rises about, mm", centre))
    if view.axes is not None:
        clear = f"+- {view.axes.error:.2g}, {view.axes.clarity:.0%} clear"
        facts.append(
            ("axes of symmetry, degrees from x and y", f"{view.axes.misalignment:.2f} ({clear})")
        )
    return facts


def _equilibrium(view: MeasuredView) -> Table:
    """Return a table of force and stress at the apex by the curvature, at each pressure."""
    rows = [
        [
            1e3 * apex.pressure,
            apex.height,
            1e3 * apex.curvature,
            apex.force,
            apex.error,
            apex.force / view.thickness,
            100 * apex.strain[0],
            100 * apex.strain[1],
        ]
        for apex in view.apexes
    ]
    header = [
        "pressure, kPa",
        "apex, mm",
        "k1 + k2, 1/m",
        "force, kN/m",
        "+-",
        "stress, MPa",
        "strain along warp, %",
        "along fill, %",
    ]
    note = (
        "n1 k1 + n2 k2 = p with n1 = n2, from the measured shape alone; logarithmic strain, stress "
        "over the thickness before the test"
    )
    return Table("Equilibrium of the apex, without a model", header, rows, note)


class SheetField(NamedTuple):
    """Field over the sheet, which is written as a table and a picture.

    Attributes
    ----------
    stem : str
        Name of its files, without suffix.
    points : (n, 2) array
        Places, mm.
    values : mapping of str to (n,) array
        Components of the field, mm, by name.
    description : str
        Words for the table.
    caption : str
        Words for the picture.
    """

    stem: str
    points: Array
    values: Mapping[str, Array]
    description: str
    caption: str


def sheet_exhibit(
    prepared: PreparedBubble, fitted: FittedTest, out: Output
) -> tuple[list[CaptionedFile], list[CaptionedFile]]:
    """Write the reference surface and the constant field of a test, where it has them.

    Returns
    -------
    list of (str, str), list of (str, str)
        Pictures with captions, and tables with descriptions.
    """
    figures = []
    files = []
    edge = prepared.test.outline.edge()
    for field in _sheet_fields(prepared, fitted):
        disks = [(f"{name}, mm", field.points, column) for name, column in field.values.items()]
        charts = bubbles.disk_charts(disks, edge)
        figures.append(saved(out, f"{field.stem}.png", charts, field.caption))
        columns = {"x": field.points[:, 0], "y": field.points[:, 1], **field.values}
        table = pd.DataFrame(columns).add_suffix("_mm")
        files.append(out.write(f"{field.stem}.csv", table, field.description, 6))
    return figures, files


def _sheet_fields(prepared: PreparedBubble, fitted: FittedTest) -> list[SheetField]:
    """Return the reference surface and the constant field of a test that has them."""
    fields = []
    sheet = prepared.test.sheet
    if sheet.measured or sheet.modes:
        points = fitted_model(fitted).mesh.points
        sources = ["measured surface"] * sheet.measured + ["modes"] * (sheet.modes > 0)
        words = "surface of the sheet in the reference picture"
        caption = f"{prepared.test.name}: {words} ({' and '.join(sources)})"
        values = {"z0": points[:, 2]}
        description = f"{words}, node by node"
        fields.append(SheetField("reference_surface", points[:, :2], values, description, caption))
    if sheet.constant:
        points, constant = wording.constant_field(fitted)
        words = "measured less modelled, as far as it is the same at all pressures"
        values = {DIRECTIONS[k]: constant[:, k] for k in sheet.constant}
        description = f"{words}, point by point"
        caption = f"Taken out of the fit: {words}"
        fields.append(SheetField("constant_field", points, values, description, caption))
    return fields


def recorded_table(recorded: RecordedFrames) -> Table:
    """Return a table of the recorded frames that are used, with their pressures."""
    columns: dict[str, Iterable[object]] = {
        "frame": recorded.names,
        "pressure, kPa": 1e3 * recorded.pressure,
    }
    if recorded.requested is not None:
        columns["asked for, kPa"] = 1e3 * recorded.requested
        columns["farther by, kPa"] = 1e3 * (recorded.pressure - recorded.requested)
    clock = recorded.clock
    if recorded.pressure_uncertainty is not None and clock is not None and clock.misfit is not None:
        columns["uncertain by the clocks, +- kPa"] = 1e3 * recorded.pressure_uncertainty
    rows = list(zip(*columns.values(), strict=True))
    dropped = "".join(f"; {count} {reason}" for reason, count in recorded.left_out.items())
    note = f"pressures from {recorded.source}; {len(rows)} of {recorded.count} frames{dropped}"
    if clock is not None:
        note += ". " + wording.clock_words(clock)
    return Table("Frames taken", list(columns), rows, note)


def clock_picture(recorded: RecordedFrames, clock: ClockOffset, out: Output) -> CaptionedFile:
    """Draw the pressures of the log and the apex heights of all frames over one clock."""
    times = clock.times + clock.offset
    charts = bubbles.clock_charts(times, clock.pressure, clock.heights, recorded.pressure)
    words = "pressures of the log and heights of the frames, by one clock"
    return saved(out, "clock.png", charts, words)


def registration_table(registration: CameraRegistration) -> Table:
    """Return a table of the steps of a registration: plane, centre, warp, motion of the clamp."""
    x, y, z = registration.placement.origin
    plane = PLANES[registration.plane_of]
    if registration.plane_of != "camera":
        plane += f", which deviate by {registration.flatness:.2g} mm"
    centre = "given"
    if registration.rim is not None:
        centre = f"found where the sheet does not rise, +- {registration.rim.error:.2g}"
    tilt = f"tilted by {registration.placement.tilt:.2f} degrees"
    angle = f"{registration.warp_angle:.2f}"
    rows = [
        ["plane of the rim", tilt, plane],
        ["centre of the rim, mm", f"{x:.2f}, {y:.2f}, {z:.2f}", centre],
        ["warp, degrees from the camera's x", angle, _source_of_warp(registration)],
        ["motion of the clamp", *_clamp_motion(registration)],
    ]
    note = "lengths and directions in the camera's coordinates"
    return Table("Registration", ["step", "value", "how"], rows, note)


def _source_of_warp(registration: CameraRegistration) -> str:
    """Return in words how the direction of the warp was found, or that it was given."""
    warp = registration.warp
    if warp is None:
        return "given"
    if warp.clarity is None:
        return f"found by the turn of the elliptic rim, +- {warp.error:.2g}"
    stiff = "stiffer" if registration.options.warp_is_stiff else "softer"
    return (
        f"found by symmetry ({warp.clarity:.0%} clear), +- {warp.error:.2g}; the {stiff} of the "
        "two axes"
    )


def _clamp_motion(registration: CameraRegistration) -> tuple[str, str]:
    """Return the largest motion of the clamp, and whether it was removed."""
    motions = [motion for motion in registration.motions if motion.point_count]
    if not motions:
        return "not known", "no points beyond the rim all around"
    shift = max(np.linalg.norm(motion.shift) for motion in motions)
    angle = max(motion.angle for motion in motions)
    is_removed = registration.options.remove_clamp_motion
    return f"{shift:.3g} mm, {angle:.2g} degrees at most", "removed" if is_removed else "left in"


def registration_picture(
    fields: Sequence[DisplacementField], outline: Outline, out: Output
) -> CaptionedFile:
    """Draw maps of the reference height, if measured, and of the rise at the highest pressure."""
    last = max(fields, key=lambda field: field.pressure)
    maps = [(f"rise at {1e3 * last.pressure:.4g} kPa, mm", last.displacement[:, 2])]
    if last.z is not None:
        maps.insert(0, ("reference height z, mm", last.z))
    charts = bubbles.registration_charts(last.points, maps, outline.edge())
    words = "measured points in the test's coordinates, the rim, warp and fill"
    return saved(out, "registration.png", charts, words)


def correlation_table(prepared: PreparedBubble) -> list[Table]:
    """Return a table on camera and image correlation; no table where data were computed."""
    test = prepared.test
    if not isinstance(test.data, PointFiles) or not prepared.fields:
        return []
    entries = _correlation_entries(test, test.data)
    formats = sorted({f.source.format for f in prepared.fields if f.source.format})
    software = filter(None, [entries.get("software", ""), ", ".join(formats)])
    points = [len(f.points) for f in prepared.fields]
    rows = [
        ["software and format of the export", "; ".join(software) or NOT_GIVEN],
        ["images evaluated", str(len(prepared.fields))],
        ["points in an image", f"{min(points)} to {max(points)}"],
        ["points left out as doubtful", str(prepared.dropped_count)],
        ["coordinates", "registered on the rim" if prepared.registration else "as exported"],
        ["noise floor of a displacement", _mm(test.noise) or NOT_GIVEN],
    ]
    if test.match_by == "surfaces":
        rows.append(["smoothing", f"polynomial surfaces of degree {test.match_degree}"])
    rows += [[name, entries.get(key, NOT_GIVEN)] for key, name in CORRELATION_NAMES.items()]
    return [Table(f"Image correlation: {test.name}", ["", ""], rows, GUIDE, text=(1,))]


def _correlation_entries(test: BubbleTest, files: PointFiles) -> dict[str, str]:
    """Return the entries that the project gives on camera and correlation, by their key."""
    if test.facet is None:
        return dict(files.correlation)
    sizes = {"subset": test.facet.size, "step": test.facet.step}
    facet = {key: _mm(size) for key, size in sizes.items() if size is not None}
    return {**facet, **files.correlation}


def _mm(value: float | None) -> str:
    """Return a length in mm as text; "" without one."""
    return "" if value is None else f"{value:.3g} mm"


def write_series(
    model: BubbleModel,
    history: History,
    law: HypoelasticLaw,
    path: Path,
    residuals: Sequence[Array | None] | None = None,
) -> Path:
    """Write the inflated sheet for ParaView: a collection (.pvd) with a file for each pressure.

    Parameters
    ----------
    model : BubbleModel
        Model of the sheet.
    history : History
        Result of its analysis.
    law : HypoelasticLaw
        Law of the analysis, which gives the stresses.
    path : Path
        File of the collection; the other files go into a folder beside it.
    residuals : sequence of (nodes, 3) array or None, mm, optional
        Measured minus modelled displacements at each pressure; None where there are none.
    """
    folder = path.with_name(f"{path.stem}-vtu")
    files = []
    history = replace(history, model=model, law=law)
    frames = zip(
        history.load,
        history.displacement,
        history.strain(),
        history.stress(),
        residuals or [None] * len(history.load),
        strict=True,
    )
    for number, (load, u, strain, stress, residual) in enumerate(frames):
        pressure = 1e3 * load
        file = folder / f"{number:03d}-{pressure:.4g}kPa.vtu"
        cells = {STRAIN_DATA: strain, STRESS_DATA: stress, "wrinkling": states(stress)}
        points = {} if residual is None else {"residual_mm": residual}
        write_vtu(model.mesh, u, file, points, cells)
        files.append((pressure, file))
    return write_pvd(path, files)


def simulate(
    test: BubbleTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Write displacement.csv, bubble.pvd and profiles.png for each card; return apex heights."""
    numbers: dict[str, dict[str, object]] = {}
    lines = []
    parts = []
    for i, name in enumerate(cards, start=1):
        history = runs[name, PART].outcome
        model = runs[name, PART].model
        if isinstance(history, SolverFailure):
            numbers[name] = {"failed": history.reason}
            lines.append(f"{name}: failed: {history.reason}")
            continue
        suffix = "" if len(cards) == 1 else f"-{i}"
        heights = apex_heights(model, history)
        kilos = 1e3 * history.load
        numbers[name] = {
            "pressure_kPa": kilos.tolist(),
            "apex_mm": heights.tolist(),
            "strain_reached": by_strain(strains_of(history)),
        }
        out.write(f"displacement{suffix}.csv", displacement_table(model, history))
        write_series(model, history, cards[name].law, out.path(f"bubble{suffix}.pvd"))
        cuts = bubbles.cut_charts(name, test.pressures, model.mesh.points, history.displacement)
        save(out.path(f"profiles{suffix}.png"), cuts)
        rows = [[p, z] for p, z in zip(kilos, heights, strict=True)]
        heading = [Facts((), name)] if len(cards) > 1 else []
        parts += [*heading, cuts, Table("Apex", ["pressure, kPa", "height, mm"], rows)]
        lines += [f"{name}:"] if len(cards) > 1 else []
        lines += [f"{p:8.1f} kPa   apex {z:8.3f} mm" for p, z in zip(kilos, heights, strict=True)]
    lines += _words_on_sheet(test.sheet)
    top_numbers = numbers[next(iter(cards))] if len(cards) == 1 else {}
    return Simulation({**top_numbers, "cards": numbers}, lines, parts=parts)


def _words_on_sheet(sheet: SheetSettings) -> list[str]:
    """Return a line on what a forward analysis leaves out of the settings of the sheet, if any."""
    if replace(sheet, tension=(0.0, 0.0)) == SheetSettings():
        return []
    if any(sheet.tension):
        assumption = "a flat sheet with a fixed rim; of [bubble.sheet] only tension is used"
    else:
        assumption = "a flat and taut sheet with a fixed rim, whatever [bubble.sheet] says"
    return [f"note: simulated from {assumption}"]


def displacement_table(model: BubbleModel, history: History) -> pd.DataFrame:
    """Return a table of the displacement of every node at every pressure.

    Its columns are pressure_kPa, node (index), x_mm, y_mm, dx_mm, dy_mm and dz_mm.
    """
    x, y = model.mesh.points[:, :2].T
    frames = []
    for load, u in zip(history.load, history.displacement, strict=True):
        columns = {"pressure_kPa": 1e3 * load, "node": np.arange(len(x)), "x_mm": x, "y_mm": y}
        columns |= {f"{name}_mm": u[:, k] for k, name in enumerate(DIRECTIONS)}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def fitted_charts(prepared: Any, fitted: FittedTest) -> Charts:
    """Return profiles of a fitted test with fields, or the curves of its readings."""
    is_read = isinstance(prepared, PreparedReadings)
    return (bubble_readings.fitted_charts if is_read else profile_charts)(prepared, fitted)


class BubblePresenter(PagePresenter):
    """Presenter of bubble tests: those with fields of a camera, and those with readings."""

    simulate = staticmethod(simulate)

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        is_read = isinstance(prepared, PreparedReadings)
        return (bubble_readings.findings if is_read else findings)(prepared, fitted)

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        is_read = isinstance(prepared, PreparedReadings)
        return (bubble_readings.residuals if is_read else residuals)(prepared, fitted)

    def show(self, prepared: Any, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        is_read = isinstance(prepared, PreparedReadings)
        return (bubble_readings.show if is_read else show)(prepared, fitted, findings, out)

    def examine(self, prepared: Any, out: Output) -> Exhibit:
        is_read = isinstance(prepared, PreparedReadings)
        return (bubble_readings.examine if is_read else examine)(prepared, out)

    charts = MappingProxyType({"heights": fitted_charts})


KINDS.register(BubbleKind, BubblePresenter())
