"""Output folder of a finished fit: material card, tables, figures and page, written in order.

result.json is removed first and written last, so that a folder that has it is complete.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from ..experiments.data_files import Output
from ..experiments.forward import by_strain
from ..inference.assessment import Certainty
from ..inference.linear import PRIOR
from ..inference.reported import (
    BOUND_WORDS,
    LARGEST_SIGMA,
    LEVEL,
    UNKNOWN,
    sigma_words,
    sigma_words_of,
)
from ..lazy_modules import pandas as pd
from ..materials.card import write_card
from ..materials.forms.base import COMPONENTS
from ..materials.forms.symmetry import modulus_labels
from ..materials.law import HypoelasticLaw
from ..notes import write_notes
from ..project.schema import FITTED_CARD, PARAMETERS
from ..runs.fit_folder import HISTORY
from ..runs.folder import (
    RESULT,
    FailedRun,
    Store,
    write_table,
)
from ..runs.result import Fit
from ..runs.verdict import LEAST_STRAIN, SPACE, Answer, answers
from ..storage.writing import write_text
from ..wording import percent
from .charts import (
    Chart,
    Charts,
    Series,
    charts_of_labelled_moduli,
    dots,
    line,
    moduli_charts,
    pinned_charts,
    spans_a_decade,
)
from .content import Download, Exhibit, Facts, PageSection, Part, Report, Table, Words
from .converter import background
from .html import write_report
from .presenter import page_presenter_of
from .provenance import NOTES_FILE, RESULT_FILE, about_of, citation, record_tables
from .vega import save

Array = NDArray[np.float64]

TITLE = "What the data determine"
#: Objective as which that of a perfect fit is drawn on a logarithmic axis.
SMALLEST_OBJECTIVE = 1e-16
NO_WARNING = "No warning: nothing that the program looks at speaks against these numbers."


def _unknowns_table(fit: Fit) -> list[Table]:
    """Return a table of the unknowns other than coefficients of the law; no table without any."""
    rows = [
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
    """Return a table of the uncertainty of each modulus; no table where it is not known."""
    certainty = fit.best.certainty
    if certainty is None or not fit.has_law:
        return []
    mesh = {name: "not known" for name in certainty.sigma}
    if certainty.mesh is not None:
        for name, change in certainty.mesh.items():
            mesh[name] = percent(round(np.abs(change).max(), 6))
    rows = []
    for name, label in modulus_labels(fit.law.form).items():
        modulus = certainty.moduli[name]
        median, largest = sigma_words_of(modulus.numbers)
        noise_sigma = certainty.noise_sigma[name]
        noise = sigma_words(noise_sigma.max(), not modulus.determined.all())
        rows.append([label, median, largest, noise, mesh[name]])
    note = (
        f"noise of {_noise_words(fit, certainty)} on everything matched; "
        "1 sigma: half of the band of 68 in 100 draws, noise and mesh together, and the part of it "
        "that is the noise's; a law or a model of the wrong form is not in it; "
        "single coefficients are far less certain than the moduli they make. Mesh: "
        "by how much a modulus would be another on ever finer meshes, from one run of a finer "
        "model at the best fit"
    )
    if certainty.order is not None:
        note += f". Uncertainty of {certainty.order.words}"
    header = ["modulus", "median 1 sigma", "largest 1 sigma", "by noise, largest", "mesh, largest"]
    return [Table(TITLE, header, rows, note)]


def sensitivity_parts(fit: Fit) -> list[Part]:
    """Return a chart and a table of how well each measured quantity alone determines each modulus.

    Nothing where the uncertainty is not known.
    """
    certainty = fit.best.certainty
    if certainty is None or not fit.sensitivity:
        return []
    strains = certainty.strain
    labels = modulus_labels(fit.law.form)
    rows = [
        [quantity, *(_sharpest(strains[name], moduli[name]) for name in labels)]
        for quantity, moduli in fit.sensitivity.items()
    ]
    note = (
        "The smallest 1 sigma that the quantity alone leaves of the modulus, and the strain of the "
        "yarns at which it does: there the quantity reacts most to the modulus, for its noise. It "
        "is the reported 1 sigma, times the factor by which the quantity alone is less certain "
        f"than all together; unknown: {percent(LARGEST_SIGMA)} or more at every strain"
    )
    percents = {
        quantity: 100 * np.array([*moduli.values()]) for quantity, moduli in fit.sensitivity.items()
    }
    caption = "Where each quantity alone decides each modulus"
    charts = pinned_charts([*strains.values()], percents, caption)
    header = ["quantity", *labels.values()]
    return [
        replace(charts_of_labelled_moduli(charts, fit.law.form), name="sensitivity"),
        Table(
            "Which quantity decides which modulus", header, rows, note, text=range(1, len(header))
        ),
    ]


def _sharpest(strain: Array, sigma: Array) -> str:
    """Return the smallest sigma in words, with the strain where it is smallest."""
    k = sigma.argmin()
    words = sigma_words(sigma[k], False)
    if words == UNKNOWN or np.ptp(sigma) < 0.01 * sigma[k]:
        return words
    return f"{words} at {100 * strain[k]:.2g} % strain"


def _noise_words(fit: Fit, certainty: Certainty) -> str:
    """Return the noise of every comparison in words, with its number of correlated values."""
    units = {c.name: c.objective.unit for c in fit.problem.comparisons}
    words = []
    for name, value in certainty.noise.level.items():
        count = certainty.noise.correlated_count[name]
        correlation = f", {count:.2g} neighbouring values err as one" if count > 1.05 else ""
        words.append(f"{value:.2g} {units[name]} ({name}{correlation})")
    return ", ".join(words)


def _checked(fit: Fit) -> list[str]:
    """Return sentences on the misfit, the data and the stability of the equilibria."""
    summaries = [
        f"{name}: {findings.summary}" if len(fit.findings) > 1 else findings.summary
        for name, findings in fit.findings.items()
    ]
    starts = f"Best of {len(fit.best.ranked)} starts: objective {fit.objective:.3g}"
    lines = [f"{'; '.join([starts, *summaries])}."]
    if fit.judgements:
        count = sum(len(judgement.doubts) for judgement in fit.judgements)
        outcome = f"{count} doubts, listed below" if count else "nothing doubtful"
        tests = ", ".join(judgement.test for judgement in fit.judgements)
        lines.append(f"The data were looked at before the fit ({tests}): {outcome}.")
    return [*lines, _stability(fit)]


def _stability(fit: Fit) -> str:
    """Return a sentence on whether the equilibria of the best fit are stable.

    Where the solver did not look at an equilibrium itself, the run in which the derivatives were
    taken may tell.
    """
    histories = fit.best.point.histories
    differentiated = (fit.best.with_derivatives or fit.best.point).histories
    stable = [
        derived.stable if history.stable is None else history.stable
        for history, derived in zip(histories, differentiated, strict=True)
    ]
    if all(stable):
        return "Every equilibrium at a reported load is stable."
    if False in stable:
        return "Equilibria at some of the reported loads are unstable: see the warnings."
    return "The solver did not look whether every equilibrium is stable."


def warnings_of(fit: Fit) -> Words:
    """Return the notes of the fit as a list of warnings, the gravest first.

    Without notes the list is one sentence that says so.
    """
    lines = [note.line for note in sorted(fit.notes, key=lambda note: -note.kind.weight)]
    return Words(lines, bulleted=True, warning=True) if lines else Words([NO_WARNING])


def misfit_table(fit: Fit) -> Table:
    """Return a table of the RMS residual of every comparison beside the noise of its data."""
    rows = [
        [name, misfit.rms, misfit.noise, misfit.unit, misfit.noise_is, misfit.ratio]
        for name, misfit in fit.misfits.items()
    ]
    header = ["compared", "RMS residual", "noise", "unit", "noise is", "residual over noise"]
    note = (
        "Noise: as the project gives it (noise of the test), else the scatter of the specimens, "
        "else usual for the instrument. The uncertainty uses the larger of noise and residual."
    )
    return Table("Residual beside the noise", header, rows, note, text=(3, 4))


def predicted_tables(fit: Fit) -> list[Table]:
    """Return a table of the fitted law's errors at tests of weight 0; no table without any."""
    rows = [
        [comparison, rms, prediction.units[comparison]]
        for prediction in fit.predicted.values()
        for comparison, rms in prediction.rms.items()
    ]
    note = "Tests of weight 0: not fitted, but run with the law of the fit."
    header = ["predicted", "RMS residual", "unit"]
    return [Table("Predicted, not fitted", header, rows, note, text=(2,))] if rows else []


