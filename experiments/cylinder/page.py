"""What bent cylinders put on a page: facts, figures, tables and files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from ...notes import marks
from ...reports import Table, Words, percent
from ...reports.content import Part
from ...writing import replacing
from ..exhibit import Exhibit, Output, Shown
from .figures import draw_figures, load_charts, tests_of, write_beams
from .how_sure import how_sure
from .tables import load_words, measured_table, place_names
from .test import CylinderTest

if TYPE_CHECKING:
    from .outcome import CylinderOutcome

#: Letters of a cell that is not broken.
SHORT = 30
CURVES = "load_deflection.csv"
MEASURED = "measured.csv"


def exhibit(outcome: CylinderOutcome, out: Output) -> Exhibit:
    """Write everything below the folder and say what is where."""
    tests = tests_of(outcome)
    figures = draw_figures(outcome, out)
    files = [*_write_tables(outcome, tests, out), *write_beams(outcome, out)]
    tables = [_runs(outcome, tests), *_errors(outcome)]
    parts: list[Part] = [Words(how_sure(outcome, tests)), *load_charts(outcome)]
    return Exhibit(_common(tests), figures, tables, files, parts)


def _write_tables(
    outcome: CylinderOutcome, tests: Sequence[CylinderTest], out: Output
) -> list[Shown]:
    curves = [outcome.curve(i) for i in range(len(outcome.runs))]
    for run, curve in zip(outcome.runs, curves, strict=True):
        curve.insert(0, "wall", run.wall)
        curve.insert(0, "card", run.card)
        curve.insert(0, "test", run.test.name)
    _write(pd.concat(curves), out, CURVES)
    what = "every curve: deflection, load, pressure, volume, wrinkled share"
    files = [(out.name(CURVES), what)]
    measured = measured_table(tests)
    if len(measured):
        _write(measured, out, MEASURED)
        files.append((out.name(MEASURED), "mean and scatter of the repetitions on a grid"))
    return files


def _write(table: pd.DataFrame, out: Output, name: str) -> None:
    with replacing(out.path(name)) as path:
        table.to_csv(path, index=False)


def _common(tests: Sequence[CylinderTest]) -> list[tuple[str, object]]:
    """What all tests share, for the head of the page."""
    facts: list[tuple[str, object]] = []
    for label, values in (
        ("length, mm", {t.length for t in tests}),
        ("span, mm", {t.supports.span for t in tests}),
        ("element size, mm", {t.size for t in tests}),
        ("seam width, mm", {t.seam_width for t in tests}),
    ):
        if len(values) == 1:
            facts.append((label, float(values.pop())))
    return facts


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
        loads = [m.loads.get(place) for place in places]
        strain, rise = f"{max(m.body_strain):.3f}", f"{m.pressure_rise:+.2f}"
        stiffness = None if m.stiffness is None else f"{m.stiffness:.2f}"
        spread = outcome.sigma(i)
        listed = [
            None if load is None else load_words(load, spread.get(place))
            for place, load in zip(places, loads, strict=True)
        ]
        rows.append([*head, stiffness, buckles, wrinkles, *listed, strain, rise, *tail])
    header = [
        "test", "card", *walls, "stiffness, N/mm", "buckles", "wrinkles from",
        *(f"load at {place}, N" for place in places),
        "inflation strain", "pressure, kPa", "ended", "marked", "notes", "s",
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
    note += "".join(f" {words.capitalize()}." for words in outcome.unsure)
    note += "".join(f" {end.name.capitalize()}: {end.meaning}." for end in outcome.band)
    named = range(1, header.index("stiffness, N/mm"))
    text = (*named, header.index("ended"), header.index("marked"))
    return Table("Runs", header, [_unbroken(row) for row in rows], note, text=text)


def _errors(outcome: CylinderOutcome) -> list[Table]:
    walls = ["wall"] if outcome.band else []
    rows: list[list[object]] = [
        [
            outcome.runs[i].test.name, outcome.runs[i].card,
            *(walls and [outcome.runs[i].wall]), m.error.rms,
            percent(m.error.relative), f"{m.error.mean:+.1f}", m.error.compared, m.error.beyond,
        ]
        for i, m in outcome.measures.items()
        if m.error is not None
    ]  # fmt: skip
    if not rows:
        return []
    shared = ["RMS, N", "of the largest load", "mean, N", "readings", "beyond"]
    header = ["test", "card", *walls, *shared]
    note = "Model less reading at every reading that the model reaches; beyond: those it does not."
    text = [_unbroken(row) for row in rows]
    named = tuple(range(1, header.index("RMS, N")))
    return [Table("Against measured loads", header, text, note, text=named)]


def _unbroken(row: Sequence[object]) -> list[object]:
    """The row with names and numbers that stay on one line."""
    return [c.replace(" ", "\u00a0") if isinstance(c, str) and len(c) < SHORT else c for c in row]
