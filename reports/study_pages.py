"""Output folders of studies: tables, charts, notes.csv, report.html and, last, result.json.

For the result of each type of study one function (`CONTENT`) returns the content of its folder,
which `write_study` writes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..experiments.base import PreparedTest
from ..experiments.data_files import Output
from ..experiments.forward import CardRun
from ..experiments.registry import presenter_of
from ..inference.likelihood import THRESHOLD
from ..inference.reported import LEVEL, sigma_words
from ..lazy_modules import pandas as pd
from ..notes import joined_lines, write_notes
from ..presenting import DRAWINGS, PAGES
from ..runs import bootstrap, plan, profile
from ..runs.compare import FormFit, LawComparison
from ..runs.folder import RESULT, Presented, Store, write_table
from ..runs.refinement import Level, Nu12Study, Refinement, ended, largest_load, rms_changes
from ..runs.simulation import attempt
from ..runs.validation import Validation
from ..runs.weight_study import STRAIN_SHARES, WeightStudy
from .charts import (
    MODULUS,
    NOT_DETERMINED,
    PANELS,
    TITLES,
    Chart,
    Charts,
    Series,
    axis_top,
    charts_of_labelled_moduli,
    dots,
    line,
    spans_a_decade,
)
from .content import PageSection, Report, Table, Words, notes_section
from .converter import background
from .fit_page import correlation_table
from .html import write_report
from .provenance import FILES_OF_ALL, about_of, citation
from .vega import Drawing, save

Array = NDArray[np.float64]

BANDS = (
    f"Moduli of the fit, percentiles of the samples ({100 * LEVEL:.0f} %) and the fit's own "
    "band by the noise alone"
)
LIKELIHOODS = (
    "Rise of the misfit (-2 log L) with each modulus held at a value, everything else fitted anew "
    "(dots), and by the 1 sigma of the fit, its bounds left aside (dashed); the horizontal line "
    f"is the threshold of {100 * LEVEL:.0f} %"
)
UNCERTAINTIES = "1 sigma of the moduli with one more test, root mean square along each"
ERRORS = "Error of the fit, and at specimens left out of it; the line is the data's own noise"
HELD_OUT = "Errors at data left out of the fit (predicted), and given to it (fitted)"
COMPARED = "Fitted: to all points; left out: at what the fits of the folds were not given."
#: Content of a folder: page, tables and figures by file name, and digits of numbers in the tables.
Content: TypeAlias = "tuple[Report, Mapping[str, pd.DataFrame], Mapping[str, Charts], int | None]"


@background.during_page()
def write_study(study: Any, folder: Path) -> Path:
    """Write all files of a study of any type into its output folder, result.json last.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    if isinstance(study, LawComparison):  # what each test draws is written there
        page, tables, figures, digits = _comparison(study, folder)
    else:
        page, tables, figures, digits = CONTENT.get(type(study), _table_alone)(study)
    (folder / RESULT).unlink(missing_ok=True)  # a folder that is half written has no result
    for name, table in tables.items():
        write_table(table, folder / name, digits)
    for name, charts in figures.items():
        save(folder / name, charts)
    write_notes(folder, study.notes)
    files = [*page.files, *FILES_OF_ALL]
    about = about_of(study.project, None)
    written = write_report(folder, replace(page, about=about, files=files))
    Store(folder).finish(study.result)
    return written


def figure(study: Any) -> Charts:
    """Return the first figure of a study, for a notebook; raise InputError if it has none."""
    page, _, figures, _ = CONTENT.get(type(study), _table_alone)(study)
    on_page = (part for section in page.sections for part in section.parts)
    charts = [*figures.values(), *(part for part in on_page if isinstance(part, Charts))]
    if not charts:
        problem = f"a study of type {type(study).__name__} has no charts; table() has its numbers"
        raise InputError(None, "plot", problem)
    return charts[0]


