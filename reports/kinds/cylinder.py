"""Results of bent cylinders as facts, figures, tables and files; last the charts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ...experiments.cylinder import CylinderKind
from ...experiments.cylinder.curve import CRITERIA, CURVE_PROPERTIES, CurvePoint
from ...experiments.cylinder.measures import BendingMeasures
from ...experiments.cylinder.predicted import (
    CylinderOutcome,
    CylinderPredicted,
    measured_table,
    place_names,
)
from ...experiments.cylinder.run import BendingRun, Model
from ...experiments.cylinder.terminal import describe_load
from ...experiments.cylinder.test import PART, CylinderTest
from ...experiments.forward import Cards, Runs, Simulation
from ...experiments.output import Output, Shown
from ...experiments.predicted import PredictedRun, record_of
from ...materials.card import BAND, LEVEL
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh, surface_strain, with_mirror_image
from ...notes import marks_of
from ...presenting import KINDS
from ...readers.bending import BendingCurve, BendingScatter, scatter
from ...solvers.base import Array
from ...wording import percent
from ..charts import Chart, Charts, Series, band, dots, faces, line, shades_of
from ..content import Exhibit, Part, Table, Words
from ..maps import write_vtu
from ..presenter import PagePresenter
from ..vega import save

#: Node sets that the picture draws as lines.
DRAWN_LINES = ("mid_span", "top_line", "bottom_line")
#: Folders of the output.
FIGURES, BEAMS = "figures", "beams"
#: Files of the output.
CURVES_FILE, MEASURED_FILE = "load_deflection.csv", "measured.csv"
#: Predictions that the page sums up in its first sentence.
SUMMED_UP = 4
#: Letters of a cell that is not broken.
UNBROKEN_LETTERS = 30


class WholeBeam(NamedTuple):
    """The whole cylinder: mesh (mm, with warp), displacements (nodes, 3) mm."""

    mesh: Mesh
    inflated: Array
    bent: Array


def whole_beam(model: Model, run: BendingRun) -> WholeBeam:
    """Return the meshed part and its mirror images."""
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
    """Return supports and collar, placed to touch the inflated beam; straps hang on its axis."""
    if isinstance(model, BeamModel):
        return _rollers_and_straps(model, beam)
    return _supports_and_collars(model, beam, deflection)


def _rollers_and_straps(model: BeamModel, beam: WholeBeam) -> BeamBodies:
    radius = model.section.radius
    half_spacing = 0.5 * model.load_spacing
    half_span = 0.5 * model.supports.span
    roller_radius = 0.5 * model.supports.diameter
    rows, row = np.unique(np.round(beam.mesh.points[:, 2], 3), return_inverse=True)
    axis = np.bincount(row, (beam.mesh.points + beam.bent)[:, 1]) / np.bincount(row)
    strap_height = np.interp(half_spacing, rows, axis)
    roller_height = -max(model.roller_below, radius + roller_radius)
    return BeamBodies(
        supports=((-half_span, roller_height), (half_span, roller_height)),
        support_radius=roller_radius,
        collar_height=float(strap_height),
        collar_radius=radius,
        collar_length=model.collar.length,
        collars=tuple(sorted({-half_spacing, half_spacing})),
    )


def _supports_and_collars(model: CylinderModel, beam: WholeBeam, deflection: float) -> BeamBodies:
    position = beam.mesh.points + beam.inflated
    support_radius = 0.5 * model.supports.width
    half_span = 0.5 * model.supports.span
    distance = np.abs(np.abs(position[:, 2]) - half_span)
    is_over = distance < support_radius
    rise = np.sqrt(support_radius**2 - distance[is_over] ** 2)
    support_height = float((position[is_over, 1] - rise).min())
    inner = 0.5 * model.collar.inner_diameter
    middle = 0.5 * model.collar.spacing
    is_along = np.abs(np.abs(position[:, 2]) - middle) <= 0.5 * model.collar.length
    is_inside = is_along & (np.abs(position[:, 0]) < inner)
    rise = np.sqrt(inner**2 - position[is_inside, 0] ** 2)
    collar_height = float((position[is_inside, 1] - rise).max())
    return BeamBodies(
        supports=((-half_span, support_height), (half_span, support_height)),
        support_radius=support_radius,
        collar_height=collar_height - deflection,
        collar_radius=inner,
        collar_length=model.collar.length,
        collars=tuple(sorted({-middle, middle})),
    )


def draw_beam(model: Model, run: BendingRun, path: Path, title: str) -> None:
    """Draw the last frame."""
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
    charts = beam_charts(
        bent,
        beam.mesh.quads,
        surface_strain(beam.mesh, beam.bent)[:, 0],
        inflated[outline][:, [2, 1]],
        (inflated[ring, :2], bent[ring, :2]),
        bodies_of(model, beam, float(run.deflection[-1])),
        title,
    )
    save(path, charts)


def write_beam(model: Model, run: BendingRun, path: Path) -> None:
    """Write the last frame for ParaView, with the inflated one as a further displacement."""
    beam = whole_beam(model, run)
    strains = {
        "log_strain_1_2_12": surface_strain(beam.mesh, beam.bent),
        "inflated_log_strain_1_2_12": surface_strain(beam.mesh, beam.inflated),
    }
    write_vtu(beam.mesh, beam.bent, path, {"inflated_displacement": beam.inflated}, strains)


def draw_figures(outcome: CylinderOutcome, out: Output) -> list[Shown]:
    """Draw loads, gas and beam of every test, and all loads; return those of the page."""
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
    """Return a row a diameter where several diameters have several pressures, else of three."""
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


def write_beams(outcome: CylinderOutcome, out: Output) -> list[Shown]:
    """Write the last frame of every run for ParaView; return the files."""
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
    """Return different file names for each."""
    files: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        is_used = plain.casefold() in (file.casefold() for file in files.values())
        files[name] = f"{plain}-{number}" if is_used else plain
    return files


def _predicted_runs(test: CylinderTest, outcome: CylinderOutcome) -> list[int]:
    """Return the runs of a test that did not fail, of what the solver predicts."""
    runs = outcome.runs
    return [i for i in outcome.bent if runs[i].test is test and runs[i].predicted]


def _panel(test: CylinderTest, outcome: CylinderOutcome) -> BendPanel:
    """Return the curves of a test, of all cards, with what was measured."""
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
            other=None if other_end is None else (other_end.deflection, other_end.load),
            off=None if sigma is None or np.isnan(sigma).all() else BAND * sigma,
        )
        lines.append(bend_line)
    measured = None
    if test.measured:
        spread = scatter(test.measured)
        # Where a repetition has ended the mean of the others jumps.
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


def how_sure(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> list[str]:
    """Return notes on the uncertainty of the loads and on assumptions."""
    lines = []
    shares = [
        float(np.nanmax(sigma)) / float(np.max(outcome.bent[i].load))
        for i, sigma in outcome.spreads.items()
        if not np.isnan(sigma).all()
    ]
    if shares:
        lines.append(
            f"By what the cards leave open of their laws, loads are off by up to "
            f"{percent(max(shares))} of the largest (one standard deviation)."
        )
    lines += [f"{words[:1].upper()}{words[1:]}." for words in outcome.unsure]
    if len(outcome.band) > 1:
        ends = "; ".join(f"{end.name}: {end.meaning}" for end in outcome.band)
        lines.append(f"The solver's answer lies between walls ({ends}).")
    assumptions = dict.fromkeys(words for test in tests for words in test.assumed)
    for words in assumptions:
        names = [test.name for test in tests if words in test.assumed]
        of_tests = "" if len(names) == len(tests) else f" for {', '.join(names)}"
        lines.append(f"Assumed{of_tests}, as the project does not say: the usual {words}.")
    return lines


def show_outcome(outcome: CylinderOutcome, out: Output) -> Exhibit:
    """Write everything below the folder and say what is where."""
    tests = tests_of(outcome)
    figures = draw_figures(outcome, out)
    files = [*_write_tables(outcome, tests, out), *write_beams(outcome, out)]
    tables = [_runs(outcome, tests), *_errors(outcome)]
    first = openings(outcome)
    parts: list[Part] = [first, *load_charts(outcome), Words(how_sure(outcome, tests))]
    lengths: dict[str, set[float]] = {
        "length, mm": {t.length for t in tests},
        "span, mm": {t.supports.span for t in tests},
        "element size, mm": {t.size for t in tests},
        "seam width, mm": {t.seam_width for t in tests},
    }
    facts = [(label, float(v.pop())) for label, v in lengths.items() if len(v) == 1]
    sentences = [_sentence(row) for row in first.rows if row[2]]
    has_summary = sentences and len(first.rows) <= SUMMED_UP
    summary = f"{'; '.join(sentences)}." if has_summary else ""
    return Exhibit(facts, figures, tables, files, parts, summary=summary)


def _in_brackets(text: object) -> str:
    return f" ({text})" if text else ""


def _sentence(row: Sequence[object]) -> str:
    """Return a row of the opening table in words."""
    test, card, stiffness, stiffness_band, *points = row
    words = [f"{test}, {card}: stiffness {stiffness}{_in_brackets(stiffness_band)} N/mm"]
    for name, cells in (("knee", points[:3]), ("limit point", points[3:])):
        load, load_band, deflection = cells
        if deflection:
            words.append(f"{name} at {load}{_in_brackets(load_band)} N and {deflection} mm")
        else:
            words.append(f"{name} {load}")
    return ", ".join(words)


def openings(outcome: CylinderOutcome) -> Table:
    """Return stiffness, knee and limit point of every prediction, with bands by card and wall."""
    rows: list[list[object]] = []
    for i, run in enumerate(outcome.runs):
        if not run.predicted:
            continue
        stiffness = outcome.with_band(i, "stiffness")
        cells = [
            f"{stiffness[0]:.3g}" if stiffness else None,
            _range_text(stiffness, ".3g"),
            *_point_cells(outcome, i, "knee"),
            *_point_cells(outcome, i, "limit"),
        ]
        rows.append(_unbroken([run.test.name, run.card, *cells]))
    header = ["test", "card", "stiffness, N/mm", "its band"]
    for name in ("knee", "limit point"):
        header += [f"load at the {name}, N", "its band", "deflection there, mm"]
    sides = [f"{100 * LEVEL:g} % by what the card leaves open"] if outcome.spreads else []
    if outcome.band:
        sides.append(f"from {' to '.join(end.name for end in outcome.band)}")
    note = f"Bands: {', '.join(sides) or 'not known'}; none where it is narrower than the digits. "
    note += "The knee is where the slope has fallen to half, the limit point the largest load, "
    note += "where the load falls afterwards."
    return Table("Stiffness, knee and limit point", header, rows, note, text=(1,))


def _point_cells(
    outcome: CylinderOutcome, number: int, name: Literal["knee", "limit"]
) -> list[str | None]:
    """Return load, band and deflection of the knee or the limit of a run."""
    measures = outcome.measures.get(number)
    load = outcome.with_band(number, name)
    if measures is None:
        return [None, None, None]
    if load is None:
        return [measures.describe(None), None, None]
    deflection, _ = getattr(measures, name)
    return [f"{load[0]:.0f}", _range_text(load, ".0f"), f"{deflection:.0f}"]


def _range_text(banded: tuple[float, float, float] | None, digits: str) -> str | None:
    """Return the ends of a band, where it has a width."""
    if banded is None:
        return None
    low, high = (f"{end:{digits}}" for end in banded[1:])
    return None if low == high else f"{low} to {high}"


def _write_tables(
    outcome: CylinderOutcome, tests: Sequence[CylinderTest], out: Output
) -> list[Shown]:
    """Write the curves, and what was measured."""
    curves = []
    for i, run in enumerate(outcome.runs):
        names = {"test": run.test.name, "card": run.card, "wall": run.wall}
        curves.append(pd.DataFrame({**names, **outcome.curve(i)}))
    description = "every curve: deflection, load, pressure, volume, wrinkled share"
    files = [out.write(CURVES_FILE, pd.concat(curves), description, None)]
    if any(test.measured for test in tests):
        description = "mean and scatter of the repetitions on a grid"
        files.append(out.write(MEASURED_FILE, measured_table(tests), description, None))
    return files


def _slopes(tests: Sequence[CylinderTest]) -> str:
    """Return over which deflection slopes are taken."""
    lengths = sorted({round(t.reading.slope_over, 6) for t in tests})
    if len(lengths) == 1:
        return f"{lengths[0]:g} mm"
    shares = {round(t.reading.slope_over / t.diameter, 9) for t in tests}
    ends = f"{lengths[0]:g} to {lengths[-1]:g} mm"
    return f"{shares.pop():g} diameters ({ends})" if len(shares) == 1 else ends


def _name_cells(outcome: CylinderOutcome, run: PredictedRun) -> list[object]:
    """Return test and card of a run, and its wall where the solver has a band."""
    return [run.test.name, run.card, *([run.wall] if outcome.band else [])]


def _name_header(outcome: CylinderOutcome) -> list[str]:
    return ["test", "card", *(["wall"] if outcome.band else [])]


def _runs(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> Table:
    """Return the table of all runs."""
    places = place_names(tests)
    rows = []
    for i, run in enumerate(outcome.runs):
        m = outcome.measures.get(i)
        cells: Sequence[object] = [None] * (6 + len(places))
        if m is not None:
            cells = _measure_cells(m, outcome.sigma(i), places)
        tail = [
            outcome.ended(i),
            ", ".join(marks_of(run.notes)) or None,
            len(run.notes),
            round(run.record.seconds, 1),
        ]
        rows.append(_unbroken([*_name_cells(outcome, run), *cells, *tail]))
    names = _name_header(outcome)
    header = [
        *names,
        *("stiffness, N/mm", "knee", "limit point", "wrinkles from"),
        *(f"load at {place}, N" for place in places),
        *("inflation strain, %", "pressure, kPa", "ended", "marked", "notes", "s"),
    ]
    slopes = _slopes(tests)
    note = (
        f"Stiffness: to {slopes} of deflection. Knee: where the slope over {slopes} has fallen to "
        "half of it. Limit point: the largest load, where the load falls afterwards. Wrinkles: "
        "more of the surface than when inflated. Inflation strain: the largest along warp or fill "
        "in the body, without the quads beside seam and caps. Pressure: its rise to the last frame."
        " Marked: the kinds of notes that speak against a run's numbers; the notes stand below."
    )
    if outcome.spreads:
        laws = sorted({run.around.words for run in outcome.runs if run.around is not None})
        note += (
            " ±: one standard deviation of the load by what the card leaves open of its law "
            f"({'; '.join(laws)} around it), which is no part of the band of the walls."
        )
    text_columns = (*range(1, len(names)), header.index("ended"), header.index("marked"))
    return Table("Runs", header, rows, note, text=text_columns)


def _measure_cells(
    m: BendingMeasures, sigmas: Mapping[str, float | None], places: Sequence[str]
) -> list[object]:
    """Return the cells of a run that ended, from stiffness to rise of pressure."""
    loads: list[str | None] = []
    for place in places:
        load = m.loads.get(place)
        loads.append(None if load is None else describe_load(load, sigmas.get(place)))
    return [
        None if m.stiffness is None else f"{m.stiffness:.2f}",
        m.describe(m.knee),
        m.describe(m.limit),
        f"{m.wrinkles.deflection:.0f} mm" if m.wrinkles else None,
        *loads,
        f"{100 * max(m.body_strain):.2g}",
        f"{m.pressure_rise:+.2f}",
    ]


def _errors(outcome: CylinderOutcome) -> list[Table]:
    """Return the tables of what is measured too: quantities, and loads reading by reading."""
    rows = []
    for i, m in outcome.measures.items():
        if m.error is not None:
            cells = [
                m.error.rms,
                percent(m.error.relative),
                f"{m.error.mean:+.1f}",
                m.error.compared,
                m.error.beyond_count,
            ]
            rows.append(_unbroken([*_name_cells(outcome, outcome.runs[i]), *cells]))
    if not rows:
        return []
    names = _name_header(outcome)
    header = [*names, "RMS, N", "of the largest load", "mean, N", "readings", "beyond"]
    note = "Model less reading at every reading that the model reaches; beyond: those it does not."
    text_columns = tuple(range(1, len(names)))
    errors = Table("Against measured loads", header, rows, note, text=text_columns)
    return [*_measured_quantities(outcome), errors]


def _measured_quantities(outcome: CylinderOutcome) -> list[Table]:
    """Return the table of stiffness, knee, limit point and loads beside measured ones, if any."""
    places = place_names(run.test for run in outcome.runs)
    quantities = [*CURVE_PROPERTIES, *(f"load at {place}" for place in places)]
    rows = []
    for i, m in outcome.measures.items():
        if m.against is None:
            continue
        cells = _name_cells(outcome, outcome.runs[i])
        for quantity in quantities:
            pair = m.against.pairs.get(quantity)
            cells += [None, None] if pair is None else _pair_cells(*pair)
        rows.append(_unbroken(cells))
    if not rows:
        return []
    names = _name_header(outcome)
    header = list(names)
    for quantity in quantities:
        unit = "N/mm" if quantity.endswith("stiffness") else "N"
        header += [f"{quantity}, {unit}", "of it"]
    low, high = (f"{100 * share:g}" for share in (CRITERIA.secant_from, CRITERIA.secant_to))
    note = "Measured (mean of the repetitions), and predicted over measured. Secant stiffness: "
    note += f"between {low} and {high} % of each curve's load at the last place that all reach; "
    note += "secant knee: where the slope is half of that. Measured curves begin with friction: "
    note += "neither is the stiffness or the knee of the tables above, which begin at zero load."
    return [Table("Measured quantities", header, rows, note, text=tuple(range(1, len(names))))]


def _pair_cells(predicted: float, measured: float) -> list[str]:
    return [f"{measured:.4g}", f"{predicted / measured:.3f}"]


def _unbroken(row: Sequence[object]) -> list[object]:
    """Return the row with names and numbers that stay on one line."""
    return [
        cell.replace(" ", "\u00a0")
        if isinstance(cell, str) and len(cell) < UNBROKEN_LETTERS
        else cell
        for cell in row
    ]


def simulate(
    test: CylinderTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Write load_deflection.csv, figures and beams; return the numbers of every card."""
    predicted = []
    for name, card in cards.items():
        run = runs[name, PART]
        record = record_of(CylinderPredicted(), run.model, run.outcome)
        predicted.append(PredictedRun(test, name, card, run.model, record))
    outcome = CylinderOutcome(predicted)
    if outcome.measures:
        show_outcome(outcome, out)
    numbers = {
        name: {"ended": outcome.ended(i), **(outcome.numbers(i) if i in outcome.measures else {})}
        for i, name in enumerate(cards)
    }
    return Simulation({"cards": numbers}, outcome.lines())


