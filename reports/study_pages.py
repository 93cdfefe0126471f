"""Write the folder of a study: tables, charts, notes.csv, report.html and, last, result.json.

A function a study returns its content, by the type of its result; `write_study` writes it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from ..experiments.base import PreparedTest
from ..experiments.forward import CardRun
from ..experiments.output import Output, Shown
from ..experiments.presenter import presenter_of
from ..inference.likelihood import THRESHOLD
from ..inference.reported import LEVEL
from ..materials.forms.base import COMPONENTS
from ..notes import write_notes
from ..presenting import DRAWINGS, PAGES
from ..runs import bootstrap, plan, profile
from ..runs.compare import FormFit, LawComparison
from ..runs.folder import RESULT, Presented, Store, write_table
from ..runs.refinement import Level, Nu12Study, Refinement, ended, largest_load, rms_changes
from ..runs.simulation import attempt
from ..runs.validation import PLACES, Validation, WeightStudy
from .charts import PANELS, TITLES, Chart, Charts, Series, axis_top, dots, line, spans_a_decade
from .content import Listing, Picture, Report, Section, Table, Words
from .fit_page import FILES_OF_ALL, about_of, citation, correlation_table
from .html import write_report
from .vega import Drawing, save

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
        page, tables, figures, digits = CONTENT[type(study)](study)
    (folder / RESULT).unlink(missing_ok=True)  # a folder that is half written has no result
    for name, table in tables.items():
        write_table(table, folder / name, digits)
    for name, charts in figures.items():
        save(folder / name, charts)
    write_notes(folder, study.notes)
    warnings = [note.line for note in study.notes]
    files = [*page.files, *FILES_OF_ALL]
    about = about_of(study.project, None)
    written = write_report(folder, replace(page, about=about, warnings=warnings, files=files))
    Store(folder).finish(study.result)
    return written


def figure(study: Any) -> Charts:
    """Return the figure of a study for a notebook."""
    page, _, figures, _ = CONTENT[type(study)](study)
    on_page = (part for section in page.sections for part in section.parts)
    every = [*figures.values(), *(part for part in on_page if isinstance(part, Charts))]
    return every[0]


def plain(
    study: Any,
    title: str,
    name: str,
    charts: Sequence[Charts],
    figure: Charts | None = None,
    digits: int | None = None,
    method: str = "",
    more: Sequence[Section] = (),
    files: Sequence[tuple[str, str, pd.DataFrame | None]] = (),
    picture: str = "",
) -> Content:
    """Return the content of a page of lines, charts and table: NAME.csv, with a figure NAME.png.
    method : words below the lines. more : sections behind the charts. files : further
    ones of the folder: name, words, and the table that is written there. picture : another name."""
    table = study.table()
    result = study.result
    text = tuple(k for k, kind in enumerate(table.dtypes) if not is_numeric_dtype(kind))
    rows = table.to_numpy(object).tolist()
    columns = list(table.columns)
    file = f"{name}.csv"
    picture = picture or f"{name}.png"
    facts: list[tuple[str, object]] = [
        (key, ", ".join(said) if isinstance(said, list) else said)
        for key in ("card", "tests", "solver", "analyses")
        if (said := result.get(key))
    ]
    page = Report(
        title=title,
        facts=facts,
        sections=[
            Section("What it comes to", [Listing("\n".join(study.lines()))]),
            Section("How it was found", [Words([method])] if method else []),
            Section("Figure", charts),
            *more,
            Section(
                "The numbers",
                [Table("The numbers", columns, rows, text=text, closed=len(rows) > LONG)],
            ),
            Section("How to cite", citation()),
        ],
        files=[
            (file, "the table"),
            *([(picture, "picture of the charts")] if figure else []),
            *((other, words) for other, words, _ in files),
        ],
    )
    tables = {file: table} | {other: own for other, _, own in files if own is not None}
    return page, tables, {} if figure is None else {picture: figure}, digits


def _refinement(study: Refinement) -> Content:
    title = f"{study.project.path.name}: finer and finer {study.what}"
    charts = convergence_charts(study, title)
    return plain(study, title, "convergence", [charts], charts)


def _nu12(study: Nu12Study) -> Content:
    title = f"{study.project.path.name}: what nu12 changes"
    charts = nu12_charts(study, title)
    return plain(study, title, "nu12", [charts], charts)


def _validation(study: Validation) -> Content:
    title = f"{study.project.title}: errors at data left out of the fit"
    return plain(study, title, "validation", [held_out_charts(study, HELD_OUT)], digits=9)


def _weights(study: WeightStudy) -> Content:
    parts = weights_charts(study)
    figure = Charts("weights", [chart for part in parts for chart in part.charts], "", columns=2)
    title = f"{study.project.title}: the weight of {study.counted}"
    return plain(study, title, "weights", parts, figure, 9)


def _bootstrap(study: bootstrap.Bootstrap) -> Content:
    charts = bootstrap_charts(study, BANDS)
    coefficients = study.coefficients()
    unknowns = correlation_table(
        "Unknowns over the samples",
        coefficients,
        {"sigma_of_fit": "of the fit"},
        "Coefficients in MPa; then the correlations over the samples.",
    )
    words = "the unknowns, with their correlations over the samples"
    samples = "every sample: what was drawn, and the optimiser's unknowns"
    return plain(
        study,
        f"{study.project.title}: bootstrap over {study.over}",
        "bootstrap",
        [charts],
        charts,
        9,
        bootstrap.METHOD,
        [Section("The unknowns", [unknowns])],
        [("coefficients.csv", words, coefficients), (bootstrap.SAMPLES, samples, None)],
    )


def _profiles(study: profile.Profiles) -> Content:
    each = [profile_chart(one, THRESHOLD) for one in study.profiles]
    charts = Charts("profiles", each, LIKELIHOODS)
    title = f"{study.project.title}: profile likelihood"
    return plain(study, title, "profile", [charts], charts, 9, profile.METHOD)


def _plan(study: plan.Plan) -> Content:
    charts = plan_charts(study, UNCERTAINTIES)
    return plain(study, f"{study.project.title}: which test next?", "plan", [charts], charts, 6)


def _comparison(study: LawComparison, folder: Path | None = None) -> Content:
    """Return the content of a comparison of forms; with a folder also what each test draws."""
    noise = sum(study.forms[0].noise.values())
    error = study.result["objective_is"]
    charts = law_charts(study.forms, noise, error, ERRORS)
    tests = study.forms[0].fit.setup.tests if folder is not None else ()
    drawn = [Picture(*own) for test in tests for own in _responses(study, test, folder or Path())]
    return plain(
        study,
        f"{study.project.title}: forms of the moduli",
        "comparison",
        [charts],
        charts,
        9,
        COMPARED,
        [Section("The forms side by side", drawn)],
        picture="laws.png",
    )


#: Content of the folder of each study, by its type.
CONTENT: Mapping[type, Callable[[Any], Content]] = {
    bootstrap.Bootstrap: _bootstrap,
    LawComparison: _comparison,
    Nu12Study: _nu12,
    plan.Plan: _plan,
    profile.Profiles: _profiles,
    Refinement: _refinement,
    Validation: _validation,
    WeightStudy: _weights,
}


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
    return presenter_of(own.kind).simulate(own, cards, runs, out).figures


# Charts: refinement, Poisson's ratio, weights, errors by name

#: Percent; a smaller change is the solver's tolerance, and would only stretch the axis.
SMALLEST = 1e-5
#: Quantities at one load or place after the other.
SERIES = r"apex at |load at \d"
SIZES = {"elements": "mean edge, mm", "increments": "step, share of the load"}
#: Lines up to this number have colours of their own; of more, colours rise from first to last.
NAMED = 6
#: %, beyond which a modulus is drawn as unknown, at the end of the axis.
MOST = 100.0
#: Distance over which the dots of one name are spread; of the single folds beside them.
ASIDE, FURTHER = 0.3, 0.1
#: The weight where it is what the project says.
AS_WRITTEN = 1.0
#: Of the threshold of a profile, up to where its chart goes; points of the parabola in it.
ROOM, POINTS = 1.6, 81


def convergence_charts(study: Refinement, caption: str) -> Charts:
    """Return the changes of each model under refinement, with slopes 1 and 2, and the cost."""
    every = {TITLES.get(name, name): ended(runs) for name, runs in study.runs.items()}
    charts = [_changes(title, good, SIZES[study.what]) for title, good in every.items()]
    cost = [
        line(
            title,
            [run.elements * run.part.increments for run in good],
            [run.seconds for run in good],
            colour=rank,
            marks=True,
        )
        for rank, (title, good) in enumerate(every.items())
    ]
    across = "elements × increments"
    alt = "wall clock over elements times increments"
    charts.append(Chart("cost", across, "seconds", cost, alt, log_y=True, log_x=True))
    words = f"{caption}. Grey: what falls with the first and the second power of the size"
    return Charts("convergence", charts, f"{words}; changes below {SMALLEST:g} % are not drawn.")


def _changes(title: str, good: Sequence[Level], size: str) -> Chart:
    """Return the relative changes of one model, from each level that ended to the next finer."""
    sizes = np.array([run.size for run in good[:-1]])
    every = [run.values or {} for run in good]
    changes = {
        quantity: 100 * np.abs(np.diff([own.get(quantity, np.nan) for own in every]) / last)
        for quantity, last in (every[-1] if every else {}).items()
    }
    if rms := rms_changes(good):
        changes["RMS along the load curve"] = 100 * np.array(rms) / largest_load(good)
    loads = [name for name in changes if re.match(SERIES, name)]
    rising = dict(zip(loads, np.linspace(0.0, 1.0, max(2, len(loads))).tolist(), strict=False))
    drawn = {name: np.where(own > SMALLEST, own, np.nan) for name, own in changes.items()}
    series: list[Series] = [
        line(name, sizes, change, colour=rank, rank=rising.get(name), marks=True)
        for rank, (name, change) in enumerate(drawn.items())
    ]
    seen = np.concatenate([c[np.isfinite(c)] for c in drawn.values()] or [np.zeros(0)])
    if len(seen):
        series += [
            line(
                f"order {p}",
                sizes,
                1.6 * seen.max() * (sizes / sizes.max()) ** p,
                colour=7,
                dashes=p,
                faint=True,
            )
            for p in (1, 2)
        ]
    extent = f"largest {seen.max():.3g} %, least {seen.min():.3g} %" if len(seen) else "none"
    label = "change to the next finer level, %"
    return Chart(title, size, label, series, f"{title}: {label}: {extent}", log_y=True, log_x=True)


def nu12_charts(study: Nu12Study, caption: str) -> Charts:
    """Return responses over that at the base nu12, a chart a model."""
    charts = []
    label = f"{study.response} / that at nu12 = {study.base:g}"
    for name, part in study.parts.items():
        count = len(part.responses)
        series = [
            line(
                own,
                found.nu12,
                found.to_base,
                colour=k,
                rank=k / (count - 1) if count > NAMED else None,
                marks=True,
            )
            for k, (own, found) in enumerate(part.responses.items())
        ]
        series.append(dots("", [study.base], [1.0], colour=3, shape="diamond"))
        title = TITLES.get(name, name)
        ratios = [found.to_base for found in part.responses.values()]
        known = np.concatenate([y[np.isfinite(y)] for y in ratios] or [np.ones(1)])
        extent = f"{known.min():.4g} to {known.max():.4g}" if len(known) else "none known"
        alt = f"{title}: {label}: {extent}"
        charts.append(Chart(title, "nu12", label, series, alt, level=1.0))
    return Charts("nu12", charts, caption)


def profile_chart(one: profile.Profile, threshold: float) -> Chart:
    """Return the profile likelihood of a modulus: -2 log L over it, the threshold and the ends."""
    values, ratios = one.curve
    x = np.linspace(min(values), max(values), POINTS)
    parabola = ((x - one.best) / one.sigma) ** 2
    inside = np.where(parabola <= ROOM * threshold, parabola, np.nan)
    series: list[Series] = [
        line("profile", values, ratios, marks=True),
        line("by the 1 sigma of the fit", x, inside, colour=1, dashes=1),
    ]
    known = [end for end in one.ends if end is not None]
    series += [line("ends", [end, end], [0.0, threshold], dashes=2) for end in known]
    low, high = ("not closed" if end is None else f"{end:.4g} MPa" for end in one.ends)
    alt = f"{one.name}: best {one.best:.4g} MPa, lower end {low}, upper end {high}"
    return Chart(
        one.name,
        "tangent modulus, MPa",
        "-2 log L",
        series,
        alt,
        from_zero=True,
        top=ROOM * threshold,
        level=threshold,
    )


def weights_charts(study: WeightStudy) -> list[Charts]:
    """Return errors of the tests, then moduli (MPa, with 1 sigma), over the weight of some."""
    across = f"weight of {study.counted}, times that of the project"
    ended = study.ended
    counts = [run.count for run in study.ended]
    drawn = [
        line(name, counts, [100 * run.relative[name] for run in ended], colour=rank, marks=True)
        for rank, name in enumerate(ended[0].relative)
    ]
    label = "relative RMS error, %"
    alt = f"{label} of {', '.join(ended[0].relative)} over the weight of {study.counted}"
    first = Chart("Errors of the tests", across, label, drawn, alt, from_zero=True, log_x=True)
    others = []
    for name in COMPONENTS:
        bars = study.sigma(name) or [0.0] * len(PLACES)
        series: list[Series] = []
        for rank, (place, bar) in enumerate(zip(PLACES, bars, strict=True)):
            moved = [run.moduli[name][rank] for run in ended]
            own = float(np.interp(AS_WRITTEN, counts, moved))
            said = study.strain(name, place)
            series.append(line(f"at {100 * said:.3g} %", counts, moved, dashes=rank, marks=True))
            if bar:
                ends = [own * (1 - bar)], [own * (1 + bar)]
                series.append(dots("1 sigma", [AS_WRITTEN], [own], ends, colour=7))
        alt = f"{name} at {len(PLACES)} strains over the weight of {study.counted}"
        others.append(Chart(name, across, "MPa", series, alt, from_zero=True, log_x=True))
    return [
        Charts("errors", [first], "Errors of the tests over the weight."),
        Charts("moduli", others, "Moduli over the weight, with 1 sigma where it is as written."),
    ]


def bootstrap_charts(study: bootstrap.Bootstrap, caption: str) -> Charts:
    """Return moduli (MPa) with the ends of samples and of the fit's band."""
    charts = []
    for (title, label), (name, strain) in zip(PANELS, study.strains.items(), strict=True):
        x = 100 * strain
        fit = study.of_fit[name]
        (low, high), best = study.bands[name], fit.value
        series = [
            line("fit, with its band", x, best, (fit.lower, fit.upper)),
            line("percentiles of the samples", x, low, colour=1, dashes=1),
            line("percentiles of the samples", x, high, colour=1, dashes=1),
        ]
        top, cut = axis_top(1.08 * max(float(best.max()), float(high.max())), fit.upper)
        alt = f"{title}: at rest {best[0]:.4g} MPa, samples {low[0]:.4g} to {high[0]:.4g} MPa"
        up = "tangent modulus, MPa"
        title = f"{title}{cut}"
        charts.append(Chart(title, label, up, series, alt, from_zero=True, top=top))
    return Charts("bootstrap", charts, caption)


