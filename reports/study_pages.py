"""Write the folder of a study: tables, figures, notes.csv, report.html and, last, result.json.

A function a study returns its content, by the type of its result; `write_study` writes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype

from ..experiments.kinds import CardRun, Output, PreparedTest, Shown
from ..experiments.registry import report_of
from ..files import write_notes
from ..inference.likelihood import THRESHOLD
from ..inference.posterior import LEVEL
from ..runs import bootstrap, plan, profile
from ..runs.compare import LawComparison
from ..runs.folder import RESULT, Store, write_table
from ..runs.refinement import Nu12Study, Refinement
from ..runs.simulation import attempt
from ..runs.validation import Validation, WeightStudy
from . import studies
from .charts import Charts
from .content import Listing, Picture, Report, Section, Table, Words
from .fit_page import ALWAYS, about_of, citation, correlation_table
from .html import write_report
from .vega import save

BANDS = (
    f"Moduli of the fit, percentiles of the samples ({100 * LEVEL:.0f} %) and the fit's own "
    "band by the noise alone"
)
LIKELIHOODS = (
    "-2 log L of each modulus held at a value, everything else fitted anew (dots), and by the "
    "1 sigma of the fit, its bounds left aside (dashed); the horizontal line is the threshold "
    f"of {100 * LEVEL:.0f} %"
)
UNCERTAINTIES = "1 sigma of the moduli with one more test, root mean square along each"
ERRORS = "Error of the fit, and at specimens left out of it; the line is the data's own noise"
HELD_OUT = "Errors at data left out of the fit (predicted), and given to it (fitted)"
COMPARED = "Fitted: to all points; left out: at what the fits of the folds were not given."
#: Rows of a table from which on it is opened by a click.
LONG = 20


#: Page, tables and figures by file name, and digits of the tables.
Content = tuple[Report, Mapping[str, pd.DataFrame], Mapping[str, Charts], int | None]


def write_study(study: Any, folder: Path) -> Path:
    """Write tables and figures of a study of any type, and the page; return its path."""
    if isinstance(study, LawComparison):  # what each test draws is written there
        page, tables, figures, digits = _comparison(study, folder)
    else:
        page, tables, figures, digits = CONTENT[type(study).__name__](study)
    (folder / RESULT).unlink(missing_ok=True)  # a folder that is half written has no result
    for name, table in tables.items():
        write_table(table, folder / name, digits)
    for name, charts in figures.items():
        save(folder / name, charts)
    write_notes(folder, study.notes)
    warnings, files = [note.line for note in study.notes], [*page.files, *ALWAYS]
    about = about_of(study.project, None)
    written = write_report(folder, replace(page, about=about, warnings=warnings, files=files))
    Store(folder).finish(study.result)
    return written


def figure(study: Any) -> Charts:
    """Return the figure of a study for a notebook."""
    page, _, figures, _ = CONTENT[type(study).__name__](study)
    on_page = (part for section in page.sections for part in section.parts)
    every = [*figures.values(), *(part for part in on_page if isinstance(part, Charts))]
    return every[0]


def plain(
    study: Any, title: str, name: str, charts: Sequence[Charts], figure: Charts | None = None,
    digits: int | None = None, method: str = "", more: Sequence[Section] = (),
    files: Sequence[tuple[str, str, pd.DataFrame | None]] = (), picture: str = "",
) -> Content:  # fmt: skip
    """Return the content of a page of lines, charts and table: NAME.csv, with a figure NAME.png.
    method : words below the lines. more : sections behind the charts. files : further
    ones of the folder: name, words, and the table that is written there. picture : another name."""
    table, result = study.table(), study.result
    text = tuple(k for k, kind in enumerate(table.dtypes) if not is_numeric_dtype(kind))
    rows, columns = table.to_numpy(object).tolist(), list(table.columns)
    file, picture = f"{name}.csv", picture or f"{name}.png"
    facts: list[tuple[str, object]] = [
        (key, ", ".join(said) if isinstance(said, list) else said)
        for key in ("card", "tests", "solver", "analyses") if (said := result.get(key))
    ]  # fmt: skip
    page = Report(
        title=title,
        facts=facts,
        sections=[
            Section("What it comes to", [Listing("\n".join(study.lines()))]),
            Section("How it was found", [Words([method])] if method else []),
            Section("Figure", charts),
            *more,
            Section("The numbers", [
                Table("The numbers", columns, rows, text=text, closed=len(rows) > LONG)
            ]),
            Section("How to cite", citation()),
        ],
        files=[
            (file, "the table"), *([(picture, "picture of the charts")] if figure else []),
            *((other, words) for other, words, _ in files),
        ],
    )  # fmt: skip
    tables = {file: table} | {other: own for other, _, own in files if own is not None}
    return page, tables, {} if figure is None else {picture: figure}, digits


def _refinement(study: Refinement) -> Content:
    title = f"{study.project.path.name}: finer and finer {study.what}"
    charts = studies.convergence_charts(study, title)
    return plain(study, title, "convergence", [charts], charts)


def _nu12(study: Nu12Study) -> Content:
    title = f"{study.project.path.name}: what nu12 changes"
    charts = studies.nu12_charts(study, title)
    return plain(study, title, "nu12", [charts], charts)


def _validation(study: Validation) -> Content:
    title = f"{study.project.title}: errors at data left out of the fit"
    return plain(study, title, "validation", [studies.held_out_charts(study, HELD_OUT)], digits=9)


def _weights(study: WeightStudy) -> Content:
    parts = studies.weights_charts(study)
    figure = Charts("weights", [chart for part in parts for chart in part.charts], "", columns=2)
    title = f"{study.project.title}: the weight of {study.counted}"
    return plain(study, title, "weights", parts, figure, 9)


def _bootstrap(study: bootstrap.Bootstrap) -> Content:
    charts, coefficients = studies.bootstrap_charts(study, BANDS), study.coefficients()
    unknowns = correlation_table(
        "Unknowns over the samples", coefficients, {"sigma_of_fit": "of the fit"},
        "Coefficients in MPa; then the correlations over the samples.",
    )  # fmt: skip
    words = "the unknowns, with their correlations over the samples"
    samples = "every sample: what was drawn, and the optimiser's unknowns"
    return plain(
        study, f"{study.project.title}: bootstrap over {study.over}", "bootstrap", [charts], charts,
        9, bootstrap.METHOD, [Section("The unknowns", [unknowns])],
        [("coefficients.csv", words, coefficients), (bootstrap.SAMPLES, samples, None)],
    )  # fmt: skip


def _profiles(study: profile.Profiles) -> Content:
    each = [studies.profile_chart(one, THRESHOLD) for one in study.each]
    charts = Charts("profiles", each, LIKELIHOODS)
    title = f"{study.project.title}: profile likelihood"
    return plain(study, title, "profile", [charts], charts, 9, profile.METHOD)


def _plan(study: plan.Plan) -> Content:
    charts = studies.plan_charts(study, UNCERTAINTIES)
    return plain(study, f"{study.project.title}: which test next?", "plan", [charts], charts, 6)


def _comparison(study: LawComparison, folder: Path | None = None) -> Content:
    """Return the content of a comparison of forms; with a folder also what each test draws."""
    noise, error = sum(study.forms[0].noise.values()), study.result["objective_is"]
    charts = studies.law_charts(study.forms, noise, error, ERRORS)
    tests = study.forms[0].fit.setup.tests if folder is not None else ()
    drawn = [Picture(*own) for test in tests for own in _responses(study, test, folder or Path())]
    return plain(
        study, f"{study.project.title}: forms of the moduli", "comparison", [charts], charts, 9,
        COMPARED, [Section("The forms side by side", drawn)], picture="laws.png",
    )  # fmt: skip


#: Content of the folder of each study, by its type.
CONTENT: Mapping[str, Callable[[Any], Content]] = {
    "Bootstrap": _bootstrap, "LawComparison": _comparison, "Nu12Study": _nu12, "Plan": _plan,
    "Profiles": _profiles, "Refinement": _refinement, "Validation": _validation,
    "WeightStudy": _weights,
}  # fmt: skip


def _responses(study: LawComparison, test: PreparedTest, folder: Path) -> Sequence[Shown]:
    """Return what the kind of a test draws of several cards: here those of the forms."""
    own = test.test
    runs = {
        (form.name, part): CardRun(
            model, attempt(form.fit.setup.make_solver().run, model, form.fit.law)
        )
        for form in study.forms
        for part, model in own.models().items()
    }
    out = Output.of(folder, own.name, len(study.forms[0].fit.setup.tests) > 1)
    cards = {form.name: form.fit.card for form in study.forms}
    return report_of(own.kind).simulate(own, cards, runs, out).figures