# Charts: load over deflection, the gas, and the bent beam

MM3_PER_LITRE = 1e6
COLLAR_DEFLECTION = "deflection of the collar, mm"
#: Colour of what was measured.
MEASURED_COLOUR = 7
#: mm of the collar's wall, which the model does not have: only for the eye.
COLLAR_WALL = 12.0
#: Beside the collar, in its lengths: how far the close view goes.
CLOSE_VIEW = 2.2


@dataclass(frozen=True, eq=False)
class BendLine:
    """The curve of one card.

    Parameters
    ----------
    name : str
        Of the card.
    rank : int
        Of its colour, the same in every figure.
    deflection, load, pressure, volume : (frames,) arrays
        mm, N, MPa, mm^3.
    knee, limit : CurvePoint, optional
        Where they are.
    rms : float, optional
        Against what was measured, N.
    other : (deflection, load), optional
        The other end of a band that begins at the curve, mm and N.
    off : (frames,) array, optional
        How far the load may be off to either side by what the card leaves open, N.
    """

    name: str
    rank: int
    deflection: Array
    load: Array
    pressure: Array | None = None
    volume: Array | None = None
    knee: CurvePoint | None = None
    limit: CurvePoint | None = None
    rms: float | None = None
    other: tuple[ArrayLike, ArrayLike] | None = None
    off: Array | None = None

    @property
    def colour(self) -> int:
        """Return the number of its colour."""
        return 1 + self.rank % 6