def designed(
    study: Any,
    title: str,
    name: str,
    charts: Sequence[Charts],
    tables: Sequence[Table],
    *,
    figure: Charts | None = None,
    digits: int | None = None,
    method: Sequence[str] = (),
    files: Sequence[tuple[str, str, pd.DataFrame | None]] = (),
    picture: str = "",
) -> Content:
    """Return the content of a folder that has the usual page of a study.

    The page shows the verdict, the charts, tables of what the study comes to, the notes and the
    method.

    Parameters
    ----------
    study : object
        Result of the study, with its `verdict`, `notes`, `table` and the numbers `result`.
    title : str
        Title of the page.
    name : str
        Name, without suffix, of the files of the table (.csv) and the figure (.png).
    charts : sequence of Charts
        Figures on the page.
    tables : sequence of Table
        What the study comes to, below the charts.
    figure : Charts or None
        Figure that is also written as a picture.
    digits : int or None
        Number of significant digits in the tables; None for all.
    method : sequence of str
        Paragraphs on the method, below the notes.
    files : sequence of (str, str, DataFrame or None)
        Further files of the folder: name, description, and the table to write there; None where
        the file is written already.
    picture : str
        Name of the figure's file where it is not NAME.png.
    """
    file = f"{name}.csv"
    picture = picture or f"{name}.png"
    listed = [(file, "the table")]
    if figure is not None:
        listed.append((picture, "picture of the charts"))
    listed += [(extra, words) for extra, words, _ in files]
    page = Report(
        title=title,
        verdicts=[("", study.verdict)],
        facts=_facts(study.result),
        sections=[
            PageSection("The result", [*charts, *tables]),
            notes_section(joined_lines(study.notes)),
            PageSection("How it was found", [Words(method)] if method else []),
            PageSection("How to cite", citation()),
        ],
        files=listed,
    )
    contents = {file: study.table()}
    contents |= {extra: content for extra, _, content in files if content is not None}
    return page, contents, {} if figure is None else {picture: figure}, digits


def _facts(result: Mapping[str, Any]) -> list[tuple[str, object]]:
    """Return labels and values on card, tests, solver and analyses, for the head of the page."""
    facts = []
    for key in ("card", "tests", "solver", "analyses"):
        value = result.get(key)
        if value:
            facts.append((key, ", ".join(value) if isinstance(value, list) else value))
    return facts


# Content of the folder of each type of study, which `CONTENT` lists below.


def _refinement(study: Refinement) -> Content:
    """Return the page of a study of meshes or increments: charts, orders, limits and errors."""
    title = f"{study.project.path.name}: finer and finer {study.refined}"
    charts = convergence_charts(study, title)
    rows = []
    for name, model in study.models.items():
        for quantity, numbers in model["quantities"].items():
            error = numbers["own_error"]
            percents = None if error is None else 100.0 * error
            limit = numbers["limit"]
            convergence = [numbers["finest"], numbers["order"], limit]
            rows.append([name, quantity, *convergence, percents, numbers["remark"]])
    header = ["test", "quantity", "finest", "order", "limit", "error of the project's own, %", ""]
    note = (
        "Limit: the value on infinitely fine meshes by the observed order; the error is against "
        "it, or against the finest level where there is none."
    )
    orders = Table("Orders, limits and errors", header, rows, note, text=(1, 6))
    return designed(study, title, "convergence", [charts], [orders], figure=charts)


def _nu12(study: Nu12Study) -> Content:
    """Return the page of a study of nu12: charts and the changes of the response."""
    title = f"{study.project.path.name}: what nu12 changes"
    charts = nu12_charts(study, title)
    rows = [
        [name, response, *(100.0 * end for end in of_response.spread)]
        for name, part in study.parts.items()
        for response, of_response in part.responses.items()
    ]
    header = ["test", study.response, "least change, %", "largest change, %"]
    note = f"Relative to the response at nu12 = {study.base:g}."
    spreads = Table("Changes", header, rows, note, text=(1,))
    return designed(study, title, "nu12", [charts], [spreads], figure=charts)


def _validation(study: Validation) -> Content:
    """Return the page of a validation: errors at data that were left out of the fit."""
    title = f"{study.project.title}: errors at data left out of the fit"
    rows = [
        [
            row["law"],
            row["compared"],
            row["foretold_rms"],
            row["fitted_rms"],
            row["unit"],
            100.0 * row["foretold_relative"],
            100.0 * row["fitted_relative"],
            row["foretold_words"],
        ]
        for judged in study.judged
        for row in judged.rows()
    ]
    header = ["law", "compared", "RMS error predicted", "fitted", "unit"]
    header += ["relative error predicted, %", "fitted, %", ""]
    errors = Table("Errors", header, rows, text=(1, 4, 7))
    charts = held_out_charts(study, HELD_OUT)
    return designed(study, title, "validation", [charts], [errors], digits=9, figure=charts)