def held_out_charts(study: Validation, caption: str) -> Charts:
    """Return relative errors by law at each test: predicted, and by the fit to all of them."""
    table = study.table().drop_duplicates(["law", "test"])
    tests = table["test"].unique().tolist()
    laws = table["law"].unique()
    errors: dict[str, np.ndarray] = {}
    for column, words in (("foretold", "predicted"), ("fitted", "fitted")):
        found = 100 * table.pivot(index="test", columns="law", values=f"{column}_relative")
        errors |= {
            f"{law}, {words}": found.loc[tests, law].to_numpy(float)
            for law in laws
            if words == "predicted" or found[law].notna().any()
        }
    alt = f"errors at {', '.join(tests)}"
    chart = _named("left out", "relative RMS error, %", tests, errors, alt)
    return Charts("held out", [chart], caption)


def law_charts(forms: Sequence[FormFit], noise: float | None, label: str, caption: str) -> Charts:
    """Return errors of forms: of the fit, cross-validated, of every fold; noise, a line."""
    names = [_form(form) for form in forms]
    folds = [form.left_out() for form in forms]
    errors = {
        "error of the fit": np.array([form.fitted for form in forms]),
        "cross-validated error": np.array([form.validated for form in forms]),
    }
    alt = "; ".join(
        f"{name}: fit {form.fitted:.4g}, cross-validated {form.validated:.4g}"
        for name, form in zip(names, forms, strict=True)
    )
    place = [1.0 + k + 0.5 * ASIDE + FURTHER for k in range(len(forms))]
    own = [
        dots("single folds", np.full(len(values), at), values, colour=1, hollow=True)
        for at, values in zip(place, folds, strict=True)
        if np.isfinite(values).any()
    ]
    across = "form of the moduli (number of coefficients)"
    chart = _named(across, label, names, errors, alt, noise, own)
    return Charts("laws", [chart], caption)