@dataclass(frozen=True, eq=False)
class BendPanel:
    """One case: a curve a card, and repetitions with their scatter.

    Parameters
    ----------
    title : str
        Of the chart.
    lines : sequence of BendLine
        A curve a card.
    readings : sequence of BendingCurve
        What was measured.
    measured : BendingScatter, optional
        Its mean and scatter.
    spread : str
        What curves may be off by, in words.
    along : str
        Label of the deflection.
    """

    title: str
    lines: Sequence[BendLine] = ()
    readings: Sequence[BendingCurve] = ()
    measured: BendingScatter | None = None
    spread: str = ""
    along: str = COLLAR_DEFLECTION


@dataclass(frozen=True)
class BeamBodies:
    """Rigid bodies when bent.

    Parameters
    ----------
    supports : tuple of (z, y)
        Axes of the supports, mm.
    support_radius, collar_radius, collar_length : float
        mm.
    collar_height : float
        y of the collar's axis, mm.
    collars : tuple of float
        z of each collar, or strap, mm.
    """

    supports: tuple[tuple[float, float], ...]
    support_radius: float
    collar_height: float
    collar_radius: float
    collar_length: float
    collars: tuple[float, ...] = (0.0,)

    @property
    def name(self) -> str:
        """Return the name of what loads the beam."""
        return "collar" if self.collars == (0.0,) else "strap"


