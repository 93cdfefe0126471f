"""Write the folder of a finished fit: card, tables, figures, report.html, last result.json."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import date
from math import inf, nan
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from ..experiments.output import Output
from ..experiments.strains import by_strain
from ..inference.linear import PRIOR
from ..inference.reported import (
    BOUND_WORDS,
    LARGEST_SIGMA,
    LEVEL,
    sigma_words,
    sigma_words_of,
)
from ..materials.card import write_card
from ..materials.forms.base import COMPONENTS
from ..materials.law import HypoelasticLaw
from ..notes import NOTES, NOTES_ARE, write_notes
from ..project.project import Project
from ..runs.folder import (
    AS_RUN,
    DIGITS,
    PROVENANCE,
    RESULT,
    FailedRun,
    Provenance,
    Store,
    write_table,
)
from ..runs.result import Answer, Fit, answers
from ..runs.verdict import LEAST_STRAIN, SPACE
from ..storage.templates import render
from ..version import __version__
from .charts import Chart, Charts, dots, moduli_charts, pinned_charts, spans_a_decade
from .content import Download, Facts, Listing, Part, Report, Section, Table, Words
from .html import percent, write_report
from .presenter import page_presenter_of
from .vega import save

Array = NDArray[np.float64]

TITLE = "What the data determine"
NO_WARNING = "No warning: nothing that the program looks at speaks against these numbers."


def _beside(fit: Fit) -> list[Table]:
    """Return a table of every unknown beside the moduli."""
    rows: list[list[object]] = [
        [
            v.name,
            v.unit,
            v.value,
            v.sigma if v.determined else "not determined",
            v.lower,
            v.upper,
            v.prior,
            v.words,
        ]
        for v in fit.verdicts
    ]
    header = ["unknown", "unit", "value", "1 sigma", "least", "largest", "known to", "verdict"]
    note = (
        "Known to: one standard deviation before the tests. Correlation: with a modulus in the "
        "middle of its strains, where it is above one half."
    )
    return [Table("Unknowns beside the moduli", header, rows, note, text=(1, 7))] if rows else []


def _determined(fit: Fit) -> Sequence[Table]:
    """Return the uncertainty of each modulus; nothing where it is not known."""
    sure = fit.best.certainty
    if sure is None:
        return []
    mesh = {name: "not known" for name in sure.sigma}
    if sure.mesh is not None:
        mesh = {n: percent(round(float(np.abs(off).max()), 6)) for n, off in sure.mesh.items()}
    rows: list[list[object]] = []
    for name, modulus in sure.moduli.items():
        median, largest = sigma_words_of(modulus.numbers)
        noise_sigma = sure.noise_sigma[name]
        noise = sigma_words(float(noise_sigma.max()), not modulus.determined.all())
        rows.append([name, median, largest, noise, mesh[name]])
    units = {c.name: c.objective.unit for c in fit.problem.comparisons}
    together = {
        name: f", {count:.2g} neighbouring values err as one" if count > 1.05 else ""
        for name, count in sure.noise.correlated_count.items()
    }
    noise = ", ".join(
        f"{value:.2g} {units[name]} ({name}{together[name]})"
        for name, value in sure.noise.level.items()
    )
    note = (
        f"noise of {noise} on everything matched; 1 sigma: half of the band of 68 in 100 draws, "
        "noise and mesh together, and the part of it that is the noise's; a law or a model of "
        "the wrong form is not in it; "
        "single coefficients are far less certain than the moduli they make. Mesh: "
        "by how much a modulus would be another on ever finer meshes, from one run of a finer "
        "model at the best fit"
    )
    if sure.order is not None:
        note += f". Uncertainty of {sure.order.words}"
    header = ["modulus", "median 1 sigma", "largest 1 sigma", "by noise, largest", "mesh, largest"]
    return [Table(TITLE, header, rows, note)]


def _checked(fit: Fit) -> list[str]:
    """Return what the tests say of the best fit, and the checks of data and of stability."""
    several = "{0}: {1}" if len(fit.findings) > 1 else "{1}"
    said = "; ".join(several.format(name, f.summary) for name, f in fit.findings.items())
    lines = [f"Best of {len(fit.best.ranked)} starts: objective {fit.objective:.3g}; {said}."]
    if fit.judgements:
        doubts = sum(len(judgement.doubts) for judgement in fit.judgements)
        seen = f"{doubts} doubts, listed below" if doubts else "nothing doubtful"
        tests = ", ".join(judgement.test for judgement in fit.judgements)
        lines.append(f"The data were looked at before the fit ({tests}): {seen}.")
    leading = (fit.best.differentiated or fit.best.point).histories
    stable = [
        beside.stable if history.stable is None else history.stable
        for history, beside in zip(fit.best.point.histories, leading, strict=True)
    ]
    if all(stable):
        lines.append("Every equilibrium at a reported load is stable.")
    elif False in stable:
        lines.append("Equilibria at some of the reported loads are unstable: see the warnings.")
    else:
        lines.append("The solver did not look whether every equilibrium is stable.")
    return lines


def warnings_of(fit: Fit) -> Words:
    """Return every note of the fit, the weightiest first, or that there is none."""
    lines = [note.line for note in sorted(fit.notes, key=lambda note: -note.kind.weight)]
    return Words(lines, marked=True, warning=True) if lines else Words([NO_WARNING])


def misfit_table(fit: Fit) -> Table:
    """Return the residual of every comparison beside the noise of its data."""
    rows: list[list[object]] = [
        [name, m.rms, m.noise, m.unit, m.noise_is, m.ratio] for name, m in fit.misfits.items()
    ]
    header = ["compared", "RMS residual", "noise", "unit", "noise is", "residual over noise"]
    note = (
        "Noise: as the project gives it (noise of the test), else the scatter of the specimens, "
        "else usual for the instrument. The uncertainty uses the larger of noise and residual."
    )
    return Table("Residual beside the noise", header, rows, note, text=(3, 4))


def predicted_tables(fit: Fit) -> list[Table]:
    """Return the errors of the law at the tests of weight 0; nothing where there is none."""
    rows: list[list[object]] = [
        [comparison, rms, one.units[comparison]]
        for one in fit.predicted.values()
        for comparison, rms in one.rms.items()
    ]
    note = "Tests of weight 0: not fitted, but run with the law of the fit."
    header = ["predicted", "RMS residual", "unit"]
    return [Table("Predicted, not fitted", header, rows, note, text=(2,))] if rows else []


def assumed(fit: Fit) -> list[tuple[str, object]]:
    """Return the quantities that were taken as known."""
    unknowns = fit.project.fit.unknowns
    project = fit.project
    fitted = {name: getattr(unknowns, name) is not None for name in ("nu12", "thickness")}
    thick = f"{fit.thickness:.4g} mm, {project.fabric.thickness_change}"
    return [
        (f"Poisson's ratio nu12 ({'fitted' if fitted['nu12'] else 'fixed'})", fit.law.nu12),
        ("thickness (fitted)" if fitted["thickness"] else "thickness", thick),
        ("form of the moduli", getattr(fit.law.form, "title", fit.law.form.name)),
    ]


def found_by(fit: Fit) -> list[tuple[str, object]]:
    """Return method, starts and cost."""
    result = fit.result
    project = fit.project
    best = fit.best
    runs = result["external_runs"]
    cached = result["cached_runs"]
    return [
        (f"objective: {fit.setup.objective_is}", fit.objective),
        ("method", f"{project.fit.method} on {project.fit.solver}"),
        ("starts", f"{len(best.ranked)} feasible of {len(best.records)}"),
        *([("agreement", fit.agreement)] if fit.agreement else []),
        *([("coarse to fine", fit.stages)] if fit.stages else []),
        ("analyses", result["analyses"]),
        *([(f"of them by {project.fit.solver}", runs)] if runs or cached else []),
        *([("of them from the cache", cached)] if cached else []),
        ("wall time, s", result["wall_s"]),
    ]


def starts_table(fit: Fit) -> Table:
    """Return every start, best first."""
    records = sorted(fit.best.records, key=lambda r: inf if r.objective is None else r.objective)
    rows: list[list[object]] = [
        [k, r.number, r.objective, r.analyses, r.status] for k, r in enumerate(records, start=1)
    ]
    header = ["rank", "start", "objective", "analyses", "how it ended"]
    return Table("Starts, best first", header, rows, text=(4,), closed=True)


def bounds_table(fit: Fit) -> Table:
    """Return value and bounds of every coefficient of the law."""
    form = fit.law.form
    unknowns = fit.problem.unknowns
    scale = fit.project.scales.modulus
    rows: list[list[object]] = [
        [
            form.labels[i],
            f"{float(fit.law.beta[i] / scale):.6g}",
            float(low / scale),
            float(high / scale),
        ]
        for i, low, high in zip(form.free, *unknowns.box, strict=True)
    ]
    header = [
        "coefficient",
        f"value, {fit.project.scales.modulus_unit}",
        "lower bound",
        "upper bound",
    ]
    return Table("Coefficients of the law", header, rows, closed=True)


#: Names of the moduli in words.
WORDS: Mapping[str, str] = {
    "E1": "Young's modulus along the warp, E1",
    "E2": "Young's modulus along the fill, E2",
    "G12": "Shear modulus between warp and fill, G12",
}


def band_words(answer: Answer, scale: float = 1.0) -> str:
    """Return a modulus, MPa times `scale`, with its band and the marks of bounds."""
    if answer.band is None:
        return f"{scale * answer.value:.3g}"
    values = answer.value, *answer.band
    value, lower, upper = (
        f"{_short(scale * v)}{mark}" for v, mark in zip(values, answer.marks, strict=True)
    )
    return f"{value}{SPACE}({lower}{SPACE}to{SPACE}{upper})"


def _short(value: float) -> str:
    """Return three digits, without powers of ten."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.3g}"