def _form(form: FormFit) -> str:
    lost = int(np.sum(~np.isfinite(form.left_out())))
    text = f"{form.name} ({form.coefficients})"
    text += f", {lost} fold{'s' if lost > 1 else ''} without a result" if lost else ""
    return text if np.isfinite(form.fitted) else f"{text}, no fit"


def plan_charts(study: plan.Plan, caption: str) -> Charts:
    """Return 1 sigma, %, of each modulus with each test; from 100 % on unknown, a ring."""
    tests = ["the present tests alone"]
    tests += [f"{k}. {one.title}" for k, one in enumerate(study.candidates, start=1)]
    sigmas = [one.summary for one in (study.present, *study.candidates)]
    every = {name: 100 * np.array([own[name] for own in sigmas]) for name in COMPONENTS}
    known = {name: np.where(own < MOST, own, np.nan) for name, own in every.items()}
    rings = [
        dots(
            f"{name}, not known",
            1.0 + np.flatnonzero(~(own < MOST)) + by,
            np.full(int((~(own < MOST)).sum()), MOST),
            colour=rank,
            hollow=True,
        )
        for rank, ((name, own), by) in enumerate(zip(every.items(), _aside(3), strict=True))
        if not (own < MOST).all()
    ]
    words = f"{caption}. From {MOST:g} % on a modulus is not known: a ring."
    alt = f"1 sigma of {', '.join(every)} with {', '.join(tests)}"
    chart = _named("test", "1 σ, % of the modulus", tests, known, alt, more=rings)
    return Charts("plan", [chart], words)


def _aside(count: int) -> np.ndarray:
    return ASIDE * (np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1))


def _named(
    across: str,
    up: str,
    names: Sequence[str],
    values: Mapping[str, np.ndarray],
    alt: str,
    level: float | None = None,
    more: Sequence[Series] = (),
) -> Chart:
    """Return a chart over names instead of numbers."""
    place = np.arange(len(names)) + 1.0
    pairs = zip(values.items(), _aside(len(values)), strict=True)
    series = [dots(k, place + by, own, colour=c) for c, ((k, own), by) in enumerate(pairs)]
    drawn = [np.array(s.y, dtype=float) for s in (*series, *more)]
    log = spans_a_decade(np.concatenate([*drawn, [np.nan if level is None else level]]))
    return Chart(
        "",
        across,
        up,
        [*series, *more],
        alt,
        log_y=log,
        from_zero=not log,
        level=level,
        x_names=tuple(names),
    )


PAGES.register(Presented, write_study)
DRAWINGS.register(Presented, {"figure": lambda study: Drawing(figure(study))})