def assumed(fit: Fit) -> list[tuple[str, object]]:
    """Return labels and values of nu12, the thickness and the form of the moduli.

    A label says whether its quantity was fixed or fitted. Thickness is in mm.
    """
    unknowns = fit.project.fit.unknowns
    project = fit.project
    fitted = {name: getattr(unknowns, name) is not None for name in ("nu12", "thickness")}
    thick = f"{fit.thickness:.4g} mm, {project.fabric.thickness_change}"
    return [
        (f"Poisson's ratio nu12 ({'fitted' if fitted['nu12'] else 'fixed'})", fit.law.nu12),
        ("thickness (fitted)" if fitted["thickness"] else "thickness", thick),
        ("form of the moduli", getattr(fit.law.form, "title", fit.law.form.name)),
    ]


def search_facts(fit: Fit) -> list[tuple[str, object]]:
    """Return labels and values of the search: objective, method, starts, analyses and time."""
    result = fit.result
    project = fit.project
    best = fit.best
    runs = result["external_runs"]
    cached = result["cached_runs"]
    return [
        (f"objective: {fit.setup.objective_is}", fit.objective),
        ("method", f"{project.fit.method} on {result['solver']}"),
        ("starts", f"{len(best.ranked)} feasible of {len(best.records)}"),
        *([("agreement", fit.agreement)] if fit.agreement else []),
        *([("coarse to fine", fit.stages)] if fit.stages else []),
        ("analyses", result["analyses"]),
        *([(f"of them by {result['solver']}", runs)] if runs or cached else []),
        *([("of them from the cache", cached)] if cached else []),
        ("wall time, s", result["wall_s"]),
    ]


