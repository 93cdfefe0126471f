"""Presenter of inflated cylinders whose bending is predicted, and its tables.

They are of stiffness, knee and limit point, of all runs, and of errors of loads.
"""

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from ....experiments.cylinder import CylinderKind
from ....experiments.cylinder.measures import CRITERIA, CURVE_PROPERTIES, BendingMeasures
from ....experiments.cylinder.predicted import (
    CylinderOutcome,
    CylinderPredicted,
    describe_load,
    measured_table,
    place_names,
)
from ....experiments.cylinder.test import PART, CylinderTest
from ....experiments.data_files import CaptionedFile, Output
from ....experiments.forward import Cards, Runs, Simulation
from ....experiments.predicted import PredictedRun, record_of
from ....lazy_modules import pandas as pd
from ....materials.card import LEVEL
from ....notes import marks_of
from ....presenting import KINDS
from ....wording import percent
from ...content import Exhibit, Part, Table, Words
from ...presenter import PagePresenter
from .figures import draw_figures, load_charts, tests_of, write_beams

#: Largest number of predictions that the summary of the page names one by one.
SUMMED_UP = 4


def how_sure(outcome: CylinderOutcome) -> list[str]:
    """Return sentences on the uncertainty of the predicted loads."""
    lines = []
    shares = [
        np.nanmax(sigma) / np.max(outcome.bent[i].load)
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
    return lines


def assumptions(tests: Sequence[CylinderTest]) -> list[Part]:
    """Return the list of assumptions, each with the tests that it was made for; nothing if none."""
    lines = []
    for words in dict.fromkeys(words for test in tests for words in test.assumed):
        names = [test.name for test in tests if words in test.assumed]
        of_tests = "" if len(names) == len(tests) else f", for {', '.join(names)}"
        lines.append(f"the usual {words}{of_tests}")
    if not lines:
        return []
    return [Words(["Assumed, as the project does not say:"]), Words(lines, bulleted=True)]


def _in_brackets(text: object) -> str:
    """Return a remark in brackets after a space; "" without one."""
    return f" ({text})" if text else ""


def _sentence(row: Sequence[object]) -> str:
    """Return a row of the first table of the page (`openings`) in words."""
    test, card, stiffness, stiffness_band, *points = row
    words = [f"{test}, {card}: stiffness {stiffness}{_in_brackets(stiffness_band)} N/mm"]
    for name, cells in (("knee", points[:3]), ("limit point", points[3:])):
        load, load_band, deflection = cells
        if deflection:
            words.append(f"{name} at {load}{_in_brackets(load_band)} N and {deflection} mm")
        elif load:
            words.append(f"{name} {load}")
    return ", ".join(words)


class CylinderPresenter(PagePresenter):
    """Presenter of bent cylinders."""

    def show_outcome(self, outcome: CylinderOutcome, out: Output) -> Exhibit:
        """Write figures, tables and beams of all runs; return what the page shows of them."""
        tests = tests_of(outcome)
        figures = draw_figures(outcome, out)
        files = [*write_tables(outcome, tests, out), *write_beams(outcome, out)]
        tables = [runs_table(outcome, tests).without_empty_columns(), *error_tables(outcome)]
        first = openings(outcome)
        parts = [
            first.without_empty_columns(),
            *load_charts(outcome),
            Words(how_sure(outcome)),
            *assumptions(tests),
        ]
        lengths = {
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

    def simulate(
        self, test: CylinderTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
    ) -> Simulation:
        """Write load_deflection.csv, figures and beams; return the numbers of every card."""
        predicted = []
        for name, card in cards.items():
            run = runs[name, PART]
            record = record_of(CylinderPredicted(), run.model, run.outcome)
            predicted.append(PredictedRun(test, name, card, run.model, record))
        outcome = CylinderOutcome(predicted)
        parts = self.show_outcome(outcome, out).all_parts() if outcome.measures else []
        numbers = {
            name: {
                "ended": outcome.ended(i),
                **(outcome.numbers(i) if i in outcome.measures else {}),
            }
            for i, name in enumerate(cards)
        }
        errors = {name: outcome.error(i) for i, name in enumerate(cards)}
        compared = {name: error for name, error in errors.items() if error is not None}
        return Simulation({"cards": numbers}, outcome.lines(), parts=parts, errors=compared)


KINDS.register(CylinderKind, CylinderPresenter())


#: Names of the files that are written.
CURVES_FILE = "load_deflection.csv"
MEASURED_FILE = "measured.csv"
#: Column of the load at the limit point in the first table; its band and the deflection follow.
LIMIT_COLUMN = 7


def openings(outcome: CylinderOutcome) -> Table:
    """Return the first table of the page: stiffness, knee and limit point of each prediction.

    Their bands combine the uncertainty of the card with the assumptions on the wall.
    """
    rows = []
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
        rows.append([run.test.name, run.card, *cells])
    header = ["test", "card", "stiffness, N/mm", "its band"]
    for name in ("knee", "limit point"):
        header += [f"load at the {name}, N", "its band", "deflection there, mm"]
    sides = [f"{100 * LEVEL:g} % by what the card leaves open"] if outcome.spreads else []
    if outcome.band:
        sides.append(f"from {' to '.join(end.name for end in outcome.band)}")
    note = f"Bands: {', '.join(sides) or 'not known'}; none where it is narrower than the digits. "
    note += "The knee is where the slope has fallen to half, the limit point the largest load, "
    note += "where the load falls afterwards."
    limits = {row[LIMIT_COLUMN : LIMIT_COLUMN + 3] for row in map(tuple, rows)}
    load, _, deflection = limits.pop() if len(limits) == 1 else (None, None, None)
    if load and deflection is None:
        note += f" Limit points: {load}."
        rows = [[*row[:LIMIT_COLUMN], None, None, None] for row in rows]
    return Table("Stiffness, knee and limit point", header, rows, note, text=(1,))


def _point_cells(
    outcome: CylinderOutcome, number: int, name: Literal["knee", "limit"]
) -> list[str | None]:
    """Return the cells of the knee, or the limit point, of a run: load, band and deflection.

    `number` : index of the run in `CylinderOutcome.runs`.
    """
    measures = outcome.measures.get(number)
    load = outcome.with_band(number, name)
    if measures is None:
        return [None, None, None]
    if load is None:
        return [measures.describe(None), None, None]
    deflection, _ = getattr(measures, name)
    return [f"{load[0]:.0f}", _range_text(load, ".0f"), f"{deflection:.0f}"]


def _range_text(banded: tuple[float, float, float] | None, digits: str) -> str | None:
    """Return the ends of a band (value, lower end, upper end) as text.

    None without a band, or where both ends are the same in the format `digits`.
    """
    if banded is None:
        return None
    low, high = (f"{end:{digits}}" for end in banded[1:])
    return None if low == high else f"{low} to {high}"


def write_tables(
    outcome: CylinderOutcome, tests: Sequence[CylinderTest], out: Output
) -> list[CaptionedFile]:
    """Write the modelled curves and, if there are any, the mean of the measured ones, as CSV.

    Returns
    -------
    list of (str, str)
        Files with their descriptions.
    """
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


def _slope_span(tests: Sequence[CylinderTest]) -> str:
    """Return in words the deflection over which slopes of the curves are taken."""
    lengths = sorted({round(t.reading.slope_over, 6) for t in tests})
    if len(lengths) == 1:
        return f"{lengths[0]:g} mm"
    shares = {round(t.reading.slope_over / t.diameter, 9) for t in tests}
    ends = f"{lengths[0]:g} to {lengths[-1]:g} mm"
    return f"{shares.pop():g} diameters ({ends})" if len(shares) == 1 else ends


def _name_cells(outcome: CylinderOutcome, run: PredictedRun) -> list[object]:
    """Return the cells that name a run: test, card and, where walls differ, the wall."""
    return [run.test.name, run.card, *([run.wall] if outcome.band else [])]


def _name_header(outcome: CylinderOutcome) -> list[str]:
    """Return the headings of the columns that name a row."""
    return ["test", "card", *(["wall"] if outcome.band else [])]


def runs_table(outcome: CylinderOutcome, tests: Sequence[CylinderTest]) -> Table:
    """Return the table of all runs: measures of the curve, how the run ended, and its notes."""
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
        rows.append([*_name_cells(outcome, run), *cells, *tail])
    names = _name_header(outcome)
    header = [
        *names,
        *("stiffness, N/mm", "knee", "limit point", "wrinkles from"),
        *(f"load at {place}, N" for place in places),
        *("inflation strain, %", "pressure, kPa", "ended", "marked", "notes", "s"),
    ]
    slope_span = _slope_span(tests)
    note = (
        f"Stiffness: to {slope_span} of deflection. Knee: where the slope over {slope_span} has "
        "fallen to half of it. Limit point: the largest load, where the load falls afterwards. "
        "Wrinkles: more of the surface than when inflated. Inflation strain: the largest along "
        "warp or fill in the body, without the quads beside seam and caps. Pressure: its rise to "
        "the last frame."
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
    """Return the cells of a run that did not fail, from stiffness to rise of pressure.

    `sigmas` : one standard deviation of the load at each of the `places`, N, None if not known.
    """
    loads = []
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


def error_tables(outcome: CylinderOutcome) -> list[Table]:
    """Return tables of predictions beside measurements: quantities of the curve, and RMS errors.

    No tables where nothing was measured.
    """
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
            rows.append([*_name_cells(outcome, outcome.runs[i]), *cells])
    if not rows:
        return []
    names = _name_header(outcome)
    header = [*names, "RMS, N", "of the largest load", "mean, N", "readings", "beyond"]
    note = "Model less reading at every reading that the model reaches; beyond: those it does not."
    text_columns = tuple(range(1, len(names)))
    errors = Table("Against measured loads", header, rows, note, text=text_columns)
    return [*_measured_quantities(outcome), errors]


def _measured_quantities(outcome: CylinderOutcome) -> list[Table]:
    """Return a table of measured stiffness, knee and loads, and predicted over measured ones.

    No table where nothing was measured.
    """
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
        rows.append(cells)
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
    """Return the measured value and the ratio of the predicted one to it, as text."""
    return [f"{measured:.4g}", f"{predicted / measured:.3f}"]