def bending_charts(
    panels: Sequence[BendPanel], caption: str = "", columns: int = 0, misses: bool = False
) -> Charts:
    """Return load over deflection, a chart a case.

    Parameters
    ----------
    panels : sequence of BendPanel
        The cases.
    caption : str
        Of the charts.
    columns : int
        How many charts a row has, which then have the same loads; 0: as they fit.
    misses : bool
        Whether charts of model less measurement follow.
    """
    drawn_panels = [panel for panel in panels if panel.lines or columns > 1]
    charts = [_load_chart(panel) for panel in drawn_panels]
    if columns > 1:
        rows = [charts[k : k + columns] for k in range(0, len(charts), columns)]
        x_range = _common_range(charts, "x")
        charts = [
            replace(chart, x_range=x_range, y_range=_common_range(row, "y"))
            for row in rows
            for chart in row
        ]
    if misses:
        charts += [_miss_chart(panel) for panel in drawn_panels if panel.measured is not None]
    return Charts("loads", charts, caption, columns)


def _common_range(charts: Sequence[Chart], axis: str) -> tuple[float, float]:
    """Return the range of an axis that holds all that several charts draw."""
    fields = ("x",) if axis == "x" else ("y", "upper")
    values = [
        value
        for chart in charts
        for series in chart.series
        for field in fields
        for value in getattr(series, field)
        if value is not None
    ]
    return 0.0, 1.06 * max(values, default=0.0) or 1.0