def _weights(study: WeightStudy) -> Content:
    """Return the page of a study of weights: charts and the changes of the moduli."""
    parts = weights_charts(study)
    figure = Charts("weights", [chart for part in parts for chart in part.charts], "", columns=2)
    title = f"{study.project.title}: the weight of {study.counted}"
    rows = []
    for name, label in study.labels.items():
        sigma = study.sigma(name)
        largest = None if sigma is None else 100.0 * max(sigma)
        rows.append([label, *(100.0 * end for end in study.change(name)), largest])
    header = ["modulus", "least change, %", "largest change, %", "largest 1 sigma, %"]
    note = "Over all weights and strains compared, against the project's own weight."
    changes = Table("Changes of the moduli", header, rows, note)
    return designed(study, title, "weights", parts, [changes], figure=figure, digits=9)


def _bootstrap(study: bootstrap.Bootstrap) -> Content:
    """Return the page of a bootstrap: bands, scatter of moduli, correlations of unknowns."""
    charts = bootstrap_charts(study, BANDS)
    coefficients = study.coefficients()
    unknowns = correlation_table(
        "Unknowns over the samples",
        coefficients,
        {"sigma_of_fit": "of the fit"},
        "Coefficients in MPa; then the correlations over the samples.",
    )
    rows = [[name, *map(sigma_words, sigmas)] for name, sigmas in study.sigma.items()]
    header = ["modulus", "1 sigma of the samples", "1 sigma of the fit"]
    note = "Root mean square along the strain; of the fit: by the noise alone."
    scatter = Table("Scatter of the moduli", header, rows, note)
    words = "the unknowns, with their correlations over the samples"
    samples = "every sample: what was drawn, and the optimiser's unknowns"
    return designed(
        study,
        f"{study.project.title}: bootstrap over {study.over}",
        "bootstrap",
        [charts],
        [scatter, unknowns],
        figure=charts,
        digits=9,
        method=[bootstrap.METHOD],
        files=[("coefficients.csv", words, coefficients), (bootstrap.SAMPLES, samples, None)],
    )


def _profiles(study: profile.Profiles) -> Content:
    """Return the page of a profile likelihood: its charts and intervals."""
    moduli = [profile_chart(of_modulus, THRESHOLD) for of_modulus in study.profiles]
    charts = Charts("profiles", moduli, LIKELIHOODS)
    rows = []
    for item in study.profiles:
        strain = item.target.strain
        name = [
            item.target.label or item.target.name,
            None if strain is None else 100.0 * strain,
            item.target.unit,
        ]
        rows.append([*name, item.best, *item.ends, *item.band, item.open_words or None])
    header = ["modulus or parameter", "strain, %", "unit", "best", "from", "to"]
    header += ["band of the fit from", "to", "not closed"]
    intervals = Table("Intervals", header, rows, f"Of {100 * LEVEL:.0f} %.", text=(2, 8))
    title = f"{study.project.title}: profile likelihood"
    return designed(
        study,
        title,
        "profile",
        [charts],
        [intervals],
        figure=charts,
        digits=9,
        method=[profile.METHOD],
    )


def _plan(study: plan.Plan) -> Content:
    """Return the page of a plan: which further test would determine the moduli best."""
    charts = plan_charts(study, UNCERTAINTIES)
    prospects = (study.present, *study.candidates)
    rows = [
        [f"{rank}. {p.title}" if rank else "the present tests alone", *p.words.values(), p.noise]
        for rank, p in enumerate(prospects)
    ]
    if study.following is not None:
        title = f"after the first: {study.following.title}"
        rows.append([title, *study.following.words.values(), study.following.noise])
    ends = zip(("warp", "fill", "shear"), study.ends, strict=True)
    strains = ", ".join(f"{name} {100 * end:.3g} %" for name, end in ends)
    note = f"1 sigma of the moduli up to strains of {strains}; ranked by {study.criterion}."
    header = ["test", *study.present.moduli, "noise"]
    ranking = Table("The tests, best first", header, rows, note, text=(len(header) - 1,))
    title = f"{study.project.title}: which test next?"
    return designed(
        study,
        title,
        "plan",
        [charts],
        [ranking],
        figure=charts,
        digits=6,
        method=[plan.ASSUMED],
    )


