"""The answer of a fit in words: moduli at a few strains, in MPa and kN/m, and where they end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..experiments.notes import by_strain
from ..identification.bands import LEVEL
from ..materials.forms.base import COMPONENTS
from ..reports import Table, percent
from .few_strains import STRAINS, answer_at

if TYPE_CHECKING:
    from .result import Fit

#: What the moduli are called where nobody knows their letters.
WORDS: Mapping[str, str] = {
    "E1": "Young's modulus along the warp, E1",
    "E2": "Young's modulus along the fill, E2",
    "G12": "shear modulus between warp and fill, G12",
}
#: Within what stays on one line.
SPACE = "\u00a0"
#: The strain of the summary, and what it is called.
FIRST = 0.01


def modulus_at(fit: Fit, name: str, strain: float) -> tuple[float, float, float] | None:
    """MPa and the ends of its band, NaN where that is not known; None beyond where it is known."""
    if strain > fit.best.valid[COMPONENTS[name]]:
        return None
    found = answer_at(fit, name, strain)
    return (found.value, *((np.nan, np.nan) if found.band is None else found.band))


def band_words(value: float, lower: float, upper: float) -> str:
    """A value with its band, as many digits as it bears."""
    if not np.isfinite([lower, upper]).all():
        return f"{value:.3g}"
    return f"{_short(value)}{SPACE}({_short(lower)}{SPACE}to{SPACE}{_short(upper)})"


def _short(value: float) -> str:
    """Three digits, without powers of ten."""
    return f"{value:.0f}" if abs(value) >= 99.5 else f"{value:.3g}"


def answer_table(fit: Fit) -> Table:
    """A row a modulus and unit, a column a strain that one of them reaches."""
    far = max(float(fit.best.valid[c]) for c in COMPONENTS.values())
    strains = [strain for strain in STRAINS if strain <= far]
    rows: list[list[object]] = []
    for name, words in WORDS.items():
        found = [modulus_at(fit, name, strain) for strain in strains]
        end = percent(float(fit.best.valid[COMPONENTS[name]]))
        for unit, scale in (("MPa", 1.0), ("kN/m", fit.thickness)):
            cells = [None if m is None else band_words(*(scale * v for v in m)) for m in found]
            rows.append([words, unit, *cells, end])
    header = ["", "unit", *(f"at {100 * strain:g} %" for strain in strains), "known up to"]
    note = (
        "Tangent moduli at logarithmic strains along their own direction (shear: γ12). In brackets "
        f"the {percent(LEVEL)} band, noise and mesh together. kN/m: MPa times the thickness of "
        f"{fit.thickness:.4g} mm. Beyond the last column's strain no test reached: the card keeps "
        "the modulus that it has there."
    )
    sure = fit.best.certainty
    if sure is None or not sure.band:
        note = note.replace(f"In brackets the {percent(LEVEL)} band, noise and mesh together. ", "")
    return Table("Moduli", header, rows, note, text=(1,))


def reached_table(fit: Fit) -> Table:
    """How far the moduli are known, beside how far the tests went."""
    reached, valid = (by_strain(ends) for ends in (fit.best.reached, fit.best.valid))
    rows: list[list[object]] = [[name, valid[name], strain] for name, strain in reached.items()]
    note = (
        "Logarithmic strain. The material card holds up to the first of the two: beyond it a "
        "modulus keeps the value it has there, even where a test reached further."
    )
    header = ["direction", "moduli fitted up to", "largest strain reached"]
    return Table("Where they end", header, rows, note)


def answer_words(fit: Fit) -> str:
    """The same in a sentence, at a small strain that every modulus reaches."""
    least = min(float(fit.best.valid[c]) for c in COMPONENTS.values())
    at = FIRST if least >= FIRST else 0.0
    said = []
    for name, words in WORDS.items():
        found = modulus_at(fit, name, at)
        assert found is not None
        plain = words.rpartition(",")[0]
        said.append(f"{plain} {band_words(*found)} MPa")
    return f"At {100 * at:g} % strain: {'; '.join(said)}."