def _load_chart(panel: BendPanel) -> Chart:
    """Return load over deflection of one case."""
    series = _measured_series(panel)
    for curve in panel.lines:
        series += _line_series(curve)
    if panel.spread and any(curve.off is not None for curve in panel.lines):
        series.append(band(panel.spread, (), (), (), colour=panel.lines[0].colour))
    errors = [(curve.name, curve.rms) for curve in panel.lines if curve.rms is not None]
    highest = max((float(curve.load.max()) for curve in panel.lines), default=0.0)
    alt = f"{panel.title}: load over deflection, up to {highest:.4g} N"
    alt += "".join(f"; {name}: RMS error {rms:.3g} N" for name, rms in errors)
    title = panel.title
    if len(errors) == 1:
        title += f": RMS error {errors[0][1]:.3g} N"
    return Chart(title, panel.along, "load, N", series, alt, from_zero=True)


def _measured_series(panel: BendPanel) -> list[Series]:
    """Return scatter, mean and readings of what was measured, if anything was."""
    measured = panel.measured
    if measured is None:
        return []
    low = measured.mean - measured.deviation
    high = measured.mean + measured.deviation
    deflection = measured.deflection
    colour = MEASURED_COLOUR
    return [
        band("scatter of repetitions (±)", deflection, low, high, colour=colour),
        line("mean", deflection, measured.mean, colour=colour, wide=True),
        *(dots("measured", c.deflection, c.load, colour=colour) for c in panel.readings),
    ]


