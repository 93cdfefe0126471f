"""Notes of a result: every kind has a cause and stands in every output; the gravest come first."""

import html
import json
import pickle
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import pandas as pd
import pytest
from bubblefit.cli.fits import lines_of
from bubblefit.experiments.base import DIRECTIONS_MISSED, UNMATCHED
from bubblefit.experiments.bubble.findings import (
    FLAT_SHEET,
    INVERSE_CRIME,
    NEGATIVE_SLACK,
    SURFACES,
)
from bubblefit.experiments.bubble.frame_doubts import LOADED_REFERENCE
from bubblefit.experiments.cycles.evaluation import CHANGING, DRIFT, GRIPS, SCATTER, SLIP
from bubblefit.experiments.data_files import READING
from bubblefit.experiments.doubts import DOUBTFUL
from bubblefit.experiments.forward import BEYOND_CARD, BEYOND_LAW, THICKNESS, UNSTABLE
from bubblefit.experiments.registry import presenter_of
from bubblefit.experiments.states import STATES
from bubblefit.experiments.strips.gauge import CORRELATION_LOST, NO_LOAD
from bubblefit.inference.discrepancy import DISCREPANCY, LIKELY_CAUSE
from bubblefit.inference.linear import SECOND_ORDER
from bubblefit.inference.noise import ABOVE_NOISE, BELOW_NOISE
from bubblefit.inference.reported import BOUND, MARGIN, UNCERTAIN
from bubblefit.inference.shear_valley import ONE_STIFFNESS, OPEN_SHEAR
from bubblefit.materials.exports.base import CONFIRM, LOSES
from bubblefit.notes import (
    SOLVER,
    Note,
    NoteKind,
    gravest_notes,
    marks_of,
    note_lines,
    note_records,
)
from bubblefit.project.project import read_project
from bubblefit.readers.frames import ORDER
from bubblefit.reports import fit_page, study_pages, vega
from bubblefit.reports.charts import Charts
from bubblefit.reports.content import Exhibit
from bubblefit.reports.kinds import cylinder as cylinders
from bubblefit.reports.kinds.bubble_readings import TAKEN_FOR_FLAT
from bubblefit.reports.kinds.strips import LEFT_OUT, POISSON
from bubblefit.runs.bootstrap import FEW_UNITS
from bubblefit.runs.certainty import MESH, TAKEN_OUT, TOO_LARGE, UNKNOWN
from bubblefit.runs.compare import FOLD
from bubblefit.runs.estimate import GAP, NOT_ESTIMATED
from bubblefit.runs.fit import NOT_BETTER
from bubblefit.runs.optimum import NOT_THE_CARD
from bubblefit.runs.predictions import Predictions, predict
from bubblefit.runs.profile import NOT_CLOSED
from bubblefit.runs.refinement import refine, vary_nu12
from bubblefit.runs.result import ALONE, STARTS
from bubblefit.runs.simulation import FAILED, simulate_cards
from bubblefit.runs.verdict import NOT_CONVERGED
from bubblefit.solvers import registry
from bubblefit.solvers.base import EARLY, SNAP
from bubblefit.solvers.calculix.cylinder import GAS
from bubblefit.solvers.calculix.deck import TILT
from bubblefit.solvers.marc.analyses import NO_REACTIONS, UNBALANCED, UNCONFIRMED
from bubblefit.solvers.marc.solver import REPEATED
from bubblefit.solvers.membrane.bending import PENETRATION, WRINKLES

from .builders import notes as made
from .builders.bars import BarTest
from .builders.bent_cylinders import ClosedFormCylinder, write_cylinder_project
from .support.refusals import raised

Maker = Callable[[Path, pytest.MonkeyPatch], Iterable[Note]]