def _comparison(study: LawComparison, folder: Path | None = None) -> Content:
    """Return the content of a comparison of forms of the moduli.

    With a folder, the responses of each test with the fits of all forms are drawn into it.
    """
    noise = sum(study.forms[0].noise.values())
    error = study.result["objective_is"]
    charts = law_charts(study.forms, noise, error, ERRORS)
    responses = []
    if folder is not None:
        for test in study.forms[0].fit.setup.tests:
            responses += _responses(study, test, folder)
    rows = [[form.name, form.coefficients, form.fitted, form.validated] for form in study.forms]
    header = ["form of the moduli", "coefficients", "error of the fit", "at what was left out"]
    return designed(
        study,
        f"{study.project.title}: forms of the moduli",
        "comparison",
        [charts, *responses],
        [Table("Errors", header, rows)],
        figure=charts,
        digits=9,
        method=[COMPARED, f"Error: {error}. The data's own noise makes {noise:.4g}."],
        picture="laws.png",
    )


def _table_alone(study: Any) -> Content:
    """Return the page of a study without a function of its own: its table and no chart."""
    command = str(study.numbers["command"])
    table = study.table()
    text = [k for k, dtype in enumerate(table.dtypes) if dtype.kind not in "iuf"]
    values = Table("Values", [*table], table.to_numpy(object).tolist(), text=text)
    title = f"{study.project.title}: {command}"
    return designed(study, title, command.rpartition(" ")[2], [], [values])


#: Functions that return the content of a study's folder, by the type of its result; a study that
#: is not listed has a page with its table.
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


def _responses(study: LawComparison, prepared: PreparedTest, folder: Path) -> list[Charts]:
    """Return charts of a test's responses with the fitted laws of all forms, newly run."""
    test = prepared.test
    runs = {}
    for form in study.forms:
        for part, model in test.models().items():
            solver = form.fit.setup.make_solver()
            runs[form.name, part] = CardRun(model, attempt(solver.run, model, form.fit.law))
    out = Output.of(folder, test.name, len(study.forms[0].fit.setup.tests) > 1)
    cards = {form.name: form.fit.card for form in study.forms}
    simulation = presenter_of(test.kind).simulate(test, cards, runs, out)
    return [
        replace(part, caption=f"{test.name}: {part.caption}")
        for part in simulation.parts
        if isinstance(part, Charts)
    ]


# Charts of the studies

#: Change, %, below which it comes from the solver's tolerance and is not drawn.
SMALLEST_CHANGE = 1e-5
SIZES = {"elements": "mean edge, mm", "increments": "step, share of the load"}


def convergence_charts(study: Refinement, caption: str) -> Charts:
    """Return charts of the convergence of each model under refinement, and of its cost.

    Grey lines show convergence of the first and the second order.
    """
    levels = {TITLES.get(name, name): ended(runs) for name, runs in study.runs.items()}
    changes = [_changes(title, runs, SIZES[study.refined]) for title, runs in levels.items()]
    charts = [chart for chart in changes if any(any(series.y) for series in chart.series)]
    flat = [chart.title for chart in changes if chart not in charts]
    cost = [
        line(
            title,
            [run.elements * run.part.increments for run in runs],
            [run.seconds for run in runs],
            colour=rank,
            marks=True,
        )
        for rank, (title, runs) in enumerate(levels.items())
    ]
    across = "elements × increments"
    alt = "wall clock over elements times increments"
    charts.append(Chart("cost", across, "seconds", cost, alt, log_y=True, log_x=True))
    words = f"{caption}. Grey: what falls with the first and the second power of the size"
    limits = [f"{title}: every change is below {SMALLEST_CHANGE:g} %" for title in flat]
    limits.append(f"changes below {SMALLEST_CHANGE:g} % are not drawn")
    return Charts("convergence", charts, f"{'; '.join([words, *limits])}.")


