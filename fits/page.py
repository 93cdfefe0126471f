"""The folder of a finished fit: card, tables, figures, report.html, and last result.json."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..experiments.exhibit import Exhibit
from ..identification.bands import LEVEL
from ..materials.card import write_card
from ..materials.forms.base import COMPONENTS
from ..materials.law import HypoelasticLaw
from ..notes import NOTES, NOTES_ARE, write_notes
from ..reports import (
    Charts,
    Download,
    Report,
    Section,
    percent,
    plot_moduli,
    plot_optima,
    plot_pinned,
    write_report,
)
from ..reports.content import Part
from ..reports.moduli_charts import moduli_charts, pinned_charts
from ..reports.optima_charts import optima_chart
from ..writing import replacing
from .answer import answer_table, answer_words, reached_table
from .citation import citation
from .determined import determined_section
from .store import RESULT, Store
from .trust import trust_section
from .ways import optima, optima_words, ways_section

if TYPE_CHECKING:
    from .result import Fit

Array = NDArray[np.float64]

CARD, MODULI, RESIDUALS = "material.toml", "moduli.csv", "residuals.csv"
COEFFICIENTS = "coefficients.csv"
MODULI_PICTURE, OPTIMA, PINNED = "moduli.png", "optima.png", "pinned.png"
#: Strains at which curves are drawn.
SMOOTH = 121
SAVE_CARD = "Save the material card (material.toml)"
FILES = (
    (RESULT, "all numbers of this page, for programs"),
    (CARD, "the material card"),
    (MODULI, "tangent moduli along their strains, with their bands"),
    (COEFFICIENTS, "every unknown with its standard deviation and its correlations"),
    (RESIDUALS, "every matched value beside the model's"),
    (NOTES, NOTES_ARE),
    ("history.csv", "one row an analysis"),
    (MODULI_PICTURE, "picture of the moduli"),
    (OPTIMA, "picture of the optima"),
    (PINNED, "picture of what each test pins down"),
)


def write_fit(fit: Fit, folder: Path) -> Path:
    """Write everything; raises OutputError."""
    store = Store(folder)
    (folder / RESULT).unlink(missing_ok=True)
    if fit.record is not None:
        fit.record.write(folder)
    write_card(fit.card, folder / CARD, fit.project.scales.modulus_unit)
    tables = {MODULI: fit.moduli(), COEFFICIENTS: fit.coefficients(), RESIDUALS: fit.residuals()}
    for name, table in tables.items():
        with replacing(folder / name) as path:
            table.to_csv(path, index=False, float_format="%.9g")
    write_notes(folder, fit.notes)
    page = write_report(folder, _page(fit, folder))
    store.finish(fit.result)
    return page


def _page(fit: Fit, folder: Path) -> Report:
    result = fit.result
    exhibits = {
        t.test.name: t.show(
            fit.tests[t.test.name], fit.findings[t.test.name], fit.output(folder, t.test.name)
        )
        for t in fit.setup.tests
    }
    record = [] if fit.record is None else fit.record.tables()
    files = [
        *FILES,
        *([] if fit.record is None else fit.record.files),
        *(f for exhibit in exhibits.values() for f in exhibit.files),
    ]
    card = (folder / CARD).read_text(encoding="utf-8")
    return Report(
        title=fit.project.title,
        summary=answer_words(fit),
        sections=[
            Section("The answer", [
                answer_table(fit), Download(CARD, card, SAVE_CARD), reached_table(fit),
            ]),
            trust_section(fit),
            Section("The moduli over strain", [_moduli(fit, folder)]),
            Section("Measured beside modelled", _shown(exhibits)),
            determined_section(fit, _pinned(fit, folder)),
            ways_section(fit, [_optima(fit, folder)]),
            Section("The record", [*record, *(t for e in exhibits.values() for t in e.record)]),
            Section("How to cite", citation()),
        ],
        files=[f for f in files if f[0] == RESULT or (folder / f[0]).exists()],
        versions=result["versions"],
    )  # fmt: skip


def _shown(exhibits: Mapping[str, Exhibit]) -> list[Part]:
    """What the tests show, each after its name where there are several."""
    return [
        part
        for name, exhibit in exhibits.items()
        for part in exhibit.all_parts(name if len(exhibits) > 1 else "")
    ]


def _optima(fit: Fit, folder: Path) -> Charts:
    plot_optima(folder / OPTIMA, optima(fit))
    return optima_chart(optima(fit), optima_words(fit))


def _moduli(fit: Fit, folder: Path) -> Charts:
    """The moduli over the strains that they are fitted to, as far as the card is valid."""
    strains = _strains(fit)
    known = next((t.known for t in fit.setup.tests if t.known is not None), None)
    curves = np.array([modulus_curves(law, strains) for law in fit.laws])
    band, sure = None, fit.best.certainty
    if sure is not None and sure.band:
        band = np.array(
            [
                [np.interp(x, sure.strain[name], end) for end in sure.band[name]]
                for name, x in zip(COMPONENTS, strains, strict=True)
            ]
        ).transpose(1, 0, 2)
    truth = None if known is None else modulus_curves(known, strains)
    shown = None if known is not None else band
    plot_moduli(folder / MODULI_PICTURE, strains, curves, truth, band=shown)
    words = ", where a dot ends them" if known is None and band is not None else ""
    if band is not None:
        words += f"; with their bands ({percent(LEVEL)}, noise and mesh together)"
    caption = f"Tangent moduli of the best fits over the strains reached{words}"
    return moduli_charts(strains, curves, truth, band, caption)


def _strains(fit: Fit, count: int = SMOOTH) -> Array:
    return np.array([np.linspace(0.0, fit.best.valid[c], count) for c in COMPONENTS.values()])


def modulus_curves(law: HypoelasticLaw, strains: Array) -> Array:
    """(3, k) E1, E2, G12 in MPa at strains (3, k)."""
    return np.array([law.modulus(n, x) for n, x in zip(COMPONENTS, strains, strict=True)])


def _pinned(fit: Fit, folder: Path) -> list[Charts]:
    if not (pins := fit.pinned):
        return []
    sigma = {
        source: 100 * np.array([sigmas[name] for name in COMPONENTS])
        for source, sigmas in pins.items()
    }
    count = next(iter(sigma.values())).shape[1]
    plot_pinned(folder / PINNED, _strains(fit, count), sigma)
    caption = "What each test pins down: one standard deviation of the moduli"
    return [pinned_charts(_strains(fit, count), sigma, caption)]
