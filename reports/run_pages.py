"""Report pages of predictions, of checks of the data before a fit, and of unfinished runs.

The page of the elastic constants of biaxial tests is written here, too.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from ..errors import InputError
from ..experiments.biaxial.evaluation import BiaxialEvaluation
from ..experiments.cycles.evaluation import Cycles
from ..experiments.cycles.values import CRITERIA
from ..experiments.data_files import Output
from ..inference.reported import BOUND_WORDS, LEVEL
from ..lazy_modules import pandas as pd
from ..notes import Verdict, as_note, note_records, write_notes
from ..project.project import Project
from ..runs.check import Check, PredictionCheck
from ..runs.fit_folder import HISTORY, STARTS, RunningFiles
from ..runs.folder import RESULT, RUN, RUNS, Provenance, Store, versions, write_table
from ..runs.predictions import Predictions
from ..runs.simulation import SimulatedTests
from ..runs.verdict import answers
from ..runs.verification.verify import Verification
from ..storage.writing import json_text, write_text
from ..version import __version__
from ..wording import percent
from .bubbles import disk_charts
from .content import (
    PAGE_DATA,
    Exhibit,
    Facts,
    PageSection,
    Part,
    Report,
    Table,
    Words,
    notes_section,
    read_page_data,
)
from .converter import background
from .html import write_report
from .kinds.biaxial import show_constants
from .presenter import page_presenter_of
from .provenance import FILES_OF_ALL, NOTES_FILE, RESULT_FILE, about_of, citation, record_tables
from .strips import CyclicCurve, cycle_charts
from .vega import save

RUNS_TABLE = "runs.csv"


@background.during_page()
def write_predictions(predictions: Predictions, folder: Path) -> Path:
    """Write all files of predictions into their output folder, result.json last.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
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
    """Return the content of the page of predictions.

    `exhibits` : what the presenter of each kind of test shows, by the name of the kind.
    """
    parts = [p for exhibit in exhibits.values() for p in replace(exhibit, facts=()).all_parts()]
    files = [file for exhibit in exhibits.values() for file in exhibit.files]
    return Report(
        title=predictions.project.title,
        verdicts=[("", predictions.verdict)],
        summary=" ".join(exhibit.summary for exhibit in exhibits.values() if exhibit.summary),
        about=about_of(predictions.project, predictions.record),
        facts=[
            *_run_facts(predictions),
            *(fact for exhibit in exhibits.values() for fact in exhibit.facts),
        ],
        warnings=_ends(predictions),
        sections=[
            PageSection("What was predicted", parts),
            PageSection("What to know of the runs", _notes(predictions)),
            PageSection("The record", record_tables(predictions.record)),
            PageSection("How to cite", citation()),
        ],
        files=[
            (RUNS_TABLE, "the table of runs with all its columns"),
            *FILES_OF_ALL,
            *files,
            *predictions.record.files,
        ],
        versions=predictions.result["versions"],
    )


def _ends(predictions: Predictions) -> list[str]:
    """Return how the runs ended that failed or stopped early."""
    return [
        f"{run.title}: {predictions.ended(i)}"
        for i, run in enumerate(predictions.predicted_runs)
        if run.record.failure or run.record.early
    ]


def _run_facts(predictions: Predictions) -> list[tuple[str, object]]:
    """Return labels and values on the runs: tests, cards, solver and computing time."""
    result = predictions.result
    facts = [
        ("tests", len(result["tests"])),
        ("cards", len(result["cards"])),
        ("solver", result["solver"]),
        ("wall time, s", float(result["wall_s"])),
    ]
    if predictions.cached:
        facts.append(("runs from the cache", predictions.cached))
    seconds = sum(run.record.seconds for run in predictions.predicted_runs)
    return [*facts, ("seconds of all runs", float(seconds))]