def _line_series(curve: BendLine) -> list[Series]:
    """Return a curve with its band, the other end, knee and limit point."""
    colour = curve.colour
    off = curve.off
    limits = None if off is None else (curve.load - off, curve.load + off)
    series = [line(curve.name, curve.deflection, curve.load, limits, colour=colour)]
    if curve.other is not None:
        series.append(line(f"{curve.name}, other end", *curve.other, colour=colour, dashes=1))
    marks_drawn = (("knee", curve.knee, "diamond"), ("limit point", curve.limit, "triangle-up"))
    for name, point, shape in marks_drawn:
        if point is not None:
            x = [point[0]]
            y = [point[1]]
            series.append(dots(name, x, y, colour=colour, shape=shape, hollow=True))
    return series


def _miss_chart(panel: BendPanel) -> Chart:
    """Return model less mean of the readings over deflection, of one case."""
    measured = panel.measured
    assert measured is not None
    deflection = measured.deflection
    spread = measured.deviation
    series = [
        band("scatter of repetitions (±)", deflection, -spread, spread, colour=MEASURED_COLOUR)
    ]
    for curve in panel.lines:
        load = np.interp(deflection, curve.deflection, curve.load, left=np.nan, right=np.nan)
        series.append(line(curve.name, deflection, load - measured.mean, colour=curve.colour))
    errors = [f"{curve.name} {curve.rms:.3g} N" for curve in panel.lines if curve.rms is not None]
    title = f"RMS error: {', '.join(errors)}" if errors else ""
    alt = f"{panel.title}: model less mean of the readings"
    return Chart(title, panel.along, "model − mean, N", series, alt, level=0.0)