def answer_tables(fit: Fit) -> list[Part]:
    """Return a table a modulus, a row a strain up to its own end, and what they are."""
    tables: list[Part] = []
    for name, words in WORDS.items():
        rows: list[list[object]] = []
        for one in answers(fit.best, fit.thickness):
            if one.modulus == name and not 0.0 < one.strain < LEAST_STRAIN:
                cells = [band_words(one, scale) for scale in (1.0, fit.thickness)]
                rows.append([f"{100 * one.strain:.2g} %{', its end' * one.end}", *cells])
        tables.append(Table(words, ["strain", "MPa", "kN/m"], rows, side=True))
    sure = fit.best.certainty
    band = f"In brackets the {percent(LEVEL)} band, noise and mesh together. "
    if any(any(one.marks) for one in answers(fit.best, fit.thickness)):
        band += f"{BOUND_WORDS}. "
    note = (
        "Tangent moduli at logarithmic strains along their own direction (shear: γ12). "
        f"{'' if sure is None else band}kN/m: MPa times the thickness of "
        f"{fit.thickness:.4g} mm. Beyond the last strain of a table no test reached: the card "
        "keeps the modulus that it has there."
    )
    return [*tables, Words([note])]


def reached_table(fit: Fit) -> Table:
    """Return the ends of the moduli beside the largest strains of the tests."""
    reached, valid = (by_strain(ends) for ends in (fit.best.reached, fit.best.valid))
    rows: list[list[object]] = [
        [name, 100 * valid[name], 100 * strain] for name, strain in reached.items()
    ]
    note = (
        "Logarithmic strain. The material card holds up to the first of the two: beyond it a "
        "modulus keeps the value it has there, even where a test reached further."
    )
    header = ["direction", "moduli fitted up to, %", "largest strain reached, %"]
    return Table("Where they end", header, rows, note)