def _changes(title: str, levels: Sequence[Level], size: str) -> Chart:
    """Return a chart of one model's changes from each level to the next finer one, over its size.

    Only levels that ended well are compared.
    """
    sizes = np.array([run.size for run in levels[:-1]])
    changes = _relative_changes(levels)
    for name, change in changes.items():
        changes[name] = np.where(change > SMALLEST_CHANGE, change, np.nan)
    # A quantity that is taken at several pressures or places gets rising colours.
    in_order = [name for name in changes if re.match(r"apex at |load at \d", name)]
    ranks = np.linspace(0.0, 1.0, max(2, len(in_order))).tolist()
    rank_of = dict(zip(in_order, ranks, strict=False))
    series = [
        line(name, sizes, change, colour=number, rank=rank_of.get(name), marks=True)
        for number, (name, change) in enumerate(changes.items())
    ]
    finite = np.concatenate([c[np.isfinite(c)] for c in changes.values()] or [np.zeros(0)])
    extent = "none"
    if len(finite):
        extent = f"largest {finite.max():.3g} %, least {finite.min():.3g} %"
        for order in (1, 2):
            slope = 1.6 * finite.max() * (sizes / sizes.max()) ** order
            series.append(line(f"order {order}", sizes, slope, colour=7, dashes=order, faint=True))
    label = "change to the next finer level, %"
    alt = f"{title}: {label}: {extent}"
    return Chart(title, size, label, series, alt, log_y=True, log_x=True)


def _relative_changes(levels: Sequence[Level]) -> dict[str, Array]:
    """Return the change of each quantity to the next finer level, % of its value at the finest."""
    values = [run.values or {} for run in levels]
    changes = {}
    for quantity, finest in (values[-1] if values else {}).items():
        differences = np.diff([of_level.get(quantity, np.nan) for of_level in values])
        changes[quantity] = 100 * np.abs(differences / finest)
    rms = rms_changes(levels)
    if rms:
        changes["RMS along the load curve"] = 100 * np.array(rms) / largest_load(levels)
    return changes


def nu12_charts(study: Nu12Study, caption: str) -> Charts:
    """Return charts of each model's responses over nu12, relative to those at the card's nu12."""
    charts = []
    label = f"{study.response} / that at nu12 = {study.base:g}"
    for name, part in study.parts.items():
        count = len(part.responses)
        # Few lines have colours of their own; of more, colours rise from first to last.
        has_ranks = count > 6
        series = []
        for k, (response, ratios) in enumerate(part.responses.items()):
            rank = k / (count - 1) if has_ranks else None
            series.append(
                line(response, ratios.nu12, ratios.to_base, colour=k, rank=rank, marks=True)
            )
        series.append(dots("", [study.base], [1.0], colour=3, shape="diamond"))
        title = TITLES.get(name, name)
        of_all = [ratios.to_base for ratios in part.responses.values()]
        finite = np.concatenate([y[np.isfinite(y)] for y in of_all] or [np.ones(1)])
        extent = f"{finite.min():.4g} to {finite.max():.4g}" if len(finite) else "none known"
        alt = f"{title}: {label}: {extent}"
        charts.append(Chart(title, "nu12", label, series, alt, level=1.0))
    return Charts("nu12", charts, caption)


def profile_chart(of_modulus: profile.Profile, threshold: float) -> Chart:
    """Return a chart of the profile likelihood of a modulus, with the ends of its interval.

    Parameters
    ----------
    of_modulus : Profile
        Profile of one modulus at one strain.
    threshold : float
        Value of -2 log L, above its least value, at the ends of the interval.
    """
    values, ratios = of_modulus.curve
    top = 1.6 * threshold
    x = np.linspace(min(values), max(values), 81)
    parabola = ((x - of_modulus.best) / of_modulus.sigma) ** 2
    series = [
        line("profile", values, ratios, marks=True),
        line(
            "by the 1 sigma of the fit",
            x,
            np.where(parabola <= top, parabola, np.nan),
            colour=1,
            dashes=1,
        ),
    ]
    for end in of_modulus.ends:
        if end is not None:
            series.append(line("ends", [end, end], [0.0, threshold], dashes=2))
    target = of_modulus.target
    low, high = ("not closed" if end is None else target.number(end) for end in of_modulus.ends)
    best = target.number(of_modulus.best)
    alt = f"{of_modulus.name}: best {best}, lower end {low}, upper end {high}"
    quantity = "value" if target.strain is None else "tangent modulus"
    return Chart(
        of_modulus.name,
        f"{quantity}, {target.unit}".rstrip(", "),
        "rise of the misfit (−2 log L)",
        series,
        alt,
        from_zero=True,
        top=top,
        level=threshold,
    )