def gas_charts(panel: BendPanel) -> Charts:
    """Return gauge pressure against change of volume and against deflection."""
    by_volume: list[Series] = []
    by_deflection: list[Series] = []
    for curve in panel.lines:
        assert curve.pressure is not None and curve.volume is not None
        pressure = 1e3 * curve.pressure
        volume = curve.volume / MM3_PER_LITRE
        name = f"{curve.name}, from {volume[0]:.4g} litres"
        by_volume.append(line(name, volume - volume[0], pressure, colour=curve.colour))
        by_deflection.append(line(name, curve.deflection, pressure, colour=curve.colour))
    x_label = "volume less that when inflated, litres"
    y_label = "gauge pressure, kPa"
    over_volume, over_deflection = (
        f"{panel.title}: pressure over {name}" for name in ("volume", "deflection")
    )
    charts = [
        Chart(panel.title, x_label, y_label, by_volume, over_volume),
        Chart("", panel.along, y_label, by_deflection, over_deflection),
    ]
    return Charts("gas", charts, "")


def beam_charts(
    positions: Array,
    cells: NDArray[np.intp],
    strain: Array,
    outline: Array,
    section: tuple[Array, Array],
    bodies: BeamBodies,
    title: str = "",
) -> Charts:
    """Return a whole beam true to scale, coloured by its strain along the axis.

    Parameters
    ----------
    positions : (n, 3) array
        Of the nodes of the bent beam, mm; z along the axis, y up.
    cells : (m, 4) array of int
        Nodes of the quads.
    strain : (m,) array
        Log strain along the axis when bent.
    outline : (k, 2) array
        The inflated beam from the side as a closed line (z, y), mm.
    section : two (k, 2) arrays
        The mid-span ring as a closed line (x, y), inflated and bent, mm.
    bodies : BeamBodies
        Supports and collar when bent.
    title : str
        Of the first chart.
    """
    # Wrinkles take up many times the strain that the fabric carries: all of them one colour.
    largest = max(float(strain.max()), 1e-6)
    values = np.clip(strain, -largest, largest)
    # Of the two halves the eye sees one; what is nearer hides what is behind.
    visible = np.flatnonzero(positions[cells, 0].mean(axis=1) >= 0)
    visible = visible[np.argsort(positions[cells[visible], 0].mean(axis=1))]
    side = [
        faces("", positions[cells[visible]][:, :, [2, 1]], values[visible]),
        line("inflated", *outline.T, colour=7, dashes=1),
        *_body_lines(bodies),
    ]
    ring = bodies.collar_radius + COLLAR_WALL
    middle = bodies.collar_height
    feet = [y - bodies.support_radius for _, y in bodies.supports]
    low = min(float(positions[:, 1].min()), middle - ring, *feet)
    high = max(float(positions[:, 1].max()), float(outline[:, 1].max()), middle + ring)
    end = float(np.abs(positions[:, 2]).max())
    scale: dict[str, Any] = {
        "equal": True,
        "scale": "log strain along the axis",
        "shades": shades_of(values),
    }
    whole = Chart(
        title,
        "z, mm",
        "y, mm",
        side,
        f"{title}: the bent beam from the side",
        x_range=(-1.03 * end, 1.03 * end),
        y_range=(low - 20, high + 20),
        **scale,
    )
    position = bodies.collars[-1]
    reach = CLOSE_VIEW * bodies.collar_length
    half_height = bodies.collar_radius + 4 * COLLAR_WALL
    close = Chart(
        f"at the {bodies.name}",
        "z, mm",
        "y, mm",
        side,
        f"the bent beam at the {bodies.name}",
        x_range=(position - reach, position + reach),
        y_range=(middle - half_height, middle + half_height),
        **scale,
    )
    return Charts("beam", [whole, close, _cut_chart(section, bodies)], "", columns=2)


