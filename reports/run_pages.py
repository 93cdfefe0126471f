"""Write the pages of predictions, of a look at the data before a fit, and of unfinished folders."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from ..errors import InputError
from ..experiments.biaxial.evaluation import BiaxialEvaluation
from ..experiments.output import Output
from ..inference.reported import BOUND_WORDS, LEVEL
from ..notes import as_note, marks_of, write_notes
from ..project.project import Project
from ..runs.check import Check, PredictionCheck
from ..runs.folder import RESULT, RUN, RUNS, Provenance, Store, write_table
from ..runs.predictions import Predictions
from ..runs.result import answers
from ..runs.starts import HISTORY, STARTS, RunningFiles
from ..storage.plain_values import json_text
from ..storage.writing import write_text
from ..version import __version__
from .bubbles import disk_charts
from .content import (
    PAGE_DATA,
    Exhibit,
    Facts,
    Part,
    Report,
    Section,
    Table,
    Words,
    read_page_data,
)
from .fit_page import ALWAYS, about_of, citation, record_tables
from .html import percent, write_report
from .kinds.biaxial import show_constants
from .presenter import page_presenter_of
from .vega import save

RUNS_TABLE = "runs.csv"


def write_predictions(predictions: Predictions, folder: Path) -> Path:
    """Write the folder of predictions; return the page's path. Raises OutputError."""
    (folder / RESULT).unlink(missing_ok=True)
    predictions.record.write(folder)
    several = len(predictions.outcomes) > 1
    exhibits = {
        kind: page_presenter_of(kind).show_outcome(
            outcome, Output(folder, f"{kind}/" if several else "")
        )
        for kind, (outcome, _) in predictions.outcomes.items()
    }
    write_notes(folder, predictions.notes)
    write_table(predictions.runs(), folder / RUNS_TABLE, None)
    page = write_report(folder, _page(predictions, exhibits))
    Store(folder).finish(predictions.result)
    return page


def _page(predictions: Predictions, exhibits: Mapping[str, Exhibit]) -> Report:
    each = predictions.each
    result = predictions.result
    ended = [predictions.ended(i) for i in range(len(each))]
    finished = sum(not (run.record.failure or run.record.early) for run in each)
    summary = " ".join(e.summary for e in exhibits.values() if e.summary)
    summary += f"{' ' if summary else ''}{finished} of {len(each)} runs finished."
    noted = sum(bool(run.notes) for run in each)
    if noted:
        summary += f" {noted} have notes."
    marked = Counter(kind for run in each for kind in marks_of(run.notes))
    for kind in sorted(marked, key=lambda kind: kind.mark):
        summary += f" Marked {str(kind)!r}: {marked[kind]}."
    if predictions.worst is not None:
        summary += f" Largest error against measured values: {percent(predictions.worst)}."
    return Report(
        title=predictions.project.title,
        summary=summary,
        about=about_of(predictions.project, predictions.record),
        facts=[
            ("tests", len(result["tests"])),
            ("cards", len(result["cards"])),
            ("solver", result["solver"]),
            ("wall time, s", float(result["wall_s"])),
            *([("runs from the cache", predictions.cached)] if predictions.cached else []),
            ("seconds of all runs", float(sum(run.record.seconds for run in each))),
            *(fact for exhibit in exhibits.values() for fact in exhibit.facts),
        ],
        warnings=[
            f"{run.title}: {how}"
            for run, how in zip(each, ended, strict=True)
            if run.record.failure or run.record.early
        ],
        sections=[
            Section(
                "What was predicted",
                [
                    part
                    for exhibit in exhibits.values()
                    for part in replace(exhibit, facts=()).all_parts()
                ],
            ),
            Section("What to know of the runs", _notes(predictions)),
            Section("The record", record_tables(predictions.record)),
            Section("How to cite", citation()),
        ],
        files=[
            (RUNS_TABLE, "the table of runs with all its columns"),
            *ALWAYS,
            *(file for exhibit in exhibits.values() for file in exhibit.files),
            *predictions.record.files,
        ],
        versions=result["versions"],
    )


def _notes(predictions: Predictions) -> list[Table]:
    walls = ["wall"] if any(run.wall for run in predictions.each) else []
    rows: list[list[object]] = [
        [run.test.name, run.card, *(walls and [run.wall]), as_note(note).kind, str(note)]
        for run in predictions.each
        for note in run.notes
    ]
    if not rows:
        return []
    what = "What a reader of the numbers above should know of each run."
    header = ["test", "card", *walls, "kind", "note"]
    return [Table("Notes", header, rows, what, text=tuple(range(1, len(header))))]