def about_of(project: Project, record: Provenance | None) -> list[tuple[str, object]]:
    """Return date, fabric and laboratory of results."""
    begun = record.runs[-1].get("date", "") if record is not None and record.runs else ""
    fabric = project.fabric
    return [
        ("date", begun[:10] or str(date.today())),
        ("fabric", f"{project.title}, {fabric.thickness:.4g} mm"),
        *([("laboratory", fabric.lab)] if fabric.lab else []),
    ]


def citation() -> list[Part]:
    """Return words and BibTeX, as in CITATION.cff of the program."""
    said = f"Please cite bubblefit {__version__} and the thesis whose method it follows:"
    return [Words([said]), Listing(render("report/citation.bib.j2", version=__version__).strip())]


CARD, MODULI, RESIDUALS = "material.toml", "moduli.csv", "residuals.csv"
COEFFICIENTS = "coefficients.csv"
MODULI_PICTURE, OPTIMA, PINNED = "moduli.png", "optima.png", "pinned.png"
#: Strains at which curves are drawn.
SMOOTH = 121
SAVE_CARD = "Save the material card (material.toml)"
#: Files of every folder, with their descriptions.
NOTES_FILE = (NOTES, NOTES_ARE)
RESULT_FILE = (RESULT, "all numbers of this page, for programs")
ALWAYS = NOTES_FILE, RESULT_FILE
FILES = (
    RESULT_FILE,
    (CARD, "the material card"),
    (MODULI, "tangent moduli along their strains, with their bands"),
    (COEFFICIENTS, "every unknown with its standard deviation and its correlations"),
    (RESIDUALS, "every matched value beside the model's"),
    NOTES_FILE,
    ("history.csv", "one row an analysis"),
    (MODULI_PICTURE, "picture of the moduli"),
    (OPTIMA, "picture of the optima"),
    (PINNED, "picture of what each test pins down"),
)