#: Who makes notes of a kind, and their words.
CASES = (
    (NOT_ESTIMATED, made.notes_of_an_estimate, "other: points lie on a part of the disk only"),
    (GAP, made.notes_of_an_estimate, r"chi [3-9]|chi \d\d"),
    (EARLY, made.notes_of_bending,
     "the run stopped early: no equilibrium between 6 and 8 mm"),
    (EARLY, made.notes_of_marc_bending,
     "the run stopped early; the last increment is at 60 mm"),
    (EARLY, made.notes_of_marc_bending,
     "the time step could not get smaller: no convergence"),
    (EARLY, made.notes_of_calculix_bending,
     "the run stopped early; the last increment is at 6 mm: no step left"),
    (SNAP, made.notes_of_bending, "snaps, or nearly, before 6 mm of deflection"),
    (SNAP, made.notes_of_inflation,
     "snaps, or nearly, between 50 and 100 kPa: passed by leading"),
    (PENETRATION, made.notes_of_bending, r"rigid bodies penetrate 0\.0\d+ mm at most"),
    (WRINKLES, made.notes_of_bending,
     r"left to wrinkles \(0\.01 of the taut fabric's\) carries 0\.\d+ %"),
    (GAS, made.notes_of_calculix_bending,
     r"gas: pass 1, p V constant within \S+ \(wanted: 0.0003\)"),
    (TILT, made.notes_of_tilted_shells,
     r"slopes of up to 0\.30 lower its stiffness .* 18\.2 %"),
    (REPEATED, made.notes_of_marc_bending, "1 increments were repeated after they did not"),
    (UNCONFIRMED, made.notes_of_marc_bending,
     "'Contact Normal Force', which is not confirmed"),
    (UNBALANCED, made.notes_of_marc_bending, r"collar \(24 N\) and supports \(0 N\) do not"),
    (NO_REACTIONS, made.notes_of_marc_results, r"the \.t19 holds no 'Reaction Force'"),
    (SOLVER, made.notes_of_simulation, "thick: as a plug-in says it"),
    (SOLVER, made.notes_of_nu12, r"a bar, nu12 = 0\.2: as a plug-in says it"),
    (SOLVER, made.notes_of_refinement, "a bar, 32 quads: as a plug-in says it"),
    (BEYOND_CARD, made.notes_of_analysis,
     r"warp strain 7\.\d* % is beyond the card's valid range of 5 %"),
    (BEYOND_CARD, made.notes_of_simulation,
     r"thick: warp strain 9\.\d* % is beyond the card's valid range"),
    (UNSTABLE, made.notes_of_analysis, "unstable equilibrium at .* would not stay there"),
    (THICKNESS, made.notes_of_simulation,
     r"thick: the card was fitted for a thickness of 1 mm, this is 0\.5"),
    (FAILED, made.notes_of_simulation, "stiff: the bar breaks"),
    (FAILED, made.notes_of_nu12, r"a bar, nu12 = 0\.3: the bar breaks"),
    (FAILED, made.notes_of_refinement, "a bar, 128 quads: the bar breaks"),
    (BEYOND_LAW, made.notes_of_fit,
     r"one: warp: warp strain reached 13\.\d %, beyond law\.strain_range of 12 %"),
    (STARTS, made.notes_of_fit,
     r"1 of 2 starts ended because membrane failed \(one: warp: too tired\)"),
    (NOT_CONVERGED, made.notes_of_an_unfinished_fit,
     r"used up its \d+ analyses while its steps still gained"),
    (UNCERTAIN, made.notes_of_fit, "G12 is not determined at any strain "),
    (MARGIN, made.notes_of_fit, "E2 touches its positivity margin"),
    (BOUND, made.notes_of_fit, "E1 touches its upper bound"),
    (BOUND, made.notes_of_certainty, "pressure_offset lies on its lower bound"),
    (ALONE, made.notes_of_fit, "two alone does not determine E2 "),
    (INVERSE_CRIME, made.notes_of_bubble, "computed by the very model that is fitted to them"),
    (ABOVE_NOISE, made.notes_of_fit, r"one: warp: the fit leaves .* the noise given \(0\.01 N; "),
    (SURFACES, made.notes_of_bubble, "polynomial surfaces of degree 4 do not follow"),
    (FLAT_SHEET, made.notes_of_bubble, "the sheet is taken for flat and taut"),
    (ONE_STIFFNESS, made.notes_of_one_stiffness, "do not tell warp from fill"),
    (TAKEN_FOR_FLAT, made.notes_of_gauges, "flat"),
    (NEGATIVE_SLACK, made.notes_of_a_stretched_sheet, "the slack is -0.30 % in warp"),
    (LOADED_REFERENCE, made.notes_of_alternatives, "the former explains the data better"),
    (NOT_BETTER, made.notes_of_alternatives, "the latter explains the data better"),
    (UNMATCHED, made.notes_of_fit, "two: no bias strip of two is matched: G12 rests"),
    (DIRECTIONS_MISSED, made.notes_of_directions, r"off by \-12 % at 45 degrees"),
    (POISSON, made.notes_of_directions, r"gives nu12 = 0\.40, the law has 0\.24: set nu12"),
    (LEFT_OUT, made.notes_of_fit, "one, warp: 2 points beyond the final length"),
    (DOUBTFUL, made.notes_of_fit, r"one: warp, a: the load is 60 N \(7% of the largest\)"),
    (READING, made.notes_of_fit, r"the elongation is column 'elongation \(mm\)', not"),
    (CORRELATION_LOST, made.notes_of_gauge, r"correlation lost in 1 of 12 frames \(2\)"),
    (ORDER, made.notes_of_gauge, r"frames in the order given: f10\.csv before f2\.csv"),
    (NO_LOAD, made.notes_of_gauge, r"have a length and no load; they are left out: f8\.csv"),
    (SLIP, made.notes_of_cycles, r"cycle 3 is a negative loop \(-"),
    (SLIP, made.notes_of_cycles, r"at the peak of cycle 2 0\.0004 less strain than in cycle 1"),
    (DRIFT, made.notes_of_cycles, "the strain moves by 2e-05 a second before the load does"),
    (GRIPS, made.notes_of_cycles, "strains are travel of the machine"),
    (SCATTER, made.notes_of_cycles, "4 specimens of the warp scatter: on loading in cycle"),
    (SCATTER, made.notes_of_cycles, "one specimen of the fill: how much specimens scatter"),
    (CHANGING, made.notes_of_cycles, r"lost\.csv: no cycle repeats the one before"),
    (STATES, made.notes_of_states,
     r"bubble: first loading, one: conditioned, three: first loading\): one law is not both"),
    (STATES, made.notes_of_states, r"rate of strain \(one: 60 %/min, two: 6 %/min\)"),
    (STATES, made.notes_of_states, r"longest hold \(one: 0 s, two: 60 s\)"),
    (LOSES, made.notes_of_exports, "there the curve ends at 30 % of log strain"),
    (CONFIRM, made.notes_of_exports,
     "that tables of G12 are looked up with the engineering shear"),
)  # fmt: skip