def _body_lines(bodies: BeamBodies) -> list[Series]:
    """Return supports and collars from the side."""
    series = [
        line("support", *_circle(z, y, bodies.support_radius), colour=3) for z, y in bodies.supports
    ]
    half = 0.5 * bodies.collar_length
    radius = bodies.collar_radius
    for z in bodies.collars:
        for y in (bodies.collar_height - radius - COLLAR_WALL, bodies.collar_height + radius):
            x = [z - half, z + half, z + half, z - half, z - half]
            top = y + COLLAR_WALL
            series.append(line(bodies.name, x, [y, y, top, top, y], colour=0))
    return series


def _circle(x: float, y: float, radius: float) -> tuple[Array, Array]:
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    return x + radius * np.cos(angle), y + radius * np.sin(angle)


def _cut_chart(section: tuple[Array, Array], bodies: BeamBodies) -> Chart:
    """Return the section at mid-span with the collar."""
    inflated, bent = section
    circle = _circle(0.0, bodies.collar_height, bodies.collar_radius + 0.5 * COLLAR_WALL)
    series = [line("collar", *circle)] if 0.0 in bodies.collars else []
    series += [
        line("inflated", *inflated.T, colour=7, dashes=1),
        line("bent", *bent.T, colour=3),
    ]
    alt = "the beam cut at mid-span, inflated and bent"
    return Chart("cut at mid-span", "x, mm", "y, mm", series, alt, equal=True)


class CylinderPresenter(PagePresenter):
    """Presents bent cylinders."""

    simulate = staticmethod(simulate)
    show_outcome = staticmethod(show_outcome)


KINDS.register(CylinderKind, CylinderPresenter())
