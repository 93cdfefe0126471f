"""Results of bent cylinders as facts, figures, tables and files."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from ...errors import marks, percent
from ...materials.card import BAND, LEVEL
from ...meshes.beam_model import BeamModel
from ...meshes.cylinder_model import CylinderModel
from ...meshes.mesh import Mesh, surface_strain, with_mirror_image
from ...readers.bending import scatter
from ...reports.charts import Charts
from ...reports.content import Exhibit, Part, Table, Words
from ...reports.cylinders import (
    ALONG,
    BeamBodies,
    BendLine,
    BendPanel,
    beam_charts,
    bending_charts,
    gas_charts,
)
from ...reports.maps import write_vtu
from ...reports.vega import save
from ..kinds import Array, Cards, Output, PredictedRun, Runs, Shown, Simulation, record_of
from .predicted import (
    SECANT,
    BendingRun,
    CylinderOutcome,
    CylinderPredicted,
    load_words,
    measured_table,
    place_names,
)
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
    lines = [
        f"{', '.join(map(str, row[:2]))}: stiffness {stiff}{_in(band)} N/mm, knee "
        + (f"at {load}{_in(loads)} N and {at} mm" if load else "not reached")
        for row in first.rows
        for stiff, band, load, loads, at in [row[2:]]
        if len(first.rows) <= SENTENCES and stiff
    ]
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


def openings(outcome: CylinderOutcome) -> Table:
    """Return stiffness and knee of every prediction, each with its band by card and wall."""
    rows: list[list[object]] = []
    for i, run in enumerate(outcome.runs):
        if not run.predicted:
            continue
        stiffness, knee = outcome.measured(i, "stiffness"), outcome.measured(i, "knee")
        at = None if (m := outcome.measures.get(i)) is None or m.knee is None else m.knee[0]
        cells = [f"{stiffness[0]:.3g}" if stiffness else None, _to(stiffness, ".3g")]
        cells += [f"{knee[0]:.0f}" if knee else None, _to(knee, ".0f")]
        rows.append(_unbroken([run.test.name, run.card, *cells, at and f"{at:.0f}"]))
    header = ["test", "card", "stiffness, N/mm", "its band", "load at the knee, N", "its band",
              "deflection there, mm"]  # fmt: skip
    sides = [f"{100 * LEVEL:g} % by what the card leaves open"] if outcome.spreads else []
    sides += [f"from {' to '.join(end.name for end in outcome.band)}"] if outcome.band else []
    note = f"Bands: {', '.join(sides) or 'not known'}; none where it is narrower than the digits. "
    note += "The knee is where the slope has fallen to half."
    return Table("Stiffness and knee", header, rows, note, text=(1,))


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
            rows.append([*head, *[None] * (5 + len(places)), *tail])
            continue
        where = m.buckling
        knee = " (knee)" if m.buckling_is == "knee" else ""
        buckles = f"{where[1]:.0f} N, {where[0]:.0f} mm{knee}" if where else None
        wrinkles = f"{m.wrinkles[0]:.0f} mm" if m.wrinkles else None
        strain, rise = f"{100 * max(m.body_strain):.2g}", f"{m.pressure_rise:+.2f}"
        stiffness = None if m.stiffness is None else f"{m.stiffness:.2f}"
        spread = outcome.sigma(i)
        loads = [(m.loads.get(place), spread.get(place)) for place in places]
        listed = [None if one[0] is None else load_words(*one) for one in loads]
        rows.append([*head, stiffness, buckles, wrinkles, *listed, strain, rise, *tail])
    header = [
        "test", "card", *walls, "stiffness, N/mm", "buckles", "wrinkles from",
        *(f"load at {place}, N" for place in places),
        "inflation strain, %", "pressure, kPa", "ended", "marked", "notes", "s",
    ]  # fmt: skip
    slopes = _slopes(tests)
    note = (
        f"Stiffness: to {slopes} of deflection. Buckles: the limit point where the load falls "
        f"afterwards, else the knee, where the slope over {slopes} has fallen to half. Wrinkles: "
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
    compared = ["stiffness", "knee", *(f"load at {place}" for place in places)]
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
    over = (f"{name}, {'N/mm' if name == 'stiffness' else 'N'}" for name in compared)
    columns = [*named, *(words for name in over for words in (name, "of it"))]
    low, high = (f"{100 * share:g}" for share in SECANT)
    how = "Measured (mean of the repetitions), and predicted over measured. Stiffness: between "
    how += f"{low} and {high} % of each curve's load at the last place that all reach; knee: where "
    how += "the slope is half of that."
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