def starts_table(fit: Fit) -> Table:
    """Return a table of all starts in the order of their objectives, the best first."""
    records = sorted(fit.best.records, key=lambda r: inf if r.objective is None else r.objective)
    rows = [
        [k, r.number, r.objective, r.analyses, r.status] for k, r in enumerate(records, start=1)
    ]
    header = ["rank", "start", "objective", "analyses", "how it ended"]
    return Table("Starts, best first", header, rows, text=(4,), closed=True)


def bounds_table(fit: Fit) -> Table:
    """Return a table of the value and the bounds of every free coefficient of the law."""
    form = fit.law.form
    unknowns = fit.problem.unknowns
    scale = fit.project.scales.modulus
    rows = [
        [
            form.labels[i],
            f"{fit.law.beta[i] / scale:.6g}",
            low / scale,
            high / scale,
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


#: Titles of the tables of each modulus.
MODULUS_TITLES = {
    "E1": "Young's modulus along the warp, E1",
    "E2": "Young's modulus along the fill, E2",
    "G12": "Shear modulus between warp and fill, G12",
}


def band_words(answer: Answer, scale: float = 1.0) -> str:
    """Return a modulus and its band in words, each marked where a bound of the fit makes it.

    Parameters
    ----------
    answer : Answer
        Modulus and band, MPa.
    scale : float
        Factor of the numbers: 1 for MPa, the thickness in mm for kN/m.
    """
    if answer.band is None:
        return f"{scale * answer.value:.3g}"
    values = answer.value, *answer.band
    value, lower, upper = (
        f"{_short(scale * v)}{mark}" for v, mark in zip(values, answer.marks, strict=True)
    )
    return f"{value}{SPACE}({lower}{SPACE}to{SPACE}{upper})"


def _short(value: float) -> str:
    """Return a number with three significant digits, or all digits before the point."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.3g}"


def answer_tables(fit: Fit) -> list[Part]:
    """Return tables of the moduli that follow from no others, a row for each strain, and a note.

    The last row of a table is at the strain up to which its modulus is fitted. The note explains
    band, units and strain of all three tables.
    """
    tables = []
    for name, label in modulus_labels(fit.law.form).items():
        rows = []
        for answer in answers(fit.best, fit.thickness):
            if answer.modulus == name and not 0.0 < answer.strain < LEAST_STRAIN:
                cells = [band_words(answer, scale) for scale in (1.0, fit.thickness)]
                rows.append([f"{100 * answer.strain:.2g} %{', its end' * answer.end}", *cells])
        title = MODULUS_TITLES.get(label, f"Young's modulus, {label}")
        tables.append(Table(title, ["strain", "MPa", "kN/m"], rows, side=True))
    band = f"In brackets the {percent(LEVEL)} band, noise and mesh together. "
    if any(any(answer.marks) for answer in answers(fit.best, fit.thickness)):
        band += f"{BOUND_WORDS}. "
    if fit.best.certainty is None:
        band = ""
    note = (
        "Tangent moduli at logarithmic strains along their own direction (shear: γ12). "
        f"{band}kN/m: MPa times the thickness of "
        f"{fit.thickness:.4g} mm. Beyond the last strain of a table no test reached: the card "
        "keeps the modulus that it has there."
    )
    return [*tables, Words([note])]


def reached_table(fit: Fit) -> Table:
    """Return a table of the strains up to which moduli are fitted, and which the tests reached."""
    reached = by_strain(fit.best.reached)
    valid = by_strain(fit.best.valid)
    rows = [[name, 100 * valid[name], 100 * strain] for name, strain in reached.items()]
    note = (
        "Logarithmic strain. The material card holds up to the first of the two: beyond it a "
        "modulus keeps the value it has there, even where a test reached further."
    )
    header = ["direction", "moduli fitted up to, %", "largest strain reached, %"]
    return Table("Where they end", header, rows, note)


# Names of the files of the folder, and `FILES`: their descriptions.
PARAMETERS_HEAD = "# Parameters of decks with standard deviations, bands and correlations.\n"
MODULI = "moduli.csv"
RESIDUALS = "residuals.csv"
COEFFICIENTS = "coefficients.csv"
MODULI_PICTURE = "moduli.png"
OPTIMA = "optima.png"
PINNED = "pinned.png"
FILES = (
    RESULT_FILE,
    (FITTED_CARD, "the material card"),
    (PARAMETERS, "the parameters of decks, with their bands"),
    (MODULI, "tangent moduli along their strains, with their bands"),
    (COEFFICIENTS, "every unknown with its standard deviation and its correlations"),
    (RESIDUALS, "every matched value beside the model's"),
    NOTES_FILE,
    ("history.csv", "one row an analysis"),
    (MODULI_PICTURE, "picture of the moduli"),
    (OPTIMA, "picture of the optima"),
    (PINNED, "picture of what each test pins down"),
)


@background.during_page()
def write_fit(fit: Fit, folder: Path) -> Path:
    """Write all files of a finished fit into its output folder.

    An earlier result.json is removed before anything is written, and result.json is written
    after everything else: a folder that has one is complete.

    Returns
    -------
    Path
        report.html.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    store = Store(folder)
    (folder / RESULT).unlink(missing_ok=True)
    fit.record.write(folder)
    tables = {}
    if fit.has_law:
        write_card(fit.card, folder / FITTED_CARD, fit.project.scales.modulus_unit)
        tables[MODULI] = fit.moduli()
    if fit.parameters:
        write_text(folder / PARAMETERS, PARAMETERS_HEAD + tomli_w.dumps(_plain(fit.parameters)))
    tables |= {COEFFICIENTS: fit.coefficients(), RESIDUALS: fit.residuals()}
    for name, table in tables.items():
        write_table(table, folder / name)
    write_notes(folder, fit.notes)
    page = write_report(folder, _page(fit, folder))
    background.wait()
    store.finish(fit.result)
    return page


def _plain(parameters: Mapping[str, Mapping[str, object]]) -> dict[str, dict[str, object]]:
    """Return the numbers of parameters without those that are not known, which TOML cannot say."""
    return {
        name: {key: value for key, value in numbers.items() if value is not None}
        for name, numbers in parameters.items()
    }


def _page(fit: Fit, folder: Path) -> Report:
    """Return the content of the page of a fit, and write its pictures into the folder."""
    exhibits = _exhibits(fit, folder)
    files = [*FILES, *fit.record.files]
    files += [file for exhibit in exhibits.values() for file in exhibit.files]
    standards = [table for exhibit in exhibits.values() for table in exhibit.standards]
    return Report(
        title=fit.project.title,
        verdicts=[("", fit.verdict)],
        about=about_of(fit.project, fit.record),
        sections=[
            PageSection("The answer", _answer(fit, folder)),
            PageSection("Can it be trusted?", _trust(fit)),
            *_moduli_over_strain(fit, folder),
            _measured_beside_modelled(fit, exhibits),
            PageSection(
                TITLE,
                [
                    *_determined(fit),
                    *sensitivity_parts(fit),
                    *(_unknowns_table(fit) if fit.has_law else []),
                    *_pinned(fit, folder),
                ],
            ),
            PageSection("How it was found", _search(fit, folder)),
            *([PageSection("Reports by standards", standards)] if standards else []),
            PageSection("The record", _record(fit, exhibits)),
            PageSection("How to cite", citation()),
        ],
        files=_present(files, folder),
        versions=fit.result["versions"],
    )


def _present(files: Sequence[tuple[str, str]], folder: Path) -> list[tuple[str, str]]:
    """Return the files that the folder has when its pictures are drawn, and result.json."""
    return [
        file
        for file in files
        if file[0] == RESULT or folder / file[0] in background.files or (folder / file[0]).exists()
    ]


def _exhibits(fit: Fit, folder: Path) -> dict[str, Exhibit]:
    """Return what the presenter of each test shows, by test, and let it write its files."""
    exhibits = {}
    for prepared in fit.setup.tests:
        name = prepared.test.name
        presenter = page_presenter_of(prepared.test.kind)
        out = Output.of(folder, name, len(fit.setup.tests) > 1)
        exhibits[name] = presenter.show(prepared, fit.tests[name], fit.findings[name], out)
    return exhibits


def _answer(fit: Fit, folder: Path) -> list[Part]:
    """Return the moduli with the card, or the parameters of decks, as files to be saved."""
    if fit.has_law:
        return [*answer_tables(fit), _download(folder, FITTED_CARD, "material card")]
    return [*_unknowns_table(fit), _download(folder, PARAMETERS, "parameters")]


def _moduli_over_strain(fit: Fit, folder: Path) -> list[PageSection]:
    """Return the section with the curves of the moduli; none without a law."""
    if not fit.has_law:
        return []
    return [PageSection("The moduli over strain", [_saved(moduli(fit), folder / MODULI_PICTURE)])]


def _download(folder: Path, name: str, words: str) -> Download:
    """Return a file of the folder that a reader saves from the page."""
    return Download(name, (folder / name).read_text(encoding="utf-8"), f"Save the {words} ({name})")


def _trust(fit: Fit) -> list[Part]:
    """Return the section on whether the fit can be trusted: warnings, misfits, assumptions."""
    of_law: list[Part] = [Facts(assumed(fit)), reached_table(fit)]
    return [
        warnings_of(fit),
        Words(_checked(fit)),
        misfit_table(fit),
        *predicted_tables(fit),
        *_error_tables(fit),
        *(of_law if fit.has_law else []),
    ]


def _error_tables(fit: Fit) -> list[Table]:
    """Return a table of errors of the moduli against a known law; no table for measured data."""
    ranges = fit.result.get("moduli_error_range", {})
    rows = []
    for name, error in fit.result.get("moduli_error", {}).items():
        start, end = ranges.get(name, (nan, nan))
        rows.append([name, percent(error), 100 * start, 100 * end])
    if not rows:
        return []
    note = (
        "Against the known solution, over the range of logarithmic strain in the table, which is "
        "what the tests reached. Single coefficients are not compared: the highest powers hardly "
        "act at these strains, so quite different coefficients give the same moduli."
    )
    header = ["modulus", "largest error", "from strain, %", "to strain, %"]
    return [Table("Errors of the moduli", header, rows, note)]


def _measured_beside_modelled(fit: Fit, exhibits: Mapping[str, Exhibit]) -> PageSection:
    """Return the section of the tests' exhibits, below headings if there are several tests."""
    is_known = all(prepared.known is not None for prepared in fit.setup.tests)
    parts = []
    for name, exhibit in exhibits.items():
        parts += exhibit.all_parts(name if len(exhibits) > 1 else "")
    return PageSection(f"{'Known' if is_known else 'Measured'} beside modelled", parts)


def _search(fit: Fit, folder: Path) -> list[Part]:
    """Return the section on the search; the chart of the optima is written into the folder."""
    return [
        Facts(search_facts(fit)),
        _saved(optima(fit), folder / OPTIMA),
        *convergence(fit, folder),
        starts_table(fit),
        *([bounds_table(fit)] if fit.has_law else []),
        *coefficients_table(fit),
    ]


def _record(fit: Fit, exhibits: Mapping[str, Exhibit]) -> list[Part]:
    """Return the tables of the fit's provenance, and of how each test was measured."""
    tables = [table for exhibit in exhibits.values() for table in exhibit.record]
    return [*record_tables(fit.record), *tables]


def convergence(fit: Fit, folder: Path) -> list[Charts]:
    """Return a chart of the objective over the analyses of the best start, of history.csv.

    Nothing where the folder has no history.
    """
    path = folder / HISTORY
    if not path.exists():
        return []
    history = pd.read_csv(path, usecols=["start", "mesh", "objective"])
    history = history[history["start"] == fit.best.ranked[0].number].reset_index(drop=True)
    history["objective"] = history["objective"].clip(lower=SMALLEST_OBJECTIVE)
    series = []
    for rank, (mesh, rows) in enumerate(history.groupby("mesh")):
        objectives = rows["objective"]
        series.append(line(f"{mesh} mesh", rows.index + 1, objectives, colour=rank, marks=True))
    is_log = spans_a_decade(history["objective"])
    words = f"The best start: {fit.setup.objective_is} at each of its analyses"
    axes = ("analysis", "objective")
    chart = Chart("", *axes, series, words, log_y=is_log, from_zero=not is_log)
    return [Charts("convergence", [chart], f"{words}.")]


def optima(fit: Fit) -> Charts:
    """Return the chart of the objectives that all starts ended at, from worst to best."""
    words = f"Optimum of every start: {fit.setup.objective_is}, from worst to best"
    if fit.coarse_to_fine is not None:
        words += "; starts with the same optimum on the coarse mesh have one on the full mesh"
    objectives = [np.nan if r.objective is None else r.objective for r in fit.best.records]
    return optima_chart(objectives, words)


def moduli(fit: Fit) -> Charts:
    """Return charts of the moduli that follow from no others over the strains of the fit.

    They show the moduli of the best fit with their bands and of the next best fits, and the known
    law of computed data.
    """
    strains = _strains(fit)
    true_law = next((t.known for t in fit.setup.tests if t.known is not None), None)
    curves = np.array([modulus_curves(law, strains) for law in fit.laws])
    band = None
    certainty = fit.best.certainty
    if certainty is not None:
        bands = [
            certainty.at(fit.law, name, x).band for name, x in zip(COMPONENTS, strains, strict=True)
        ]
        band = np.array(bands).transpose(1, 0, 2)
    truth = None if true_law is None else modulus_curves(true_law, strains)
    words = ", where a dot ends them" if truth is None and band is not None else ""
    if band is not None:
        words += f"; with their bands ({percent(LEVEL)}, noise and mesh together)"
    caption = f"Tangent moduli of the best fits over the strains reached{words}"
    return charts_of_labelled_moduli(
        moduli_charts(strains, curves, truth, band, caption), fit.law.form
    )


def _saved(charts: Charts, path: Path) -> Charts:
    """Write charts to a file, and return them for the page."""
    save(path, charts)
    return charts


def of_kind(fit: Fit, name: str, test: str | None) -> Charts:
    """Return charts that only some kinds of test have, such as the heights of a bubble test.

    Parameters
    ----------
    fit : Fit
        The finished fit.
    name : str
        Name of the charts in `PagePresenter.charts`.
    test : str or None
        Name of the test; None for the first test whose kind has such charts.

    Raises
    ------
    InputError
        The test has no such charts.
    """
    for prepared in fit.setup.tests:
        charts = page_presenter_of(prepared.test.kind).charts
        if test in (None, prepared.test.name) and name in charts:
            return charts[name](prepared, fit.tests[prepared.test.name])
    problem = f"expected one of {', '.join(fit.tests)}, with {name}; got {test or 'none of them'}"
    raise InputError(fit.project.path, "test", problem)


def residuals(fit: Fit, test: str | None) -> Charts:
    """Return charts of modelled minus measured values over the measured ones.

    Parameters
    ----------
    fit : Fit
        The finished fit.
    test : str or None
        Name of the test; None for all tests.

    Returns
    -------
    Charts
        One chart for each quantity, in which each part of a test is a series.

    Raises
    ------
    InputError
        There is no such test.
    """
    table = fit.residuals()
    check_one_of(test, fit.tests, "test", fit.project.path)
    table = table[table["test"].isin([test] if test else [*fit.tests])]
    charts = []
    for (quantity, unit), rows in table.groupby(["quantity", "unit"], sort=False):
        series: list[Series] = []
        for (name, part), of_part in rows.groupby(["test", "part"], sort=False):
            label = f"{name}: {part}" if part != name else str(name)
            measured = of_part["measured"]
            series.append(dots(label, measured, of_part["difference"], colour=len(series)))
        rms = np.sqrt(np.mean(rows["difference"] ** 2))
        title = f"{quantity}: RMS {rms:.3g} {unit}"
        across = f"measured {quantity}, {unit}"
        charts.append(Chart(title, across, f"modelled − measured, {unit}", series, title, level=0))
    return Charts("residuals", charts, "What the fit leaves of every matched value.")


def _strains(fit: Fit, count: int = 121) -> Array:
    """Return the (3, count) strains at which E1, E2 and G12 are drawn, each from zero."""
    return np.array([np.linspace(0.0, fit.best.valid[c], count) for c in COMPONENTS.values()])


def modulus_curves(law: HypoelasticLaw, strains: Array) -> Array:
    """Return the tangent moduli E1, E2 and G12 of a law.

    Parameters
    ----------
    law : HypoelasticLaw
        The law.
    strains : (3, k) array
        Logarithmic strains along warp and fill, and shear strains: a row for each modulus.

    Returns
    -------
    (3, k) array
        E1, E2 and G12, MPa.
    """
    return np.array([law.modulus(n, x) for n, x in zip(COMPONENTS, strains, strict=True)])


def _pinned(fit: Fit, folder: Path) -> list[Part]:
    """Return a chart and a table of the uncertainty that each test alone, and all tests, leave.

    Nothing where it is not known, or of a single test.
    """
    pinned = fit.pinned
    if not pinned:
        return []
    rows = []
    sigma = {}
    labels = modulus_labels(fit.law.form)
    for source, moduli in pinned.items():
        for name, label in labels.items():
            rows.append([source, label, *sigma_words_of(moduli[name].numbers)])
        known_sigma = [np.where(m.determined, m.sigma, np.inf) for m in moduli.values()]
        sigma[source] = 100 * np.array(known_sigma)
    note = (
        "noise of every test, its misfit or its scatter, whichever is larger, neighbours that err "
        "as one counted as one; within the bounds of the fit; before the "
        f"tests every modulus is taken to be known to {100 * PRIOR:.0f} %; unknown: "
        f"1 sigma of {percent(LARGEST_SIGMA)} or more, or a band from bound to bound"
    )
    header = ["test", "modulus", "median 1 sigma", "largest 1 sigma"]
    count = next(iter(sigma.values())).shape[1]
    caption = "What each test pins down: one standard deviation of the moduli"
    charts = charts_of_labelled_moduli(
        pinned_charts(_strains(fit, count), sigma, caption), fit.law.form
    )
    return [_saved(charts, folder / PINNED), Table("What each test pins down", header, rows, note)]


def write_failure(failed: FailedRun, folder: Path) -> Path:
    """Write the page of a fit, or of predictions, that failed; return the page's path.

    Raises
    ------
    OutputError
        The page cannot be written.
    """
    page = Report(failed.title, verdicts=[("", failed.verdict)], warnings=failed.lines)
    return write_report(folder, page)


def coefficients_table(fit: Fit) -> list[Table]:
    """Return a table of all unknowns with their correlations; no table where they are not known."""
    if fit.best.certainty is None:
        return []
    note = (
        "One standard deviation by noise, bounds left aside; then the correlations. Coefficients "
        "make up for each other: single ones are far less certain than the moduli they make."
    )
    title = "How sure the coefficients are, and how they hang together"
    return [correlation_table(title, fit.coefficients(), {"unit": "unit"}, note, text=(3,))]


def correlation_table(
    title: str, table: pd.DataFrame, extra: Mapping[str, str], note: str, text: Sequence[int] = ()
) -> Table:
    """Return a table of unknowns with their standard deviations and correlations.

    Parameters
    ----------
    title : str
        Heading of the table.
    table : DataFrame
        One row for each unknown, with the columns "unknown" (its name), "value", "sigma" (one
        standard deviation), those of `extra`, and one for each unknown, of that name, with the
        coefficients of correlation.
    extra : mapping of str to str
        Further columns of `table` that are shown, with their headings.
    note : str
        Text below the table.
    text : sequence of int
        Indices of the columns of text (`Table.text`).
    """
    names = table["unknown"].tolist()
    columns = ["unknown", "value", "sigma", *extra]
    # Adding 0.0 turns a negative zero into zero, so that no "-0.00" is shown.
    cells = pd.DataFrame({name: [f"{r + 0.0:.2f}" for r in table[name].round(2)] for name in names})
    rows = pd.concat([table[columns], cells], axis=1).to_numpy().tolist()
    header = ["unknown", "value", "1 sigma", *extra.values(), *names]
    return Table(title, header, rows, note, text, closed=True)


def optima_chart(objectives: ArrayLike, caption: str) -> Charts:
    """Return a chart of the objectives that the starts of a fit ended at, from worst to best.

    Parameters
    ----------
    objectives : (starts,) array_like
        Objective at the end of each start, NaN where it has no result; these are only counted.
    caption : str
        First sentence of the caption, without its full stop; numbers follow.
    """
    values = np.array(objectives, dtype=float, ndmin=1)
    # The objective of a perfect fit, zero, is raised so that a logarithmic axis can show it.
    optima = np.maximum(np.sort(values[np.isfinite(values)])[::-1], SMALLEST_OBJECTIVE)
    failed = len(values) - len(optima)
    words = f"{len(values)} start{'s' if len(values) > 1 else ''}"
    if failed:
        words += f", {failed} without a result"
    if len(optima):
        middle = np.median(optima)
        words += f": best {optima[-1]:.3g}, median {middle:.3g}, worst {optima[0]:.3g}"
    series = [dots("", 1 + np.arange(len(optima)), optima)]
    log = spans_a_decade(optima)
    axes = ("start, from worst to best", "objective")
    chart = Chart("", *axes, series, words, log_y=log, from_zero=not log)
    return Charts("optima", [chart], f"{caption}. {words[:1].upper()}{words[1:]}.")