def write_check(check: Check, folder: Path) -> Path:
    """Write check.json, the tests' own figures and report.html; return the page's path."""
    write_text(folder / "check.json", json_text(check.result))
    several = len(check.setup.tests) > 1
    exhibits: list[tuple[str, Exhibit]] = []
    for one in check.setup.tests:
        out = Output.of(folder, one.test.name, several)
        exhibit = page_presenter_of(one.test.kind).examine(one, out)
        if exhibit is not None:
            exhibits.append((one.test.name, exhibit))
    header = ["test", "", "doubt", "what was seen"]
    doubts = Table("Doubts", header, [list(row) for row in check.rows()], text=(1, 2, 3))
    facts = [
        (f"{name}: {label}" if several else label, value)
        for name, exhibit in exhibits
        for label, value in exhibit.facts
    ]
    summary = "The data are fit to be fitted." if check.sound else "A fit would not begin."
    count = sum(map(len, check.findings.values())) + len(check.unbalanced)
    if check.sound and count:
        summary = f"A fit would begin, and carry {count} of the doubts below with it."
    shown = _estimate(check, folder, several)
    report = Report(
        title=f"{check.setup.project.title}: a look at the data",
        summary=summary,
        about=about_of(check.setup.project, None),
        facts=facts,
        warnings=[
            words
            for j in check.judgements
            for words in (*(f"{j.test}: {d.text}" for d in j.errors), *(n.line for n in j.notes))
        ]
        + [note.line for note in (*check.grave_notes, *check.unbalanced, *check.joined)],
        sections=[
            Section("Doubts", [doubts]),
            Section(
                "What was seen", [p for _, e in exhibits for p in replace(e, facts=()).all_parts()]
            ),
            Section("An estimate by virtual work", shown),
        ],
        files=[
            ("check.json", "the doubts in plain values"),
            *(f for _, e in exhibits for f in e.files),
        ],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


def write_prediction_check(check: PredictionCheck, folder: Path) -> Path:
    """Write check.json and report.html of tests that are only predicted; return the page's path."""
    write_text(folder / "check.json", json_text(check.result))
    header = ["test", "", "doubt", "what was seen"]
    seen = Table("Tests", header, [list(row) for row in check.rows()], text=(1, 2, 3))
    report = Report(
        title=f"{check.project.title}: a look at the data",
        summary="The project only predicts: its tests were read, and there is nothing to fit.",
        about=about_of(check.project, None),
        sections=[Section("What was seen", [seen])],
        files=[("check.json", "the doubts in plain values")],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


ESTIMATED = (
    "No equilibrium is solved for: the measured shapes are put into its equations. Chi is the "
    "distance of shape and equilibrium over that by the noise. A start and a doubt, not a result."
)
OFF = (
    "{}: displacement from the measured shape at the highest pressure to equilibrium with the "
    "estimated law, to first order; where it is large equilibrium is not satisfied"
)


def _estimate(check: Check, folder: Path, several: bool) -> Sequence[Part]:
    """Write maps of the distance from equilibrium; return the page of the estimate."""
    found = check.estimate
    if found is None:
        return [Words([f"Not estimated: {check.not_estimated}"])] if check.not_estimated else []
    rows: list[list[object]] = [
        [one.modulus, 100 * one.strain, one.value_words, one.sigma_words, one.band_words]
        for one in answers(found.best, found.thickness)
    ]
    header = ["modulus", "strain, %", "MPa", "1 sigma", f"{percent(LEVEL)} band, MPa"]
    gaps: list[list[object]] = [[gap.name, gap.chi, gap.words] for gap in found.gaps]
    figures = []
    for gap in found.gaps:
        if gap.places is None or gap.field is None:
            continue
        edge = ConvexHull(gap.places).vertices
        edge = gap.places[np.append(edge, edge[0])]
        fields = zip(("dx, mm", "dy, mm", "dz, mm"), gap.field.T, strict=True)
        out = Output.of(folder, gap.name, several)
        charts = disk_charts([(t, gap.places, v) for t, v in fields], edge)
        save(out.path("equilibrium.png"), charts)
        figures.append((out.name("equilibrium.png"), OFF.format(gap.name)))
    tables = [
        Table("Estimated moduli", header, rows, f"{ESTIMATED} {BOUND_WORDS}.", text=(2, 3, 4)),
        Table("Distance from equilibrium", ["test", "chi", ""], gaps, text=(2,)),
    ]
    return Exhibit(figures=figures, tables=tables).all_parts()


def write_constants(
    project: Project, evaluations: Sequence[BiaxialEvaluation], record: Provenance, folder: Path
) -> Path:
    """Write tables, pictures and the page of the constants of biaxial tests; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    several = len(evaluations) > 1
    exhibits = {}
    notes = []
    for one in evaluations:
        out = Output.of(folder, one.test, several)
        exhibits[one.test] = show_constants(one, out)
        notes += one.notes

    def every(which: str) -> list[Part]:
        heads = {name: [Facts((), name)] if several else [] for name in exhibits}
        return [p for name, e in exhibits.items() for p in (*heads[name], *getattr(e, which))]

    write_notes(folder, notes)
    record.write(folder)
    summary = []
    for one in evaluations:
        c = one.chosen.constants
        ends = one.spread
        parts = [
            f"E {yarn} {value:.4g} kN/m ({low:.4g} to {high:.4g} by what is evaluated)"
            for yarn, value in (("warp", c.warp), ("fill", c.fill))
            for low, high in [ends[f"E {yarn}"]]
        ]
        nu = f"nu_warp {c.nu_warp:.3g}, nu_fill {c.nu_fill:.3g}"
        summary.append(f"{f'{one.test}: ' if several else ''}{', '.join([*parts, nu])}.")
    sections = [
        Section("The constants", every("tables")),
        Section("Measured beside the constants", every("parts")),
        Section("What else was evaluated", every("record")),
        Section("The record", record_tables(record)),
        Section("How to cite", citation()),
    ]
    files = [*(file for e in exhibits.values() for file in e.files), *ALWAYS, *record.files]
    report = Report(
        title=f"{project.title}: constants of biaxial tests",
        summary=" ".join(summary),
        about=about_of(project, record),
        facts=[("ratios", ", ".join(line.ratio for line in one.lines)) for one in evaluations],
        warnings=[note.line for note in notes],
        sections=sections,
        files=files,
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


NOTHING = Words(["Nothing is recorded of what this is of."])
UNFINISHED = (
    "Unfinished: there is no result yet, only what was recorded so far; --resume continues."
)


def page_of_folder(folder: Path) -> Report:
    """Return the page of an output folder, of its records while unfinished; raises InputError."""
    if (folder / PAGE_DATA).exists():
        return read_page_data(folder)
    if (folder / RESULT).exists():
        problem = f"has a result but no {PAGE_DATA}: an older version wrote it; run it again"
        raise InputError(folder, "", problem)
    rows: list[list[object]] = []
    for path in sorted(folder.glob("*/")):
        if (path / RESULT).exists():
            rows.append([path.name, "finished"])
        elif (path / RUN).exists():
            rows.append([path.name, "unfinished"])
    kept = [path for path in (folder / RUNS).glob("*.npz") if not path.name.startswith(".")]
    ran = [Facts([("runs that ended", len(kept))])] if kept else []
    within = [Table("Fits within", ["folder", "how far"], rows, text=(1,))] if rows else []
    if not (folder / RUN).exists() and not within:
        raise InputError(folder, "", f"is no output folder: neither {PAGE_DATA} nor {RUN} is there")
    record = Provenance.read(folder)
    shown = list[Part]([NOTHING])
    if record is not None:
        with suppress(AttributeError, KeyError, TypeError):  # damaged by another hand
            shown = [*record_tables(record)]
    return Report(
        title=f"{folder.resolve().name if record is None else record.project.name}: unfinished",
        summary=UNFINISHED,
        sections=[
            Section("So far", [*_starts(folder), *ran, *within]),
            Section("The record", shown),
        ],
    )


def _starts(folder: Path) -> list[Part]:
    """Return facts and a table of the starts that ended; nothing of a folder without a fit."""
    if not (folder / STARTS).exists():
        return []
    records = RunningFiles(Store(folder), (), ()).finished()
    rows: list[list[object]] = [
        [r.number, r.mesh, r.objective, r.analyses, r.status] for r in records
    ]
    history = folder / HISTORY
    lines = history.read_text(encoding="utf-8", errors="replace").count("\n")
    facts: list[tuple[str, object]] = [
        ("starts that ended", len({r.number for r in records})),
        ("analyses", max(lines - 1, 0)),
    ]
    header = ["start", "mesh", "objective", "analyses", "how it ended"]
    return [Facts(facts), *([Table("Starts", header, rows, text=(1, 4))] if rows else [])]
