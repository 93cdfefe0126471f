"""What the data of a fit determine: moduli, unknowns beside them, and each test alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..identification.propagation import PRIOR
from ..reports import Section, Table, percent
from ..reports.content import Part

if TYPE_CHECKING:
    from .result import Fit

Array = NDArray[np.float64]

TITLE = "What the data determine"
#: A modulus is said to be unknown from here on: as uncertain as it was before, but for rounding.
UNKNOWN = 0.999 * PRIOR


def determined_section(fit: Fit, pinned: Sequence[Part]) -> Section:
    """Tables, and `pinned`, the picture of what each test pins down."""
    parts = [*_determined(fit), *_beside(fit), *pinned, *_pinned_table(fit.pinned)]
    return Section(TITLE, parts)


def _beside(fit: Fit) -> list[Table]:
    """What the data say of every unknown beside the moduli."""
    rows: list[list[object]] = [
        [v.name, v.unit, v.value, v.sigma if v.determined else "not determined", v.lower, v.upper,
         v.prior, v.words]
        for v in fit.verdicts
    ]  # fmt: skip
    header = ["unknown", "unit", "value", "1 sigma", "least", "largest", "known to", "verdict"]
    note = (
        "Known to: one standard deviation before the tests. Correlation: with a modulus in the "
        "middle of its strains, where it is above one half."
    )
    return [Table("Unknowns beside the moduli", header, rows, note, text=(1, 7))] if rows else []


def sigma_words(value: float) -> str:
    """A relative uncertainty as percent, as long as it says anything."""
    return percent(value) if value < UNKNOWN else "unknown"


def _pinned_table(pins: dict[str, dict[str, Array]]) -> list[Table]:
    rows: list[list[object]] = [
        [source, name, sigma_words(float(np.median(s))), sigma_words(float(s.max()))]
        for source, sigmas in pins.items()
        for name, s in sigmas.items()
    ]
    note = (
        "noise of every test, its misfit or its scatter, whichever is larger, neighbours that err "
        "as one counted as one; before the "
        f"tests every modulus is taken to be known to {100 * PRIOR:.0f} %"
    )
    header = ["test", "modulus", "median 1 sigma", "largest 1 sigma"]
    return [Table("What each test pins down", header, rows, note)] if rows else []


def _together(alike: float) -> str:
    """How many neighbouring values count as one; nothing where each counts."""
    return f", {alike:.2g} neighbouring values err as one" if alike > 1.05 else ""


def _determined(fit: Fit) -> Sequence[Table]:
    """What the data determine, modulus by modulus; nothing where it is not known."""
    sure = fit.best.certainty
    if sure is None:
        return []
    mesh = {name: "not known" for name in sure.sigma}
    if sure.mesh is not None:
        mesh = {n: percent(round(float(np.abs(off).max()), 6)) for n, off in sure.mesh.items()}
    rows: list[list[object]] = [
        [name, percent(float(np.median(s))), percent(float(s.max())), mesh[name],
         percent(float(sure.total[name].max()))]
        for name, s in sure.sigma.items()
    ]  # fmt: skip
    units = {c.name: c.objective.unit for c in fit.problem.comparisons}
    noise = ", ".join(
        f"{value:.2g} {units[name]} ({name}{_together(sure.alike[name])})"
        for name, value in sure.noise.items()
    )
    note = (
        f"noise of {noise} on everything matched; a law or a model of the wrong form is not in it; "
        "single coefficients are far less certain than the moduli they make. Mesh: "
        "by how much a modulus would be another on ever finer meshes, from one run of a finer "
        "model at the best fit"
    )
    if sure.order is not None:
        note += f". Uncertainty of {sure.order.words}"
    header = ["modulus", "median 1 sigma", "largest 1 sigma", "mesh, largest", "together, largest"]
    return [Table(TITLE, header, rows, note)]