def write_fit(fit: Fit, folder: Path) -> Path:
    """Write the folder of a fit; return the page's path. Raises OutputError."""
    store = Store(folder)
    (folder / RESULT).unlink(missing_ok=True)
    fit.record.write(folder)
    write_card(fit.card, folder / CARD, fit.project.scales.modulus_unit)
    tables = {MODULI: fit.moduli(), COEFFICIENTS: fit.coefficients(), RESIDUALS: fit.residuals()}
    for name, table in tables.items():
        write_table(table, folder / name)
    write_notes(folder, fit.notes)
    page = write_report(folder, _page(fit, folder))
    store.finish(fit.result)
    return page


def _page(fit: Fit, folder: Path) -> Report:
    result = fit.result
    exhibits = {
        t.test.name: page_presenter_of(t.test.kind).show(
            t,
            fit.tests[t.test.name],
            fit.findings[t.test.name],
            Output.of(folder, t.test.name, len(fit.setup.tests) > 1),
        )
        for t in fit.setup.tests
    }
    standards = [table for exhibit in exhibits.values() for table in exhibit.standards]
    files = [*FILES, *fit.record.files, *(f for own in exhibits.values() for f in own.files)]
    card = (folder / CARD).read_text(encoding="utf-8")
    known = all(prepared.known is not None for prepared in fit.setup.tests)
    ranges = result.get("moduli_error_range", {})
    rows: list[list[object]] = [
        [name, percent(error), *(100 * end for end in ranges.get(name, (nan, nan)))]
        for name, error in result.get("moduli_error", {}).items()
    ]
    note = (
        "Against the known solution, over the range of logarithmic strain in the table, which is "
        "what the tests reached. Single coefficients are not compared: the highest powers hardly "
        "act at these strains, so quite different coefficients give the same moduli."
    )
    header = ["modulus", "largest error", "from strain, %", "to strain, %"]
    return Report(
        title=fit.project.title,
        summary=fit.verdict.words,
        about=about_of(fit.project, fit.record),
        sections=[
            Section("The answer", [*answer_tables(fit), Download(CARD, card, SAVE_CARD)]),
            Section(
                "Can it be trusted?",
                [
                    warnings_of(fit),
                    Words(_checked(fit)),
                    misfit_table(fit),
                    *predicted_tables(fit),
                    *([Table("Errors of the moduli", header, rows, note)] if rows else []),
                    Facts(assumed(fit)),
                    reached_table(fit),
                ],
            ),
            Section("The moduli over strain", [_saved(moduli(fit), folder / MODULI_PICTURE)]),
            Section(
                f"{'Known' if known else 'Measured'} beside modelled",
                [
                    part
                    for name, exhibit in exhibits.items()
                    for part in exhibit.all_parts(name if len(exhibits) > 1 else "")
                ],
            ),
            Section(
                TITLE,
                [
                    *_determined(fit),
                    *_beside(fit),
                    *_pinned(fit, folder),
                ],
            ),
            Section(
                "How it was found",
                [
                    Facts(found_by(fit)),
                    _saved(optima(fit), folder / OPTIMA),
                    starts_table(fit),
                    bounds_table(fit),
                    *coefficients_table(fit),
                ],
            ),
            *([Section("Reports by standards", standards)] if standards else []),
            Section(
                "The record",
                [
                    *record_tables(fit.record),
                    *(t for e in exhibits.values() for t in e.record),
                ],
            ),
            Section("How to cite", citation()),
        ],
        files=[f for f in files if f[0] == RESULT or (folder / f[0]).exists()],
        versions=result["versions"],
    )


def optima(fit: Fit) -> Charts:
    """Return the chart of the optima of all starts."""
    words = f"Optimum of every start: {fit.setup.objective_is}, from worst to best"
    if fit.coarse_to_fine is not None:
        words += "; starts with the same optimum on the coarse mesh have one on the full mesh"
    objectives = [np.nan if r.objective is None else r.objective for r in fit.best.records]
    return optima_chart(objectives, words)