def weights_charts(study: WeightStudy) -> list[Charts]:
    """Return charts of the tests' errors, and of the moduli, over the weight of a kind of test."""
    across = f"weight of {study.counted}, times that of the project"
    runs = study.ended
    weights = [run.count for run in runs]
    errors = [
        line(name, weights, [100 * run.relative[name] for run in runs], colour=rank, marks=True)
        for rank, name in enumerate(runs[0].relative)
    ]
    label = "relative RMS error, %"
    alt = f"{label} of {', '.join(runs[0].relative)} over the weight of {study.counted}"
    of_tests = Chart("Errors of the tests", across, label, errors, alt, from_zero=True, log_x=True)
    of_moduli = []
    for name, modulus in study.labels.items():
        series = _modulus_over_weight(study, name, weights)
        alt = f"{modulus} at {len(STRAIN_SHARES)} strains over the weight of {study.counted}"
        of_moduli.append(Chart(modulus, across, "MPa", series, alt, from_zero=True, log_x=True))
    return [
        Charts("errors", [of_tests], "Errors of the tests over the weight."),
        Charts("moduli", of_moduli, "Moduli over the weight, with 1 sigma where it is as written."),
    ]


def _modulus_over_weight(study: WeightStudy, name: str, weights: Sequence[float]) -> list[Series]:
    """Return a modulus at a few strains over the weight, with 1 sigma at the project's weight."""
    project_weight = 1.0  # the weight that the project file gives, over itself
    series = []
    sigmas = study.sigma(name) or [0.0] * len(STRAIN_SHARES)
    for rank, (place, sigma) in enumerate(zip(STRAIN_SHARES, sigmas, strict=True)):
        moduli = [run.moduli[name][rank] for run in study.ended]
        strain = study.strain(name, place)
        label = f"at {100 * strain:.3g} %"
        series.append(line(label, weights, moduli, dashes=rank, marks=True))
        if sigma:
            modulus = np.interp(project_weight, weights, moduli)
            ends = [modulus * (1 - sigma)], [modulus * (1 + sigma)]
            series.append(dots("1 sigma", [project_weight], [modulus], ends, colour=7))
    return series


def bootstrap_charts(study: bootstrap.Bootstrap, caption: str) -> Charts:
    """Return charts of the moduli with the percentiles of the samples and the band of the fit."""
    charts = []
    for (title, label), (name, strain) in zip(PANELS, study.strains.items(), strict=True):
        x = 100 * strain
        fit = study.of_fit[name]
        low, high = study.bands[name]
        best = fit.value
        series = [
            line("fit, with its band", x, best, (fit.lower, fit.upper)),
            line("percentiles of the samples", x, low, colour=1, dashes=1),
            line("percentiles of the samples", x, high, colour=1, dashes=1),
        ]
        top, cut = axis_top(1.08 * max(best.max(), high.max()), fit.upper)
        alt = f"{title}: at rest {best[0]:.4g} MPa, samples {low[0]:.4g} to {high[0]:.4g} MPa"
        title = f"{title}{cut}"
        charts.append(Chart(title, label, MODULUS, series, alt, from_zero=True, top=top))
    form = study.optimum.best.law.form
    return charts_of_labelled_moduli(Charts("bootstrap", charts, caption), form)


def held_out_charts(study: Validation, caption: str) -> Charts:
    """Return a chart of the relative errors of each law at each test.

    They are errors at a test left out of the fit (predicted), and at a test of the fit (fitted).
    """
    table = study.table().drop_duplicates(["law", "test"])
    tests = table["test"].unique().tolist()
    laws = table["law"].unique()
    errors: dict[str, Array] = {}
    for column, words in (("foretold", "predicted"), ("fitted", "fitted")):
        percents = 100 * table.pivot(index="test", columns="law", values=f"{column}_relative")
        for law in laws:
            if words == "predicted" or percents[law].notna().any():
                errors[f"{law}, {words}"] = percents.loc[tests, law].to_numpy(float)
    alt = f"errors at {', '.join(tests)}"
    chart = _by_rows("relative RMS error of what is left out, %", "test", tests, errors, alt)
    return Charts("held out", [chart], caption)