#: What the tests of the studies, of starts and of noise provoke themselves.
ELSEWHERE = {
    BELOW_NOISE,
    DISCREPANCY,
    FEW_UNITS,
    FOLD,
    LIKELY_CAUSE,
    MESH,
    NOT_CLOSED,
    NOT_THE_CARD,
    OPEN_SHEAR,
    SECOND_ORDER,
    TAKEN_OUT,
    TOO_LARGE,
    UNKNOWN,
}


@cache
def notes_by(maker):
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        return list(maker(Path(folder), patch))


@pytest.mark.parametrize("kind", sorted({*NoteKind.registered.values()} - ELSEWHERE), ids=str)
def test_cause_of_each_kind_gives_its_note(kind):
    cases = [(maker, words) for own, maker, words in CASES if own is kind]
    assert cases, f"no case provokes a note {kind!r}: add one to CASES"
    for maker, words in cases:
        notes = notes_by(maker)
        said = [note for note in notes if re.search(words, getattr(note, "line", note))]
        assert [getattr(note, "kind", None) for note in said] == [kind], (words, notes)


class Told(NamedTuple):
    terminal: Sequence[str]
    json: Sequence[Mapping[str, str]]
    folder: Path | None = None
    page: str | None = None


def told_by_fit(folder, patch, notes):
    fit = replace(made.fit())
    fit.__dict__["notes"] = notes
    for name in ("optima", "moduli"):
        patch.setattr(fit_page, name, lambda *_: Charts("a", [], "a picture"))
    patch.setattr(fit_page, "save", lambda *_: None)
    patch.setattr(fit_page, "_pinned", lambda *_: [])
    patch.setattr(presenter_of(fit.setup.tests[0].test.kind), "show", lambda *_: Exhibit())
    page = fit.report(folder)
    return Told(lines_of(fit, folder, all_notes=True), _json(folder), folder, page.read_text())