def _notes(predictions: Predictions) -> list[Table]:
    """Return a table of the notes of all runs; no table where there are no notes."""
    walls = ["wall"] if any(run.wall for run in predictions.predicted_runs) else []
    rows = [
        [run.test.name, run.card, *(walls and [run.wall]), as_note(note).kind, str(note)]
        for run in predictions.predicted_runs
        for note in run.notes
    ]
    if not rows:
        return []
    words = "What a reader of the numbers above should know of each run."
    header = ["test", "card", *walls, "kind", "note"]
    return [Table("Notes", header, rows, words, text=tuple(range(1, len(header))))]


@background.during_page()
def write_check(check: Check, folder: Path) -> Path:
    """Write the files of a check of the data before a fit: check.json, figures and report.html.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    write_text(folder / "check.json", json_text(check.result))
    has_several = len(check.setup.tests) > 1
    exhibits = _examined(check, folder, has_several)
    header = ["test", "", "doubt", "what was seen"]
    doubts = Table("Doubts", header, check.rows(), text=(1, 2, 3))
    facts = [
        (f"{name}: {label}" if has_several else label, value)
        for name, exhibit in exhibits
        for label, value in exhibit.facts
    ]
    parts = [part for _, e in exhibits for part in replace(e, facts=()).all_parts()]
    report = Report(
        title=f"{check.setup.project.title}: a look at the data",
        verdicts=[("", check.verdict)],
        about=about_of(check.setup.project, None),
        facts=facts,
        warnings=_check_warnings(check),
        sections=[
            PageSection("Doubts", [doubts]),
            PageSection("What was seen", parts),
            PageSection("An estimate by virtual work", _estimate(check, folder, has_several)),
        ],
        files=[
            ("check.json", "the doubts in plain values"),
            *(file for _, exhibit in exhibits for file in exhibit.files),
        ],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


def _examined(check: Check, folder: Path, has_several: bool) -> list[tuple[str, Exhibit]]:
    """Return what the presenters show of the data: pairs of test and exhibit."""
    exhibits = []
    for prepared in check.setup.tests:
        out = Output.of(folder, prepared.test.name, has_several)
        exhibit = page_presenter_of(prepared.test.kind).examine(prepared, out)
        if exhibit is not None:
            exhibits.append((prepared.test.name, exhibit))
    return exhibits


def _check_warnings(check: Check) -> list[str]:
    """Return the errors and the notes of each test, then the notes on all tests together."""
    lines = []
    for judgement in check.judgements:
        lines += [f"{judgement.test}: {doubt.text}" for doubt in judgement.errors]
        lines += [note.line for note in judgement.notes]
    notes = (*check.grave_notes, *check.unbalanced, *check.joined)
    return [*lines, *(note.line for note in notes)]


@background.during_page()
def write_prediction_check(check: PredictionCheck, folder: Path) -> Path:
    """Write check.json and report.html for a project whose tests are only predicted.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    write_text(folder / "check.json", json_text(check.result))
    header = ["test", "", "doubt", "what was seen"]
    tests = Table("Tests", header, check.rows(), text=(1, 2, 3))
    report = Report(
        title=f"{check.project.title}: a look at the data",
        verdicts=[("", check.verdict)],
        about=about_of(check.project, None),
        sections=[PageSection("What was seen", [tests])],
        files=[("check.json", "the doubts in plain values")],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


def _estimate(check: Check, folder: Path, has_several: bool) -> Sequence[Part]:
    """Return the section on the moduli that the virtual work estimates, and write its maps.

    The maps show, over the disk of each bubble test, how far the measured shape is from
    equilibrium with the estimated law.
    """
    estimate = check.estimate
    if estimate is None:
        return [Words([f"Not estimated: {check.not_estimated}"])] if check.not_estimated else []
    rows = [
        [row.modulus, 100 * row.strain, row.value_words, row.sigma_words, row.band_words]
        for row in answers(estimate.best, estimate.thickness)
    ]
    header = ["modulus", "strain, %", "MPa", "1 sigma", f"{percent(LEVEL)} band, MPa"]
    gaps = [[gap.name, gap.chi, gap.words] for gap in estimate.gaps]
    figures = []
    for gap in estimate.gaps:
        if gap.points is None or gap.displacement is None:
            continue
        edge = scipy.spatial.ConvexHull(gap.points).vertices
        edge = gap.points[np.append(edge, edge[0])]
        fields = zip(("dx, mm", "dy, mm", "dz, mm"), gap.displacement.T, strict=True)
        out = Output.of(folder, gap.name, has_several)
        charts = disk_charts([(title, gap.points, values) for title, values in fields], edge)
        save(out.path("equilibrium.png"), charts)
        caption = (
            f"{gap.name}: displacement from the measured shape at the highest pressure to "
            "equilibrium with the estimated law, to first order; where it is large equilibrium is "
            "not satisfied"
        )
        figures.append((out.name("equilibrium.png"), caption))
    note = (
        "No equilibrium is solved for: the measured shapes are put into its equations. Chi is the "
        "distance of shape and equilibrium over that by the noise. A start and a doubt, not a "
        f"result. {BOUND_WORDS}."
    )
    tables = [
        Table("Estimated moduli", header, rows, note, text=(2, 3, 4)),
        Table("Distance from equilibrium", ["test", "chi", ""], gaps, text=(2,)),
    ]
    return Exhibit(figures=figures, tables=tables).all_parts()


@background.during_page()
def write_simulation(simulated: SimulatedTests, folder: Path) -> Path:
    """Write the page of tests that were run with given cards, notes.csv and result.json.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    parts: list[Part] = []
    for name, simulation in simulated.simulations.items():
        if len(simulated.simulations) > 1:
            parts.append(Facts((), name))
        parts += simulation.parts
        if not any(isinstance(part, Table) for part in simulation.parts):
            parts.append(Words(simulation.lines, bulleted=True))
    notes = [note.line for note in simulated.notes]
    write_notes(folder, simulated.notes)
    report = Report(
        title=f"{simulated.project.title}: run with given cards",
        verdicts=[("", simulated.verdict)],
        about=about_of(simulated.project, None),
        facts=[("solver", simulated.solver)],
        sections=[
            PageSection("The result", parts),
            notes_section(notes),
            PageSection("How to cite", citation()),
        ],
        files=FILES_OF_ALL,
        versions={"bubblefit": __version__},
    )
    page = write_report(folder, report)
    Store(folder).finish(simulated.numbers)
    return page


@background.during_page()
def write_cycles(evaluation: Cycles, folder: Path, *, is_fitted: bool) -> dict[str, Any]:
    """Write tables, figure and page of load cycles, and return the numbers of the tables.

    Parameters
    ----------
    evaluation : Cycles
    folder : Path
    is_fitted : bool
        Whether the law with a memory that is fitted to the cycles is written, too.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    tables = {
        "cycles": evaluation.table,
        "holds": evaluation.holds,
        "notes": pd.DataFrame(note_records(evaluation.notes)),
    }
    if is_fitted:
        tables |= {"memory": evaluation.memory, "left-out": evaluation.left_out}
    for name, table in {**tables, "loops": evaluation.loops}.items():
        write_table(table, folder / f"{name}.csv")
    charts = cycle_charts(_load_curves(evaluation, is_fitted))
    save(folder / "cycles.png", charts)
    notes = [note.line for note in evaluation.notes]
    shown: list[Part] = [charts, cycle_table(evaluation)]
    if is_fitted:
        shown.append(Words(evaluation.fit_lines(), bulleted=True))
    names = [evaluated.name for evaluated in evaluation.histories]
    report = Report(
        title="Load cycles",
        verdicts=[("", evaluation.verdict)],
        about=[("date", str(date.today())), ("files", ", ".join(names))],
        sections=[
            PageSection("The result", shown),
            notes_section(notes),
            PageSection("How to cite", citation()),
        ],
        files=[
            ("cycles.csv", "the table of cycles with all its columns"),
            ("loops.csv", "every reading of every cycle"),
            ("holds.csv", "creep and relaxation where the load or the strain is held"),
            NOTES_FILE,
        ],
        versions={"bubblefit": __version__},
    )
    write_report(folder, report)
    numbers = {name: json.loads(table.to_json(orient="records")) for name, table in tables.items()}
    return {"command": "cycles", "verdict": evaluation.verdict.numbers, **numbers}


def _load_curves(evaluation: Cycles, is_fitted: bool) -> list[CyclicCurve]:
    """Return the histories as `cycle_charts` draws them, with the fitted law if there is one."""
    curves: list[CyclicCurve] = []
    for k, evaluated in enumerate(evaluation.histories):
        strain = evaluated.history.strain - evaluated.zero
        model = None
        if is_fitted:
            fit = evaluation.fits[k]
            model = strain[fit.rows], fit.load
        turns = [(v.cycle.start, v.cycle.peak, v.cycle.end) for v in evaluated.values]
        curves.append((evaluated.name, evaluated.history.load, strain, turns, model))
    return curves


def cycle_table(evaluation: Cycles) -> Table:
    """Return the table of a page on load cycles: what each cycle comes to, in words and percent."""
    scale, unit = evaluation.stiffness_unit
    rows = [
        [
            evaluated.name,
            v.cycle.number,
            v.peak,
            100.0 * v.permanent,
            scale * v.EA_loading,
            scale * v.EA_unloading,
            v.loss,
            100.0 * v.loss / v.work,
        ]
        for evaluated in evaluation.histories
        for v in evaluated.values
    ]
    header = ["specimen", "cycle", "peak, N", "permanent strain, %", f"stiffness loading, {unit}"]
    header += [f"stiffness unloading, {unit}", "energy lost, J/m", "of the work, %"]
    loads = {e.name: e.reference for e in evaluation.histories}
    words = ", ".join(f"{load:.4g} N ({name})" for name, load in loads.items())
    shares = f"{percent(CRITERIA.tangent_from)} and {percent(CRITERIA.tangent_to)}"
    note = (
        f"Permanent strain: at the reference load, {words}. Stiffness: tangent between {shares} "
        "of the peak."
    )
    return Table("The cycles", header, rows, note)


@background.during_page()
def write_verification(verification: Verification, folder: Path) -> Path:
    """Write the page of a comparison with published numbers, and result.json.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    tables = []
    for subject, numbers in verification.subjects.items():
        rows = []
        for number in numbers:
            factor, unit = (1.0, number.unit) if number.absolute else (100.0, "%")
            off = f"{factor * number.deviation:+.4f} {unit}"
            allowed = f"{factor * number.allowed:.4g} {unit}"
            met = "met" if number.met else "MISSED"
            values = [float(number.ours), float(number.theirs), number.unit, off, allowed]
            rows.append([number.quantity, *values, met, number.source])
        header = ["quantity", "ours", "theirs", "unit", "off", "allowed", "", "source"]
        tables.append(Table(subject, header, rows, text=(3, 6, 7)))
    report = Report(
        title="This installation beside published numbers",
        verdicts=[("", verification.verdict)],
        about=[("date", str(date.today()))],
        sections=[PageSection("The numbers", tables), PageSection("How to cite", citation())],
        files=[RESULT_FILE],
        versions=versions(),
    )
    page = write_report(folder, report)
    Store(folder).finish(verification.result)
    return page


@background.during_page()
def write_constants(
    project: Project, evaluations: Sequence[BiaxialEvaluation], record: Provenance, folder: Path
) -> Path:
    """Write the folder of the elastic constants of biaxial tests, as `bubblefit biaxial` does.

    Parameters
    ----------
    project : Project
        The project.
    evaluations : sequence of BiaxialEvaluation
        One for each test.
    record : Provenance
        Record of the run and its data files.
    folder : Path
        Output folder, which is made if it is missing.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    has_several = len(evaluations) > 1
    exhibits = {}
    notes = []
    for evaluation in evaluations:
        out = Output.of(folder, evaluation.test, has_several)
        exhibits[evaluation.test] = show_constants(evaluation, out)
        notes += evaluation.notes
    write_notes(folder, notes)
    record.write(folder)
    report = Report(
        title=f"{project.title}: constants of biaxial tests",
        verdicts=[(e.test if has_several else "", e.verdict) for e in evaluations],
        about=about_of(project, record),
        facts=[
            (
                f"{e.test}: ratios" if has_several else "ratios",
                ", ".join(line.ratio for line in e.lines),
            )
            for e in evaluations
        ],
        sections=[
            PageSection("The constants", _of_tests(exhibits, lambda e: e.tables)),
            PageSection("Measured beside the constants", _of_tests(exhibits, lambda e: e.parts)),
            PageSection("What else was evaluated", _of_tests(exhibits, lambda e: e.record)),
            PageSection("The record", record_tables(record)),
            PageSection("How to cite", citation()),
        ],
        files=[
            *(file for exhibit in exhibits.values() for file in exhibit.files),
            *FILES_OF_ALL,
            *record.files,
        ],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


def _of_tests(
    exhibits: Mapping[str, Exhibit], parts_of: Callable[[Exhibit], Sequence[Part]]
) -> list[Part]:
    """Return the same kind of parts of every test, below its name if there are several tests."""
    parts: list[Part] = []
    for name, exhibit in exhibits.items():
        if len(exhibits) > 1:
            parts.append(Facts((), name))
        parts += parts_of(exhibit)
    return parts


#: Verdict on a folder without a result.
UNFINISHED = Verdict(
    "not to be used",
    "the run is unfinished: there is no result yet, only what was recorded so far",
    next_step="continue it: repeat the command with --resume",
)


def page_of_folder(folder: Path) -> Report:
    """Return the content of the page of an output folder, read from its files.

    Of an unfinished run it is made of what was recorded so far.

    Raises
    ------
    InputError
        It is no output folder, page.json is damaged, or the folder has a result without it.
    """
    if (folder / PAGE_DATA).exists():
        return read_page_data(folder)
    if (folder / RESULT).exists():
        problem = f"has a result but no {PAGE_DATA}: an older version wrote it; run it again"
        raise InputError(folder, "", problem)
    fits = _fits_within(folder)
    if not (folder / RUN).exists() and not fits:
        raise InputError(folder, "", f"is no output folder: neither {PAGE_DATA} nor {RUN} is there")
    record = Provenance.read(folder)
    tables: Sequence[Part] = [Words(["Nothing is recorded of what this is of."])]
    if record is not None:
        with suppress(AttributeError, KeyError, TypeError):  # damaged by another hand
            tables = record_tables(record)
    title = folder.resolve().name if record is None else record.project.name
    return Report(
        title=f"{title}: unfinished",
        verdicts=[("", UNFINISHED)],
        sections=[
            PageSection("So far", [*_starts(folder), *_runs(folder), *fits]),
            PageSection("The record", tables),
        ],
    )


def _fits_within(folder: Path) -> list[Table]:
    """Return a table of fits in subfolders, finished or not; no table where there are none."""
    rows = []
    for path in sorted(folder.glob("*/")):
        if (path / RESULT).exists():
            rows.append([path.name, "finished"])
        elif (path / RUN).exists():
            rows.append([path.name, "unfinished"])
    return [Table("Fits within", ["folder", "how far"], rows, text=(1,))] if rows else []


def _runs(folder: Path) -> list[Facts]:
    """Return the number of runs of a folder that have ended; nothing where there are none."""
    files = [path for path in (folder / RUNS).glob("*.npz") if not path.name.startswith(".")]
    return [Facts([("runs that ended", len(files))])] if files else []


def _starts(folder: Path) -> list[Part]:
    """Return the starts of an unfinished fit that have ended; nothing in a folder without fit."""
    if not (folder / STARTS).exists():
        return []
    records = RunningFiles(Store(folder), (), ()).finished()
    rows = [[r.number, r.mesh, r.objective, r.analyses, r.status] for r in records]
    history = folder / HISTORY
    lines = history.read_text(encoding="utf-8", errors="replace").count("\n")
    facts = [
        ("starts that ended", len({r.number for r in records})),
        ("analyses", max(lines - 1, 0)),
    ]
    header = ["start", "mesh", "objective", "analyses", "how it ended"]
    return [Facts(facts), *([Table("Starts", header, rows, text=(1, 4))] if rows else [])]
