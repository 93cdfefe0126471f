"""Results of bent cylinders as facts, figures, tables and files; last the charts."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ...errors import marks, percent
from ...materials.card import BAND, LEVEL
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh, surface_strain, with_mirror_image
from ...readers.bending import BendingCurve, BendingScatter, scatter
from ...reports.charts import Chart, Charts, Series, band, dots, faces, line, shades_of
from ...reports.content import Exhibit, Part, Table, Words
from ...reports.maps import write_vtu
from ...reports.vega import save
from ..kinds import Array, Cards, Output, PredictedRun, Runs, Shown, Simulation, record_of
from .curve import CRITERIA, CURVE_PROPERTIES
from .predicted import CylinderOutcome, CylinderPredicted, measured_table, place_names
from .run import BendingRun
from .terminal import describe_load
from .test import PART, CylinderTest

#: Node sets that the picture draws as lines.
LINES = ("mid_span", "top_line", "bottom_line")


#: The whole cylinder: mesh (mm, with warp), displacements (nodes, 3) when inflated and at the end.
Beam = tuple[Mesh, Array, Array]


def whole_beam(model: CylinderModel | BeamModel, run: BendingRun) -> Beam:
    """Return the meshed part and its mirror images."""
    mesh = model.mesh
    assert mesh.warp is not None
    points, quads, warp = mesh.points, mesh.quads, mesh.warp
    moves = [run.inflated, run.bent]
    number = np.arange(len(points))
    lines = {name: np.isin(number, mesh.node_sets[name]) for name in LINES}
    for axis, name in ((0, "symmetry_x"), (2, "symmetry_z")):
        if name not in mesh.node_sets:
            continue
        turned = np.where(np.arange(3) == axis, -1.0, 1.0)
        count = len(points)
        points, quads, source = with_mirror_image(points, quads, axis)
        sign = np.where((np.arange(len(points)) < count)[:, None], 1.0, turned)
        moves = [u[source] * sign for u in moves]
        warp = np.concatenate([warp, warp * turned])
        lines = {name: line[source] for name, line in lines.items()}
    sets = {name: np.flatnonzero(line) for name, line in lines.items()}
    return Mesh(points, quads, sets, {}, warp), moves[0], moves[1]


def bodies_of(model: CylinderModel | BeamModel, beam: Beam, deflection: float) -> BeamBodies:
    """Return supports and collar, placed to touch the inflated beam; straps hang on its axis."""
    mesh, inflated, bent = beam
    if isinstance(model, BeamModel):
        z, size = model.supports.span, model.supports.diameter
        rows, row = np.unique(np.round(mesh.points[:, 2], 3), return_inverse=True)
        axis = np.bincount(row, (mesh.points + bent)[:, 1]) / np.bincount(row)
        strap = np.interp(0.5 * model.load_spacing, rows, axis)
        spots = sorted({-0.5 * model.load_spacing, 0.5 * model.load_spacing})
        low = -max(model.roller_below, model.section.radius + 0.5 * size)
        return BeamBodies(
            ((-0.5 * z, low), (0.5 * z, low)), 0.5 * size, float(strap), model.section.radius,
            model.collar.length, tuple(spots),
        )  # fmt: skip
    at = mesh.points + inflated
    radius, half = 0.5 * model.supports.width, 0.5 * model.supports.span
    beside = np.abs(np.abs(at[:, 2]) - half)
    near = beside < radius
    height = float((at[near, 1] - np.sqrt(radius**2 - beside[near] ** 2)).min())
    inner, middle = 0.5 * model.collar.inner_diameter, 0.5 * model.collar.spacing
    along = np.abs(np.abs(at[:, 2]) - middle) <= 0.5 * model.collar.length
    inside = along & (np.abs(at[:, 0]) < inner)
    top = float((at[inside, 1] - np.sqrt(inner**2 - at[inside, 0] ** 2)).max())
    return BeamBodies(
        ((-half, height), (half, height)), radius, top - deflection, inner, model.collar.length,
        tuple(sorted({-middle, middle})),
    )  # fmt: skip


def draw_beam(model: CylinderModel | BeamModel, run: BendingRun, path: Path, title: str) -> None:
    """Draw the last frame."""
    mesh, *moves = beam = whole_beam(model, run)
    rest, sets = mesh.points, mesh.node_sets
    nodes, top, bottom = (sets[name] for name in LINES)
    around = np.argsort(np.arctan2(rest[nodes, 0], rest[nodes, 1]))
    ring = np.append(nodes[around], nodes[around[0]])
    top, bottom = (line[np.argsort(rest[line, 2])] for line in (top, bottom))
    outline = np.concatenate([top, bottom[::-1], top[:1]])
    inflated, bent = (rest + moved for moved in moves)
    strain = surface_strain(mesh, moves[1])[:, 0]
    lines = inflated[outline][:, [2, 1]], (inflated[ring, :2], bent[ring, :2])
    bodies = bodies_of(model, beam, float(run.deflection[-1]))
    save(path, beam_charts(bent, mesh.quads, strain, *lines, bodies, title))


def write_beam(model: CylinderModel | BeamModel, run: BendingRun, path: Path) -> None:
    """Write the last frame for ParaView, with the inflated one as a further displacement."""
    mesh, inflated, bent = whole_beam(model, run)
    strains = {
        "log_strain_1_2_12": surface_strain(mesh, bent),
        "inflated_log_strain_1_2_12": surface_strain(mesh, inflated),
    }
    write_vtu(mesh, bent, path, {"inflated_displacement": inflated}, strains)


FIGURES, BEAMS = "figures", "beams"


def draw_figures(outcome: CylinderOutcome, out: Output) -> list[Shown]:
    """Draw loads, gas and beam of every test, and all loads; return those of the page."""
    tests = tests_of(outcome)
    names = file_names([test.name for test in tests])
    panels, figures = {test.name: _panel(test, outcome) for test in tests}, []
    for test in tests:
        if not (ended := _ended(test, outcome)):
            continue
        stem, panel = f"{FIGURES}/{names[test.name]}", panels[test.name]
        save(out.path(f"{stem}-load.png"), bending_charts([panel], misses=True, columns=1))
        save(out.path(f"{stem}-gas.png"), gas_charts(panel))
        first, run = outcome.runs[ended[0]], outcome.bent[ended[0]]
        drawn = f"{test.name}, {first.card}, {run.deflection[-1]:g} mm"
        draw_beam(first.model, run, out.path(f"{stem}-beam.png"), drawn)
        figures += [
            (out.name(f"{stem}-beam.png"), f"{test.name}: the bent beam, card {first.card}"),
            (out.name(f"{stem}-gas.png"), f"{test.name}: the gas while bending"),
        ]
    if sum(bool(panel.lines) for panel in panels.values()) > 1:
        # A row a diameter, where several diameters have several pressures.
        sizes: dict[float, list[CylinderTest]] = {}
        for test in tests:
            sizes.setdefault(round(test.diameter, 6), []).append(test)
        rows = list(sizes.values())
        if len(rows) == 1 or max(map(len, rows)) == 1:
            rows = [tests[i : i + 3] for i in range(0, len(tests), 3)]
        columns = max(map(len, rows))
        laid = [
            panels[row[k].name] if k < len(row) else BendPanel("")
            for row in rows
            for k in range(columns)
        ]
        save(out.path(f"{FIGURES}/all-loads.png"), bending_charts(laid, columns=columns))
    return figures


def load_charts(outcome: CylinderOutcome) -> list[Charts]:
    """Return charts of load over deflection of every test; none where no run ended."""
    panels = [_panel(test, outcome) for test in tests_of(outcome)]
    if not any(panel.lines for panel in panels):
        return []
    caption = "Load over deflection"
    if len(outcome.band) > 1:
        predicted, *others = (end.name for end in outcome.band)
        caption += f"; line: {predicted}, dashed: {', '.join(others)}"
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
        wall = "" if run.predicted else f"-{file_names([run.wall])[run.wall]}"
        name = f"{BEAMS}/{tests[run.test.name]}-{cards[run.card]}{wall}.vtu"
        write_beam(run.model, bent, out.path(name))
        what = f"the beam at {bent.deflection[-1]:g} mm, for ParaView"
        files.append((out.name(name), what if run.predicted else f"{what} ({run.wall})"))
    return files


def tests_of(outcome: CylinderOutcome) -> list[CylinderTest]:
    """Return the tests of the runs, each once."""
    return list({id(run.test): run.test for run in outcome.runs}.values())


def file_names(names: Sequence[str]) -> dict[str, str]:
    """Return different file names for each."""
    files: dict[str, str] = {}
    for number, name in enumerate(names, start=1):
        plain = re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-.") or str(number)
        taken = plain.casefold() in (other.casefold() for other in files.values())
        files[name] = f"{plain}-{number}" if taken else plain
    return files


def _ended(test: CylinderTest, outcome: CylinderOutcome) -> list[int]:
    """Return the runs of a test that did not fail, of what the solver predicts."""
    runs = outcome.runs
    return [i for i in outcome.bent if runs[i].test is test and runs[i].predicted]


def _panel(test: CylinderTest, outcome: CylinderOutcome) -> BendPanel:
    cards, lines = list(dict.fromkeys(run.card for run in outcome.runs)), []
    for i in _ended(test, outcome):
        run, m, card = outcome.bent[i], outcome.measures[i], outcome.runs[i].card
        rms = None if m.error is None else m.error.rms
        curves = run.deflection, run.load, run.pressure, run.volume
        other = outcome.other_end(i)
        band = None if other is None else (outcome.bent[other].deflection, outcome.bent[other].load)
        sure = outcome.spreads.get(i)
        off = None if sure is None or np.isnan(sure).all() else BAND * sure
        lines.append(BendLine(card, cards.index(card), *curves, m.knee, m.limit, rms, band, off))
    measured = None
    if test.measured:
        s = scatter(test.measured)
        # Where a repetition has ended the mean of the others jumps.
        whole = s.count == len(test.measured)
        mean, deviation = (np.where(whole, own, np.nan) for own in (s.mean, s.deviation))
        measured = replace(s, mean=mean, deviation=deviation)
    beam = any(isinstance(run.model, BeamModel) for run in outcome.runs if run.test is test)
    along = "deflection of mid-span, mm" if beam else ALONG
    spread = f"{100 * LEVEL:g} % by the card"
    return BendPanel(test.name, lines, test.measured, measured, spread, along)


def how_sure(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> list[str]:
    """Return notes on the uncertainty of the loads and on assumptions."""
    lines = []
    shares = [float(np.nanmax(s)) / float(np.max(outcome.bent[i].load))
              for i, s in outcome.spreads.items() if not np.isnan(s).all()]  # fmt: skip
    if shares:
        lines.append(
            f"By what the cards leave open of their laws, loads are off by up to "
            f"{percent(max(shares))} of the largest (one standard deviation)."
        )
    lines += [f"{words[:1].upper()}{words[1:]}." for words in outcome.unsure]
    if len(outcome.band) > 1:
        ends = "; ".join(f"{end.name}: {end.meaning}" for end in outcome.band)
        lines.append(f"The solver's answer lies between walls ({ends}).")
    for words in dict.fromkeys(words for test in tests for words in test.assumed):
        own = [test for test in tests if words in test.assumed]
        of = "" if len(own) == len(tests) else f" for {', '.join(t.name for t in own)}"
        lines.append(f"Assumed{of}, as the project does not say: the usual {words}.")
    return lines


#: Predictions that the page sums up in its first sentence.
SENTENCES = 4
#: Letters of a cell that is not broken.
SHORT = 30
CURVES = "load_deflection.csv"
MEASURED = "measured.csv"


def show_outcome(outcome: CylinderOutcome, out: Output) -> Exhibit:
    """Write everything below the folder and say what is where."""
    tests = tests_of(outcome)
    figures = draw_figures(outcome, out)
    files = [*_write_tables(outcome, tests, out), *write_beams(outcome, out)]
    tables = [_runs(outcome, tests), *_errors(outcome)]
    first = openings(outcome)
    parts: list[Part] = [first, *load_charts(outcome), Words(how_sure(outcome, tests))]
    sentences = [_sentence(row) for row in first.rows if row[2]]
    lines = sentences if len(first.rows) <= SENTENCES else []
    shared = (
        ("length, mm", {t.length for t in tests}),
        ("span, mm", {t.supports.span for t in tests}),
        ("element size, mm", {t.size for t in tests}),
        ("seam width, mm", {t.seam_width for t in tests}),
    )
    facts = [(label, float(values.pop())) for label, values in shared if len(values) == 1]
    summary = f"{'; '.join(lines)}." if lines else ""
    return Exhibit(facts, figures, tables, files, parts, summary=summary)


def _in(band: object) -> str:
    return f" ({band})" if band else ""


def _sentence(row: Sequence[object]) -> str:
    """Return a row of the opening table in words."""
    test, card, stiffness, band, *points = row
    words = [f"{test}, {card}: stiffness {stiffness}{_in(band)} N/mm"]
    for name, cells in (("knee", points[:3]), ("limit point", points[3:])):
        load, band, deflection = cells
        if deflection:
            words.append(f"{name} at {load}{_in(band)} N and {deflection} mm")
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
        cells = [f"{stiffness[0]:.3g}" if stiffness else None, _to(stiffness, ".3g")]
        points: tuple[Literal["knee", "limit"], ...] = ("knee", "limit")
        for name in points:
            cells += _point_cells(outcome, i, name)
        rows.append(_unbroken([run.test.name, run.card, *cells]))
    header = ["test", "card", "stiffness, N/mm", "its band"]
    for name in ("knee", "limit point"):
        header += [f"load at the {name}, N", "its band", "deflection there, mm"]
    sides = [f"{100 * LEVEL:g} % by what the card leaves open"] if outcome.spreads else []
    sides += [f"from {' to '.join(end.name for end in outcome.band)}"] if outcome.band else []
    note = f"Bands: {', '.join(sides) or 'not known'}; none where it is narrower than the digits. "
    note += "The knee is where the slope has fallen to half, the limit point the largest load, "
    note += "where the load falls afterwards."
    return Table("Stiffness, knee and limit point", header, rows, note, text=(1,))


def _point_cells(
    outcome: CylinderOutcome, number: int, name: Literal["knee", "limit"]
) -> list[str | None]:
    """Return load, band and deflection of the knee or the limit of a run."""
    measures, load = outcome.measures.get(number), outcome.with_band(number, name)
    if measures is None:
        return [None, None, None]
    if load is None:
        return [measures.describe(None), None, None]
    deflection, _ = getattr(measures, name)
    return [f"{load[0]:.0f}", _to(load, ".0f"), f"{deflection:.0f}"]


def _to(found: tuple[float, float, float] | None, form: str) -> str | None:
    """Return the ends of a band, where it has a width."""
    low, high = ("", "") if found is None else (f"{end:{form}}" for end in found[1:])
    return None if low == high else f"{low} to {high}"


def _write_tables(
    outcome: CylinderOutcome, tests: Sequence[CylinderTest], out: Output
) -> list[Shown]:
    curves = [
        pd.DataFrame({"test": r.test.name, "card": r.card, "wall": r.wall, **outcome.curve(i)})
        for i, r in enumerate(outcome.runs)
    ]
    what = "every curve: deflection, load, pressure, volume, wrinkled share"
    files = [out.write(CURVES, pd.concat(curves), what, None)]
    if any(test.measured for test in tests):
        what = "mean and scatter of the repetitions on a grid"
        files.append(out.write(MEASURED, measured_table(tests), what, None))
    return files


def _slopes(tests: Sequence[CylinderTest]) -> str:
    over = sorted({round(t.reading.slope_over, 6) for t in tests})
    if len(over) == 1:
        return f"{over[0]:g} mm"
    shares = {round(t.reading.slope_over / t.diameter, 9) for t in tests}
    ends = f"{over[0]:g} to {over[-1]:g} mm"
    return f"{shares.pop():g} diameters ({ends})" if len(shares) == 1 else ends


def _runs(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> Table:
    places, rows = place_names(tests), []
    walls = ["wall"] if outcome.band else []
    for i, run in enumerate(outcome.runs):
        m = outcome.measures.get(i)
        head: list[object] = [run.test.name, run.card, *(walls and [run.wall])]
        tail: list[object] = [outcome.ended(i), ", ".join(marks(run.notes)) or None]
        tail += [len(run.notes), round(run.record.seconds, 1)]
        if m is None:
            rows.append([*head, *[None] * (6 + len(places)), *tail])
            continue
        points = m.describe(m.knee), m.describe(m.limit)
        wrinkles = f"{m.wrinkles[0]:.0f} mm" if m.wrinkles else None
        strain, rise = f"{100 * max(m.body_strain):.2g}", f"{m.pressure_rise:+.2f}"
        stiffness = None if m.stiffness is None else f"{m.stiffness:.2f}"
        spread = outcome.sigma(i)
        loads = [(m.loads.get(place), spread.get(place)) for place in places]
        listed = [None if one[0] is None else describe_load(*one) for one in loads]
        rows.append([*head, stiffness, *points, wrinkles, *listed, strain, rise, *tail])
    header = [
        "test", "card", *walls, "stiffness, N/mm", "knee", "limit point", "wrinkles from",
        *(f"load at {place}, N" for place in places),
        "inflation strain, %", "pressure, kPa", "ended", "marked", "notes", "s",
    ]  # fmt: skip
    slopes = _slopes(tests)
    note = (
        f"Stiffness: to {slopes} of deflection. Knee: where the slope over {slopes} has fallen to "
        "half of it. Limit point: the largest load, where the load falls afterwards. Wrinkles: "
        "more of the surface than when inflated. Inflation strain: the largest along warp or fill "
        "in the body, without the quads beside seam and caps. Pressure: its rise to the last frame."
        " Marked: the kinds of notes that speak against a run's numbers; the notes stand below."
    )
    if outcome.spreads:
        how = sorted({run.around.words for run in outcome.runs if run.around is not None})
        note += (
            " ±: one standard deviation of the load by what the card leaves open of its law "
            f"({'; '.join(how)} around it), which is no part of the band of the walls."
        )
    named = range(1, header.index("stiffness, N/mm"))
    text = (*named, header.index("ended"), header.index("marked"))
    return Table("Runs", header, [_unbroken(row) for row in rows], note, text=text)


def _errors(outcome: CylinderOutcome) -> list[Table]:
    """Return the tables of what is measured too: quantities, and loads reading by reading."""
    walls = ["wall"] if outcome.band else []
    places = place_names(run.test for run in outcome.runs)
    compared = [*CURVE_PROPERTIES, *(f"load at {place}" for place in places)]
    rows, beside = list[list[object]](), list[list[object]]()
    for i, m in outcome.measures.items():
        run = outcome.runs[i]
        head: list[object] = [run.test.name, run.card, *(walls and [run.wall])]
        if (error := m.error) is not None:
            numbers = [error.rms, percent(error.relative), f"{error.mean:+.1f}"]
            rows.append(_unbroken([*head, *numbers, error.compared, error.beyond]))
        if m.against is not None:
            for pair in map(m.against.pairs.get, compared):
                of = None if pair is None else f"{pair[0] / pair[1]:.3f}"
                head += [None if pair is None else f"{pair[1]:.4g}", of]
            beside.append(_unbroken(head))
    if not rows:
        return []
    named = ["test", "card", *walls]
    header = [*named, "RMS, N", "of the largest load", "mean, N", "readings", "beyond"]
    note = "Model less reading at every reading that the model reaches; beyond: those it does not."
    text = tuple(range(1, len(named)))
    over = (f"{name}, {'N/mm' if name.endswith('stiffness') else 'N'}" for name in compared)
    columns = [*named, *(words for name in over for words in (name, "of it"))]
    low, high = (f"{100 * share:g}" for share in (CRITERIA.secant_from, CRITERIA.secant_to))
    how = "Measured (mean of the repetitions), and predicted over measured. Secant stiffness: "
    how += f"between {low} and {high} % of each curve's load at the last place that all reach; "
    how += "secant knee: where the slope is half of that. Measured curves begin with friction: "
    how += "neither is the stiffness or the knee of the tables above, which begin at zero load."
    quantities = [Table("Measured quantities", columns, beside, how, text=text)] if beside else []
    return [*quantities, Table("Against measured loads", header, rows, note, text=text)]


def _unbroken(row: Sequence[object]) -> list[object]:
    """Return the row with names and numbers that stay on one line."""
    return [c.replace(" ", "\u00a0") if isinstance(c, str) and len(c) < SHORT else c for c in row]


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

Point = tuple[float, float]

MM3_PER_LITRE = 1e6
ALONG = "deflection of the collar, mm"
#: mm of the collar's wall, which the model does not have: only for the eye.
WALL = 12.0
#: Beside the collar, in its lengths: how far the close view goes.
CLOSE = 2.2


@dataclass(frozen=True, eq=False)
class BendLine:
    """The curve of one card.
    name : of the card. rank : of its colour, the same in every figure. deflection, load, pressure,
    volume : (frames,) mm, N, MPa, mm^3. knee, limit : where they are, mm and N. rms : N, against
    what was measured. other : deflection (mm) and load (N) of the other end of a band that begins
    at the curve. off : (frames,) N, how far the load may be off to either side by what the card
    leaves open."""

    name: str
    rank: int
    deflection: Array
    load: Array
    pressure: Array | None = None
    volume: Array | None = None
    knee: Point | None = None
    limit: Point | None = None
    rms: float | None = None
    other: tuple[ArrayLike, ArrayLike] | None = None
    off: Array | None = None


@dataclass(frozen=True, eq=False)
class BendPanel:
    """One case: a curve a card, repetitions with their scatter, what curves may be off by.
    along : the name of the deflection."""

    title: str
    lines: Sequence[BendLine] = ()
    readings: Sequence[BendingCurve] = ()
    measured: BendingScatter | None = None
    spread: str = ""
    along: str = ALONG


@dataclass(frozen=True)
class BeamBodies:
    """Rigid bodies when bent, mm; supports : (z, y) of the axes; collar_height : y of its axis.
    collars : z of each collar, or strap."""

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
    """Return load over deflection, a chart a case; in columns, a row has the same loads."""
    drawn = [panel for panel in panels if panel.lines or columns > 1]
    charts = [_loads(panel) for panel in drawn]
    if columns > 1:
        charts = [
            replace(chart, x_range=_range(charts, "x"), y_range=_range(row, "y"))
            for row in (charts[k : k + columns] for k in range(0, len(charts), columns))
            for chart in row
        ]
    charts += [_misses(panel) for panel in drawn if misses and panel.measured is not None]
    return Charts("loads", charts, caption, columns)


def _range(charts: Sequence[Chart], axis: str) -> tuple[float, float]:
    """Return the range of an axis that holds all that several charts draw."""
    fields = ("x",) if axis == "x" else ("y", "upper")
    every = [v for c in charts for s in c.series for f in fields for v in getattr(s, f)]
    return 0.0, 1.06 * max([v for v in every if v is not None], default=0.0) or 1.0


def _loads(panel: BendPanel) -> Chart:
    series: list[Series] = []
    if panel.measured is not None:
        seen = panel.measured
        ends = seen.mean - seen.deviation, seen.mean + seen.deviation
        series.append(band("scatter of repetitions (±)", seen.deflection, *ends, colour=7))
        series.append(line("mean", seen.deflection, seen.mean, colour=7, wide=True))
        series += [dots("measured", c.deflection, c.load, colour=7) for c in panel.readings]
    known = [(own.name, own.rms) for own in panel.lines if own.rms is not None]
    for own in panel.lines:
        look = 1 + own.rank % 6
        sure = None if own.off is None else (own.load - own.off, own.load + own.off)
        series.append(line(own.name, own.deflection, own.load, sure, colour=look))
        if own.other is not None:
            series.append(line(f"{own.name}, other end", *own.other, colour=look, dashes=1))
        for words, point, shape in (
            ("knee", own.knee, "diamond"), ("limit point", own.limit, "triangle-up")
        ):  # fmt: skip
            if point is not None:
                at = [point[0]], [point[1]]
                series.append(dots(words, *at, colour=look, shape=shape, hollow=True))
    sides = [panel.spread] if any(own.off is not None for own in panel.lines) else []
    series += [band(name, (), (), (), colour=1 + panel.lines[0].rank % 6) for name in sides if name]
    highest = max((float(own.load.max()) for own in panel.lines), default=0.0)
    alt = f"{panel.title}: load over deflection, up to {highest:.4g} N"
    alt += "".join(f"; {name}: RMS error {rms:.3g} N" for name, rms in known)
    title = panel.title
    if len(known) == 1:
        title += f": RMS error {known[0][1]:.3g} N"
    return Chart(title, panel.along, "load, N", series, alt, from_zero=True)


def _misses(panel: BendPanel) -> Chart:
    seen = panel.measured
    assert seen is not None
    grid, spread = seen.deflection, seen.deviation
    series = [band("scatter of repetitions (±)", grid, -spread, spread, colour=7)]
    for own in panel.lines:
        off = np.interp(grid, own.deflection, own.load, left=np.nan, right=np.nan) - seen.mean
        series.append(line(own.name, grid, off, colour=1 + own.rank % 6))
    known = [f"{own.name} {own.rms:.3g} N" for own in panel.lines if own.rms is not None]
    title = f"RMS error: {', '.join(known)}" if known else ""
    alt = f"{panel.title}: model less mean of the readings"
    return Chart(title, panel.along, "model − mean, N", series, alt, level=0.0)


def gas_charts(panel: BendPanel) -> Charts:
    """Return gauge pressure against change of volume and against deflection."""
    by_volume: list[Series] = []
    by_way: list[Series] = []
    for own in panel.lines:
        assert own.pressure is not None and own.volume is not None
        pressure, volume = 1e3 * own.pressure, own.volume / MM3_PER_LITRE
        name, look = f"{own.name}, from {volume[0]:.4g} litres", 1 + own.rank % 6
        by_volume.append(line(name, volume - volume[0], pressure, colour=look))
        by_way.append(line(name, own.deflection, pressure, colour=look))
    across, up = "volume less that when inflated, litres", "gauge pressure, kPa"
    charts = [
        Chart(panel.title, across, up, by_volume, f"{panel.title}: pressure over volume"),
        Chart("", panel.along, up, by_way, f"{panel.title}: pressure over deflection"),
    ]
    return Charts("gas", charts, "")


def beam_charts(
    now: Array, cells: NDArray[np.intp], strain: Array, before: Array,
    section: tuple[Array, Array], bodies: BeamBodies, title: str = "",
) -> Charts:  # fmt: skip
    """Return a whole beam true to scale, coloured by its strain along the axis.
    now : (n, 3) mm, positions; z along the axis, y up. cells : (m, 4). strain : (m,) log strain
    along the axis when bent. before : (k, 2) mm, the inflated beam from the side as a closed line
    (z, y). section : (k, 2) mm, the mid-span ring as a closed line (x, y), inflated and bent.
    bodies : supports and collar when bent."""
    # Wrinkles take up many times the strain that the fabric carries: all of them one colour.
    most = max(float(strain.max()), 1e-6)
    values = np.clip(strain, -most, most)
    # Of the two halves the eye sees one; what is nearer hides what is behind.
    seen = np.flatnonzero(now[cells, 0].mean(axis=1) >= 0)
    seen = seen[np.argsort(now[cells[seen], 0].mean(axis=1))]
    body = faces("", now[cells[seen]][:, :, [2, 1]], values[seen])
    series = [
        line("support", *_circle(z, y, bodies.support_radius), colour=3) for z, y in bodies.supports
    ]
    half, r = 0.5 * bodies.collar_length, bodies.collar_radius
    for z in bodies.collars:
        for y in (bodies.collar_height - r - WALL, bodies.collar_height + r):
            x = [z - half, z + half, z + half, z - half, z - half]
            series.append(line(bodies.name, x, [y, y, y + WALL, y + WALL, y], colour=0))
    side = [body, line("inflated", *before.T, colour=7, dashes=1), *series]
    ring, middle = bodies.collar_radius + WALL, bodies.collar_height
    feet = [y - bodies.support_radius for _, y in bodies.supports]
    low = min(float(now[:, 1].min()), middle - ring, *feet)
    high = max(float(now[:, 1].max()), float(before[:, 1].max()), middle + ring)
    ends, reach = float(np.abs(now[:, 2]).max()), CLOSE * bodies.collar_length
    at = bodies.collars[-1]
    tall, axes = bodies.collar_radius + 4 * WALL, ("z, mm", "y, mm")
    shades = shades_of(values)
    scale: dict[str, Any] = {"equal": True, "scale": "log strain along the axis", "shades": shades}
    whole = Chart(title, *axes, side, f"{title}: the bent beam from the side",
                  x_range=(-1.03 * ends, 1.03 * ends), y_range=(low - 20, high + 20),
                  **scale)  # fmt: skip
    close = Chart(f"at the {bodies.name}", *axes, side, f"the bent beam at the {bodies.name}",
                  x_range=(at - reach, at + reach), y_range=(middle - tall, middle + tall),
                  **scale)  # fmt: skip
    return Charts("beam", [whole, close, _cut(section, bodies)], "", columns=2)


def _circle(x: float, y: float, radius: float) -> tuple[Array, Array]:
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    return x + radius * np.cos(turn), y + radius * np.sin(turn)


def _cut(section: tuple[Array, Array], bodies: BeamBodies) -> Chart:
    before, now = section
    circle = _circle(0.0, bodies.collar_height, bodies.collar_radius + 0.5 * WALL)
    series = [
        *([line("collar", *circle)] if 0.0 in bodies.collars else []),
        line("inflated", *before.T, colour=7, dashes=1),
        line("bent", *now.T, colour=3),
    ]
    alt = "the beam cut at mid-span, inflated and bent"
    return Chart("cut at mid-span", "x, mm", "y, mm", series, alt, equal=True)
