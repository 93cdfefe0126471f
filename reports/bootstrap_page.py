"""The folder of a bootstrap: its tables, bootstrap.png, report.html, notes.csv, result.json."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..inference.posterior import LEVEL
from ..materials.forms.base import COMPONENTS
from ..runs.bootstrap import METHOD, SAMPLES
from ..runs.series import FILES, write_folder
from .charts import Array, Charts
from .content import Report, Section, Table
from .fit_page import two_digits
from .html import percent
from .moduli import bootstrap_charts
from .vega import save

if TYPE_CHECKING:
    from ..runs.bootstrap import Bootstrap

CAPTION = (
    f"Moduli of the fit, percentiles of the samples ({100 * LEVEL:.0f} %) and the fit's own "
    "band by the noise alone"
)
TABLE, COEFFICIENTS, FIGURE = "bootstrap.csv", "coefficients.csv", "bootstrap.png"


def write_bootstrap(done: Bootstrap, folder: Path) -> Path:
    """Write everything; raises OutputError. The page's path."""
    shown = (done.strains, _best(done), done.bands, done.of_fit)
    charts = bootstrap_charts(*shown, CAPTION)
    figures = {FIGURE: lambda path: save(path, charts)}
    tables = {TABLE: done.table(), COEFFICIENTS: done.coefficients()}
    return write_folder(folder, tables, figures, done.notes, _page(done, charts), done.result, 9)


def _best(done: Bootstrap) -> dict[str, Array]:
    """Moduli of the fit, MPa, by name, along their strains."""
    law = done.found.best.law
    return {name: law.modulus(name, strain) for name, strain in done.strains.items()}


def _page(done: Bootstrap, charts: Charts) -> Report:
    told = ", ".join(f"{name} {percent(own)}" for name, (own, _) in done.sigma.items())
    return Report(
        title=f"{done.found.setup.project.title}: bootstrap over {done.over}",
        summary=f"1 sigma over {len(done.samples)} samples: {told}.",
        facts=[
            ("card", done.found.card),
            ("tests", ", ".join(test.test.name for test in done.found.setup.tests)),
            ("drawn", ", ".join(f"{group.name}: {len(group.units)}" for group in done.groups)),
            ("analyses", done.analyses),
            ("samples that did not settle", done.unfinished),
        ],
        warnings=[note.line for note in done.notes],
        sections=[
            Section(
                "The samples",
                [
                    charts,
                    _sigmas(done),
                    _correlations(done),
                ],
            ),
        ],
        files=[
            (TABLE, "moduli along their strains, with both bands"),
            (FIGURE, "picture of the moduli"),
            (COEFFICIENTS, "the unknowns, with their correlations over the samples"),
            (SAMPLES, "every sample: what was drawn, and the optimiser's unknowns"),
            *FILES,
        ],
    )


def _sigmas(done: Bootstrap) -> Table:
    rows: list[list[object]] = [[name, *map(percent, done.sigma[name])] for name in COMPONENTS]
    header = ["modulus", "1 sigma of the samples", "of the fit, by noise"]
    return Table("How far the moduli scatter", header, rows, METHOD, text=(1, 2))


def _correlations(done: Bootstrap) -> Table:
    found = done.coefficients()
    names = found["unknown"].tolist()
    own = ["unknown", "value", "sigma", "sigma_of_fit"]
    rows: list[list[object]] = [
        [*(row[column] for column in own), *(two_digits(row[name]) for name in names)]
        for _, row in found.iterrows()
    ]
    header = ["unknown", "value", "1 sigma", "of the fit", *names]
    note = "Coefficients in MPa; then the correlations over the samples."
    return Table("Unknowns over the samples", header, rows, note)
