"""The folder of predictions: tables, figures, report.html, and last result.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..experiments.kinds import Output
from ..experiments.registry import report_of
from ..files import replacing
from ..notes import MARKS, NOTES, NOTES_ARE, as_note, marks, write_notes
from ..runs.folder import RESULT, Store
from .content import Exhibit, Report, Section, Table
from .fit_page import citation, record_tables
from .html import percent, write_report

if TYPE_CHECKING:
    from ..runs.predictions import Predictions

RUNS_TABLE = "runs.csv"


def write_predictions(predictions: Predictions, folder: Path) -> Path:
    """Write everything; raises OutputError."""
    (folder / RESULT).unlink(missing_ok=True)
    if predictions.record is not None:
        predictions.record.write(folder)
    several = len(predictions.outcomes) > 1
    exhibits = {
        kind: report_of(kind).show_outcome(outcome, Output(folder, f"{kind}/" if several else ""))
        for kind, (outcome, _) in predictions.outcomes.items()
    }
    write_notes(folder, predictions.notes)
    with replacing(folder / RUNS_TABLE) as path:
        predictions.runs().to_csv(path, index=False)
    page = write_report(folder, _page(predictions, exhibits))
    Store(folder).finish(predictions.result)
    return page


def _page(predictions: Predictions, exhibits: Mapping[str, Exhibit]) -> Report:
    each, result = predictions.each, predictions.result
    ended = [predictions.ended(i) for i in range(len(each))]
    finished = sum(not (run.record.failure or run.record.early) for run in each)
    summary = f"{finished} of {len(each)} runs finished."
    noted = sum(bool(run.notes) for run in each)
    if noted:
        summary += f" {noted} have notes."
    for mark in MARKS:
        count = sum(mark in marks(run.notes) for run in each)
        if count:
            summary += f" Marked {mark.value!r}: {count}."
    if predictions.worst is not None:
        summary += f" Largest error against measured values: {percent(predictions.worst)}."
    record = [] if predictions.record is None else record_tables(predictions.record)
    return Report(
        title=predictions.project.title,
        summary=summary,
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
            Section("What was predicted", [
                part
                for exhibit in exhibits.values()
                for part in replace(exhibit, facts=()).all_parts()
            ]),
            Section("What to know of the runs", _notes(predictions)),
            Section(
                "The record", record
            ),
            Section("How to cite", citation()),
        ],
        files=[
            (RUNS_TABLE, "the table of runs with all its columns"),
            (NOTES, NOTES_ARE),
            (RESULT, "all numbers of this page, for programs"),
            *(file for exhibit in exhibits.values() for file in exhibit.files),
            *([] if predictions.record is None else predictions.record.files),
        ],
        versions=result["versions"],
    )  # fmt: skip


def _notes(predictions: Predictions) -> list[Table]:
    walls = ["wall"] if any(run.wall for run in predictions.each) else []
    rows: list[list[object]] = [
        [run.test.name, run.card, *(walls and [run.wall]), as_note(note).kind.value, str(note)]
        for run in predictions.each
        for note in run.notes
    ]
    if not rows:
        return []
    what = "What a reader of the numbers above should know of each run."
    header = ["test", "card", *walls, "kind", "note"]
    return [Table("Notes", header, rows, what, text=tuple(range(1, len(header))))]