def moduli(fit: Fit) -> Charts:
    """Return the chart of the moduli over the strains that they are fitted to."""
    strains = _strains(fit)
    known = next((t.known for t in fit.setup.tests if t.known is not None), None)
    curves = np.array([modulus_curves(law, strains) for law in fit.laws])
    band = None
    sure = fit.best.certainty
    if sure is not None:
        along = zip(COMPONENTS, strains, strict=True)
        band = np.array([sure.at(fit.law, name, x).band for name, x in along]).transpose(1, 0, 2)
    truth = None if known is None else modulus_curves(known, strains)
    words = ", where a dot ends them" if known is None and band is not None else ""
    if band is not None:
        words += f"; with their bands ({percent(LEVEL)}, noise and mesh together)"
    caption = f"Tangent moduli of the best fits over the strains reached{words}"
    return moduli_charts(strains, curves, truth, band, caption)


def _saved(charts: Charts, path: Path) -> Charts:
    save(path, charts)
    return charts


def of_kind(fit: Fit, what: str, test: str | None) -> Charts:
    """Return what the kind of a test calls by this name: of the first test that has it, or one."""
    names = [name for name in fit.tests if test in (None, name)]
    for prepared in fit.setup.tests:
        charts = page_presenter_of(prepared.test.kind).charts
        if prepared.test.name in names and what in charts:
            return charts[what](prepared, fit.tests[prepared.test.name])
    problem = f"expected one of {', '.join(fit.tests)}, with {what}; got {test or 'none of them'}"
    raise InputError(fit.project.path, "test", problem)


def residuals(fit: Fit, test: str | None) -> Charts:
    """Return modelled less measured values over the measured ones, a chart a quantity."""
    table = fit.residuals()
    check_one_of(test, fit.tests, "test", fit.project.path)
    table = table[table["test"].isin([test] if test else [*fit.tests])]
    charts = []
    for (quantity, unit), rows in table.groupby(["quantity", "unit"], sort=False):
        series = [
            dots(
                f"{name}: {part}" if part != name else str(name),
                own["measured"],
                own["difference"],
                colour=rank,
            )
            for rank, ((name, part), own) in enumerate(rows.groupby(["test", "part"], sort=False))
        ]
        rms = float(np.sqrt(np.mean(rows["difference"] ** 2)))
        title = f"{quantity}: RMS {rms:.3g} {unit}"
        across = f"measured {quantity}, {unit}"
        charts.append(Chart(title, across, f"modelled − measured, {unit}", series, title, level=0))
    return Charts("residuals", charts, "What the fit leaves of every matched value.")


def _strains(fit: Fit, count: int = SMOOTH) -> Array:
    return np.array([np.linspace(0.0, fit.best.valid[c], count) for c in COMPONENTS.values()])


def modulus_curves(law: HypoelasticLaw, strains: Array) -> Array:
    """Return E1, E2, G12 (3, k) MPa at strains (3, k)."""
    return np.array([law.modulus(n, x) for n, x in zip(COMPONENTS, strains, strict=True)])


def _pinned(fit: Fit, folder: Path) -> list[Part]:
    """Return chart and table of what each test determines; nothing where it is not known."""
    if not (pins := fit.pinned):
        return []
    rows: list[list[object]] = [
        [source, name, *sigma_words_of(modulus.numbers)]
        for source, moduli in pins.items()
        for name, modulus in moduli.items()
    ]
    note = (
        "noise of every test, its misfit or its scatter, whichever is larger, neighbours that err "
        "as one counted as one; within the bounds of the fit; before the "
        f"tests every modulus is taken to be known to {100 * PRIOR:.0f} %; unknown: "
        f"1 sigma of {percent(LARGEST_SIGMA)} or more, or a band from bound to bound"
    )
    header = ["test", "modulus", "median 1 sigma", "largest 1 sigma"]
    sigma = {}
    for source, moduli in pins.items():
        shown = [np.where(m.determined, m.sigma, np.inf) for m in moduli.values()]
        sigma[source] = 100 * np.array(shown)
    count = next(iter(sigma.values())).shape[1]
    caption = "What each test pins down: one standard deviation of the moduli"
    charts = pinned_charts(_strains(fit, count), sigma, caption)
    return [_saved(charts, folder / PINNED), Table("What each test pins down", header, rows, note)]


FAILED = "This failed, and there is no result."


def write_failure(failed: FailedRun, folder: Path) -> Path:
    """Write the page of a fit, or predictions, that failed: in one line, and further lines."""
    page = Report(failed.title, f"{FAILED} {failed.failure}", warnings=failed.lines)
    return write_report(folder, page)


COEFFICIENTS_TITLE = "How sure the coefficients are, and how they hang together"


