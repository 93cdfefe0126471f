"""Write the folder of a study: tables, figures, notes.csv, report.html and, last, result.json.

A function a study returns its content, by the type of its result; `write_study` writes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from ..errors import NOTES, NOTES_ARE, SolverFailure, percent
from ..experiments.kinds import CardRun, Output, PreparedTest, Shown
from ..experiments.registry import report_of
from ..files import replacing, write_notes
from ..inference.likelihood import THRESHOLD
from ..inference.posterior import LEVEL
from ..materials.forms.base import COMPONENTS
from ..runs import bootstrap, plan, profile, weights
from ..runs.compare import LawComparison, noise
from ..runs.folder import RESULT, Store
from ..runs.poisson import Nu12Study
from ..runs.refinement import Refinement, ended, largest_load, rms_changes
from ..runs.validation import Validation
from ..solvers.base import History
from . import studies
from .charts import Charts
from .content import Listing, Picture, Report, Section, Table
from .fit_page import about_of, citation, correlation_table
from .html import write_report
from .moduli import bootstrap_charts
from .vega import save

#: Files of every study, after its own.
FILES = ((NOTES, NOTES_ARE), (RESULT, "all numbers of this page, for programs"))
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


#: Page, tables and figures by file name, and digits of the tables.
Content = tuple[Report, Mapping[str, pd.DataFrame], Mapping[str, Charts], int | None]


def write_study(study: Any, folder: Path) -> Path:
    """Write tables and figures of a study of any type, and the page; return its path."""
    if isinstance(study, LawComparison):  # what each test draws is written there
        page, tables, figures, digits = _comparison(study, folder)
    else:
        page, tables, figures, digits = CONTENT[type(study).__name__](study)
    (folder / RESULT).unlink(missing_ok=True)  # a folder that is half written has no result
    form = None if digits is None else f"%.{digits}g"
    for name, table in tables.items():
        with replacing(folder / name) as path:
            table.to_csv(path, index=False, float_format=form, lineterminator="\n")
    for name, charts in figures.items():
        save(folder / name, charts)
    write_notes(folder, study.notes)
    warnings, files = [note.line for note in study.notes], [*page.files, *FILES]
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
    digits: int | None = None,
) -> Content:  # fmt: skip
    """Return the content of a page of lines, charts and table: NAME.csv, with a figure NAME.png."""
    table, lines = study.table(), study.lines()
    text = tuple(k for k, kind in enumerate(table.dtypes) if not is_numeric_dtype(kind))
    rows = table.to_numpy(object).tolist()
    file, picture = f"{name}.csv", f"{name}.png"
    page = Report(
        title=title,
        sections=[
            Section("What it comes to", [Listing("\n".join(lines))] if lines else []),
            Section("Figure", charts),
            Section("The numbers", [Table("The numbers", list(table.columns), rows, text=text)]),
            Section("How to cite", citation()),
        ],
        files=[(file, "the table"), *([(picture, "picture of the charts")] if figure else [])],
    )
    figures = {} if figure is None else {picture: figure}
    return page, {file: table}, figures, digits


def _refinement(study: Refinement) -> Content:
    title = f"{study.project.path.name}: finer and finer {study.what}"
    charts = studies.convergence_charts(panels(study), study.what, title)
    return plain(study, title, "convergence", [charts], charts)


def panels(study: Refinement) -> list[studies.ConvergencePanel]:
    """Return relative changes from each level to the next finer one, by model."""
    drawn = []
    for name, runs in study.runs.items():
        good = ended(runs)
        every = [run.values or {} for run in good]
        changes: dict[str, list[float]] = {}
        for quantity, last in (every[-1] if good else {}).items():
            values = np.array([own.get(quantity, np.nan) for own in every])
            changes[quantity] = (100 * np.abs(np.diff(values) / last)).tolist()
        if rms := rms_changes(runs):
            largest = largest_load(good)
            changes["RMS along the load curve"] = [100 * r / largest for r in rms]
        sizes = [run.level.size for run in good]
        work = [run.level.elements * run.level.part.increments for run in good]
        drawn.append(
            studies.ConvergencePanel(name, sizes, changes, work, [run.seconds for run in good])
        )
    return drawn


def _nu12(study: Nu12Study) -> Content:
    shown = {
        name: {response: (r.nu12, r.to_base) for response, r in part.responses.items()}
        for name, part in study.parts.items()
    }
    title = f"{study.project.path.name}: what nu12 changes"
    charts = studies.nu12_charts(shown, study.base, study.response, title)
    return plain(study, title, "nu12", [charts], charts)


def _validation(study: Validation) -> Content:
    title = f"{study.project.title}: errors at data left out of the fit"
    charts = studies.held_out_charts(
        *study.errors(), "Errors at data left out of the fit (predicted), and given to it (fitted)"
    )
    return plain(study, title, "validation", [charts], digits=9)


def _weights(study: weights.WeightStudy) -> Content:
    ended = study.ended
    moduli = {
        name: {
            study.strain(name, place): [run.moduli[name][k] for run in ended]
            for k, place in enumerate(weights.PLACES)
        }
        for name in COMPONENTS
    }
    parts = studies.weights_charts(
        study.counted, [run.count for run in ended],
        {name: [run.relative[name] for run in ended] for name in ended[0].relative}, moduli,
        {name: study.sigma(name) for name in COMPONENTS},
    )  # fmt: skip
    figure = Charts("weights", [chart for part in parts for chart in part.charts], "", columns=2)
    title = f"{study.project.title}: the weight of {study.counted}"
    return plain(study, title, "weights", parts, figure, 9)


def _bootstrap(study: bootstrap.Bootstrap) -> Content:
    found, law = study.found, study.found.best.law
    best = {name: law.modulus(name, strain) for name, strain in study.strains.items()}
    charts = bootstrap_charts(study.strains, best, study.bands, study.of_fit, BANDS)
    coefficients = study.coefficients()
    sigma = ", ".join(f"{name} {percent(own)}" for name, (own, _) in study.sigma.items())
    rows: list[list[object]] = [[name, *map(percent, study.sigma[name])] for name in COMPONENTS]
    header = ["modulus", "1 sigma of the samples", "of the fit, by noise"]
    scatter = Table("How far the moduli scatter", header, rows, bootstrap.METHOD, text=(1, 2))
    unknowns = correlation_table(
        "Unknowns over the samples", coefficients, {"sigma_of_fit": "of the fit"},
        "Coefficients in MPa; then the correlations over the samples.",
    )  # fmt: skip
    page = Report(
        title=f"{found.setup.project.title}: bootstrap over {study.over}",
        summary=f"1 sigma over {len(study.samples)} samples: {sigma}.",
        facts=[
            ("card", found.card),
            ("tests", ", ".join(test.test.name for test in found.setup.tests)),
            ("drawn", ", ".join(f"{group.name}: {len(group.units)}" for group in study.groups)),
            ("analyses", study.analyses),
            ("samples that did not settle", study.unfinished),
        ],
        sections=[Section("The samples", [charts, scatter, unknowns])],
        files=[
            ("bootstrap.csv", "moduli along their strains, with both bands"),
            ("bootstrap.png", "picture of the moduli"),
            ("coefficients.csv", "the unknowns, with their correlations over the samples"),
            (bootstrap.SAMPLES, "every sample: what was drawn, and the optimiser's unknowns"),
        ],
    )
    tables = {"bootstrap.csv": study.table(), "coefficients.csv": coefficients}
    return page, tables, {"bootstrap.png": charts}, 9


def _profiles(study: profile.Profiles) -> Content:
    shown = [
        studies.ProfilePanel(one.name, *one.curve, one.best, one.sigma, one.ends, one.band)
        for one in study.each
    ]
    charts = studies.profile_charts(shown, THRESHOLD, LIKELIHOODS)
    header = [
        "modulus", "MPa", f"{100 * LEVEL:.0f} % from, MPa", "to, MPa", "band of the fit from, MPa",
        "to, MPa", "upper over lower distance", "analyses",
    ]  # fmt: skip
    rows = [_interval(one) for one in study.each]
    page = Report(
        title=f"{study.project.title}: profile likelihood",
        summary=f"{study.each[0].name}: {study.each[0].words}.",
        facts=[
            ("card", study.card), ("tests", ", ".join(study.tests)), ("analyses", study.analyses),
        ],
        sections=[
            Section("The profiles", [
                charts, Table("Between what each modulus lies", header, rows, profile.METHOD)
            ])
        ],
        files=[("profile.csv", "the curves"), ("profile.png", "picture of the profiles")],
    )  # fmt: skip
    return page, {"profile.csv": study.table()}, {"profile.png": charts}, 9


def _interval(one: profile.Profile) -> list[object]:
    low, high = (
        end if end is not None else f"not closed: {side.why}"
        for end, side in zip(one.ends, (one.below, one.above), strict=True)
    )
    skew = "" if one.asymmetry is None else one.asymmetry
    return [one.name, one.best, low, high, *one.band, skew, one.analyses]


def _plan(study: plan.Plan) -> Content:
    words, now, first = plan.words, study.now, study.candidates[0]
    every = [("the present tests alone", now)]
    every += [(f"{k}. {p.title}", p) for k, p in enumerate(study.candidates, start=1)]
    sigma = {name: [100 * one.summary[name] for _, one in every] for name in COMPONENTS}
    charts = studies.plan_charts([title for title, _ in every], sigma, UNCERTAINTIES)
    rows: list[list[object]] = [
        [title, *(words(p.summary[name]) for name in COMPONENTS), p.noise] for title, p in every
    ]
    header = ["test", *(f"1 sigma of {name}" for name in COMPONENTS), "noise"]
    along = [
        Table(
            f"1 sigma of {name}",
            ["test", *(f"at {100 * strain:.3g} %" for strain in study.strains[name])],
            [[title, *map(words, study.at(p)[name])] for title, p in every],
        )
        for name in COMPONENTS
    ]
    facts = [("card", study.card), ("present tests", ", ".join(study.tests))]
    facts.append(("ranked by", study.criterion))
    if study.following is not None:
        after = ", ".join(f"{name} {words(s)}" for name, s in study.following.summary.items())
        facts.append(("best after the first", f"{study.following.title}: {after}"))
    change = ", ".join(
        f"{name} {words(now.summary[name])} to {words(first.summary[name])}" for name in COMPONENTS
    )
    title = "Which test next"
    page = Report(
        title=f"{study.project.title}: which test next?",
        summary=f"{first.title}: 1 sigma of {change}.",
        facts=facts,
        sections=[
            Section(title, [charts, Table(title, header, rows, plan.ASSUMED, text=(4,))]),
            Section("Along the strains", along),
        ],
        files=[("plan.csv", "the tables"), ("plan.png", "picture of the chart")],
    )  # fmt: skip
    return page, {"plan.csv": study.table()}, {"plan.png": charts}, 6


def _comparison(study: LawComparison, folder: Path | None = None) -> Content:
    """Return the content of a comparison of forms; with a folder also what each test draws."""
    error, total = study.result["objective_is"], sum(noise(study.forms[0]).values())
    rows = [
        studies.LawRow(f.name, f.coefficients, f.fitted, f.validated, f.left_out())
        for f in study.forms
    ]
    charts, table = studies.law_charts(rows, total, error, ERRORS), study.table()
    note = "fitted: to all points; left out: at what the fits of the folds were not given"
    cells = table.to_numpy(dtype=object).tolist()
    tests = study.forms[0].fit.setup.tests
    chosen = tests if folder is not None else ()
    responses = [shown for test in chosen for shown in _responses(study, test, folder or Path())]
    page = Report(
        title=f"{study.project.title}: forms of the moduli",
        summary="; ".join(study.conclusion),
        facts=[("error", error), ("the data's own noise", total)],
        sections=[
            Section("Errors", [charts, Table("Errors", list(table.columns), cells, note)]),
            Section("The forms side by side", [Picture(*own) for own in responses]),
        ],
        files=[("comparison.csv", "the table"), ("laws.png", "picture of the errors")],
    )
    return page, {"comparison.csv": table}, {"laws.png": charts}, 9


#: Content of the folder of each study, by its type.
CONTENT: Mapping[str, Callable[[Any], Content]] = {
    "Bootstrap": _bootstrap, "LawComparison": _comparison, "Nu12Study": _nu12, "Plan": _plan,
    "Profiles": _profiles, "Refinement": _refinement, "Validation": _validation,
    "WeightStudy": _weights,
}  # fmt: skip


def _responses(study: LawComparison, test: PreparedTest, folder: Path) -> Sequence[Shown]:
    """Return what the kind of a test draws of several cards: here those of the forms."""
    own = test.test
    runs = {}
    for form in study.forms:
        for part, model in own.models().items():
            outcome: History | SolverFailure
            try:
                outcome = form.fit.setup.make_solver().run(model, form.fit.law)
            except SolverFailure as failure:
                outcome = failure
            runs[form.name, part] = CardRun(model, outcome)
    out = Output.of(folder, own.name, len(study.forms[0].fit.setup.tests) > 1)
    cards = {form.name: form.fit.card for form in study.forms}
    return report_of(own.kind).simulate(own, cards, runs, out).figures