def told_by_comparison(folder, patch, notes):
    fit = replace(made.fit())
    fit.__dict__["notes"] = notes
    patch.setattr(study_pages, "save", lambda *_: None)
    patch.setattr(study_pages, "_responses", lambda *_: [])
    done = made.comparison(fit)
    done.write(folder)
    page = folder / "report.html"
    return Told(note_lines(done.notes), _json(folder), folder, page.read_text())


def told_by_predictions(folder, patch, notes):
    patch.setitem(registry.SOLVERS, "formula", ClosedFormCylinder)
    patch.setattr(cylinders, "draw_figures", lambda *_: [])
    patch.setattr(cylinders, "write_beams", lambda *_: [])
    done = predict(read_project(write_cylinder_project(folder)), jobs=1)
    each = (
        replace(done.predicted_runs[0], notes=notes),
        *(replace(run, notes=()) for run in done.predicted_runs[1:]),
    )
    done = Predictions(done.project, each, 1.0, done.record)
    page = done.report(folder / "out")
    return Told(done.lines(), _json(folder / "out"), folder / "out", page.read_text())


def told_by_simulation(folder, patch, notes):
    done = simulate_cards(made.bars(patch, notes), [BarTest("a bar")], {"soft": made.CARD}, folder)
    return Told(done.lines, _json(folder), folder)


def told_by_nu12(folder, patch, notes, make=lambda *given: vary_nu12(*given, [0.2])):
    patch.setattr(vega, "rendered", lambda *_: b"")
    study = make(made.bars(patch, notes), made.CARD)
    study.write(folder)
    return Told(study.lines(), _json(folder), folder)


def told_by_refinement(*given):
    return told_by_nu12(*given, make=refine)


def told_by_gauge(folder, _, notes):
    table = made.gauge(folder)
    table = replace(table, record=replace(table.record, warnings=tuple(notes)))
    table.write(folder / "gauge.csv")
    said = [line[2:] for line in (folder / "gauge.csv").read_text().splitlines() if line[0] == "#"]
    return Told(said, table.numbers()["notes"])


def _json(folder):
    return json.loads((folder / "result.json").read_text())["notes"]


TOLD_BY = (
    told_by_fit, told_by_comparison, told_by_predictions, told_by_simulation, told_by_nu12,
    told_by_refinement, told_by_gauge,
)  # fmt: skip


@pytest.mark.parametrize("tell", TOLD_BY, ids=lambda tell: tell.__name__)
def test_note_of_each_kind_stands_in_every_output(tell, tmp_path, monkeypatch):
    notes = [Note(kind, f"words of {kind}.") for kind in NoteKind.registered.values()]
    told = tell(tmp_path, monkeypatch, notes)
    if told.folder is not None:
        table = pd.read_csv(told.folder / "notes.csv", keep_default_na=False)
        assert table.to_dict("records") == told.json
    for note in notes:
        own = [row for row in told.json if row["note"] == note]
        assert own and {row["kind"] for row in own} == {note.kind}
        assert told.page is None or str(note) in html.unescape(told.page)
        if len(own) > 3:
            count = f"note, {len(own)} times (notes.csv has each), as {own[0]['of']}: {note}"
            assert count in told.terminal
            continue
        for row in own:
            of = f"{row['of']}: " if row["of"] else ""
            assert f"note: {of}{note}" in told.terminal


def test_kind_of_note_of_a_plug_in_is_ranked_and_recorded():
    kind = NoteKind("creep")
    note = pickle.loads(pickle.dumps(Note(kind, "the load fell by 3 %", "a strip")))
    assert note.kind is kind and kind == "creep" and kind.mark == 0
    assert note_records([note]) == [
        {"of": "a strip", "kind": "creep", "note": "the load fell by 3 %"}
    ]
    assert gravest_notes([note, Note(MESH, "m")]) == ["m"] and marks_of([note]) == []
    raised(ValueError, "named by words", NoteKind, " ")