def law_charts(forms: Sequence[FormFit], noise: float | None, label: str, caption: str) -> Charts:
    """Return a chart of the errors of each form: of the fit, cross-validated, of single folds.

    Parameters
    ----------
    forms : sequence of FormFit
        Results of each form of the moduli.
    noise : float or None
        Error that the noise of the data alone makes, drawn as a line.
    label : str
        Label of the axis of errors.
    caption : str
        Caption of the figure.
    """
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
    # The single folds stand below the dots of their form.
    extra = [
        dots("single folds", values, np.full(len(values), k + 1.25), colour=1, hollow=True)
        for k, values in enumerate(folds)
        if np.isfinite(values).any()
    ]
    if noise is not None:
        ends = [0.5, len(forms) + 0.5]
        extra.append(line("noise of the data", [noise, noise], ends, colour=7, dashes=1))
    return Charts(
        "laws", [_by_rows(label, "form of the moduli", names, errors, alt, extra)], caption
    )


def _form(form: FormFit) -> str:
    """Return a form's name with its number of coefficients, and the number of failed folds."""
    failed = np.sum(~np.isfinite(form.left_out()))
    text = f"{form.name} ({form.coefficients})"
    if failed:
        text += f", {failed} fold{'s' if failed > 1 else ''} without a result"
    return text if np.isfinite(form.fitted) else f"{text}, no fit"


def plan_charts(study: plan.Plan, caption: str) -> Charts:
    """Return a chart of the predicted uncertainty of each modulus with each further test.

    It is one standard deviation in % of the modulus; a ring marks moduli that stay unknown.
    """
    tests = ["the present tests alone"]
    tests += [f"{k}. {test.title}" for k, test in enumerate(study.candidates, start=1)]
    sigmas = [prospect.summary for prospect in (study.present, *study.candidates)]
    percents = {name: 100 * np.array([s[name] for s in sigmas]) for name in study.present.moduli}
    drawn_sigmas = {}
    rings = []
    for rank, (name, sigma) in enumerate(percents.items()):
        is_known = sigma < NOT_DETERMINED
        drawn_sigmas[name] = np.where(is_known, sigma, np.nan)
        if not is_known.all():
            y = 1.0 + np.flatnonzero(~is_known)
            x = np.full(len(y), NOT_DETERMINED)
            rings.append(dots(f"{name}, not known", x, y, colour=rank, hollow=True))
    words = f"{caption}. From {NOT_DETERMINED:g} % on a modulus is not known: a ring."
    alt = f"1 sigma of {', '.join(percents)} with {', '.join(tests)}"
    chart = _by_rows("1 σ, % of the modulus", "test", tests, drawn_sigmas, alt, rings)
    return Charts("plan", [chart], words)


def _by_rows(
    x_label: str,
    y_label: str,
    names: Sequence[str],
    values: Mapping[str, Array],
    alt: str,
    extra: Sequence[Series] = (),
) -> Chart:
    """Return a chart of dots in rows with names, from the top down.

    Parameters
    ----------
    x_label, y_label : str
        Labels of the axes: what the values are, and what the names are of.
    names : sequence of str
        Names of the rows.
    values : mapping of str to (names,) array
        Values of each row, by the name of the series.
    alt : str
        Description of the chart for those who cannot see it.
    extra : sequence of Series
        Further series to draw; the first row is at y = 1, the second at 2.
    """
    rows = np.arange(len(names)) + 1.0
    series = [
        dots(label, of_rows, rows, colour=rank)
        for rank, (label, of_rows) in enumerate(values.items())
    ]
    series += extra
    log = spans_a_decade(np.concatenate([np.array(s.x, dtype=float) for s in series]))
    return Chart("", x_label, y_label, series, alt, log_x=log, y_names=tuple(names))


PAGES.register(Presented, write_study)
DRAWINGS.register(Presented, {"figure": lambda study: Drawing(figure(study))})