def coefficients_table(fit: Fit) -> list[Table]:
    """Return the unknowns with their correlations; nothing where these are not known."""
    if fit.best.certainty is None:
        return []
    note = (
        "One standard deviation by noise, bounds left aside; then the correlations. Coefficients "
        "make up for each other: single ones are far less certain than the moduli they make."
    )
    unit = {"unit": "unit"}
    return [correlation_table(COEFFICIENTS_TITLE, fit.coefficients(), unit, note, text=(3,))]


def correlation_table(
    title: str, found: pd.DataFrame, own: Mapping[str, str], note: str, text: Sequence[int] = ()
) -> Table:
    """Return unknowns with their correlations, none of them a negative zero; own : a column of
    theirs with its heading."""
    names = found["unknown"].tolist()
    columns = ["unknown", "value", "sigma", *own]
    cells = pd.DataFrame({name: [f"{r + 0.0:.2f}" for r in found[name].round(2)] for name in names})
    rows = pd.concat([found[columns], cells], axis=1).to_numpy(object).tolist()
    header = ["unknown", "value", "1 sigma", *own.values(), *names]
    return Table(title, header, rows, note, text, closed=True)


RECORD_TITLE = "The record"
NO_COMMAND = "none: called from Python"
NO_FILES = "none: computed, or of a kind that names no files"


def record_tables(record: Provenance) -> list[Table]:
    """Return the record for the page: one row a thing, and one a data file."""
    rows: list[list[object]] = [["project file", os.path.abspath(record.project)]]
    for run in record.runs:
        command = run.get("command_line")
        machine = run.get("machine", {})
        rows += [
            ["command", NO_COMMAND if command is None else " ".join(command)],
            ["begun", run.get("date", "")],
            ["machine", ", ".join(f"{value}" for value in machine.values())],
            ["versions", ", ".join(f"{k} {v}" for k, v in run.get("versions", {}).items())],
        ]
    if facts := record.solver:
        settings = [f"{k} = {v}" for k, v in facts.items() if v and k not in ("name", "version")]
        itself = facts.get("version") or facts.get("name", "")
        rows.append(["solver", "; ".join([itself, *settings])])
    if not record.data:
        rows.append(["data files", NO_FILES])
    note = f"All of it, with the text of the project: {PROVENANCE}."
    if record.settings is not None:
        note += f" The project with the options of the command, to be run again: {AS_RUN}."
    tables = [Table(RECORD_TITLE, ["", ""], rows, note, text=(1,))]
    if not record.data:
        return tables
    header = ["test", "file", "sha256", "format", "columns", "rows used", "rows dropped"]
    files: list[list[object]] = [
        [
            row["test"],
            row["name"],
            row["sha256"][:DIGITS],
            row["format"],
            _columns(row["columns"], row["units"]),
            row["rows_used"],
            ", ".join(f"{n} {why}" for why, n in row["rows_dropped"].items()) or "none",
        ]
        for row in record.data
    ]
    note = f"The first {DIGITS} digits of each sha256; {PROVENANCE} has all, and what was chosen."
    title = f"{RECORD_TITLE}: data files"
    return [*tables, Table(title, header, files, note, text=(1, 2, 3, 4, 6))]


def _columns(columns: Mapping[str, str], units: Mapping[str, str]) -> str:
    of = {quantity: f" in {unit}" for quantity, unit in units.items()}
    return ", ".join(f"{key}: {name}{of.get(key, '')}" for key, name in columns.items())


#: What a perfect fit (zero) is drawn as on a logarithmic axis.
PERFECT = 1e-16


def optima_chart(objectives: ArrayLike, caption: str) -> Charts:
    """Return the optima (starts,), worst to best; starts without one (NaN) are counted."""
    values = np.atleast_1d(np.asarray(objectives, dtype=float))
    ended = np.maximum(np.sort(values[np.isfinite(values)])[::-1], PERFECT)
    failed = len(values) - len(ended)
    said = f"{len(values)} start{'s' if len(values) > 1 else ''}"
    said += f", {failed} without a result" if failed else ""
    if len(ended):
        said += f": best {ended[-1]:.3g}, median {np.median(ended):.3g}, worst {ended[0]:.3g}"
    series = [dots("", 1 + np.arange(len(ended)), ended)]
    log = spans_a_decade(ended)
    axes = "start, from worst to best", "objective"
    chart = Chart("", *axes, series, said, log_y=log, from_zero=not log)
    return Charts("optima", [chart], f"{caption}. {said[:1].upper()}{said[1:]}.")
