"""Every unknown of a fit with its standard deviation, its bounds and its correlations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..reports import Table

if TYPE_CHECKING:
    import pandas as pd

    from .result import Fit

#: The columns before those of the correlations.
COLUMNS = ("unknown", "unit", "value", "sigma", "lower_bound", "upper_bound")
TITLE = "How sure the coefficients are, and how they hang together"


def coefficients_of(fit: Fit) -> pd.DataFrame:
    """Coefficients of the law in the project's unit, then the nuisance.

    Columns unknown, unit, value, sigma (one standard deviation by noise, bounds left aside),
    lower_bound, upper_bound, and of each unknown, under its name, the correlation with it. NaN
    where it is not known.
    """
    import pandas as pd

    unknowns, sure, scales = fit.problem.unknowns, fit.best.certainty, fit.project.scales
    size, nuisance = unknowns.size, unknowns.nuisance.all
    names = [*unknowns.labels, *unknowns.nuisance_names]
    scale = np.array([scales.modulus] * size + [1.0] * len(nuisance))
    known = None if sure is None else sure.reported
    y = fit.best.point.unknowns if known is None else known.best
    values = np.concatenate([fit.law.beta[list(unknowns.free)], y[size:]]) / scale
    ends = [
        np.concatenate([own, other]) / scale
        for own, other in zip(unknowns.box, unknowns.nuisance.bounds, strict=True)
    ]
    sigma, correlations = np.full(len(names), np.nan), np.full((len(names), len(names)), np.nan)
    if known is not None:
        sigma = np.sqrt(np.diag(known.coefficients)) / scale
        correlations = known.correlations
    units = [scales.modulus_unit] * size + [n.unit for n in nuisance]
    table = pd.DataFrame(dict(zip(COLUMNS, (names, units, values, sigma, *ends), strict=True)))
    return pd.concat([table, pd.DataFrame(correlations, columns=names)], axis=1)


def two_digits(correlation: float) -> str:
    """Without a sign of nothing."""
    return f"{round(correlation, 2) + 0.0:.2f}"


def coefficients_table(fit: Fit) -> list[Table]:
    """The same for the page, without the bounds; nothing where it is not known."""
    if fit.best.certainty is None or fit.best.certainty.posterior is None:
        return []
    found = coefficients_of(fit)
    names = found["unknown"].tolist()
    own = ["unknown", "value", "sigma", "unit"]
    rows: list[list[object]] = [
        [*(row[column] for column in own), *(two_digits(row[name]) for name in names)]
        for _, row in found.iterrows()
    ]
    note = (
        "One standard deviation by noise, bounds left aside; then the correlations. Coefficients "
        "make up for each other: single ones are far less certain than the moduli they make."
    )
    header = ["unknown", "value", "1 sigma", "unit", *names]
    return [Table(TITLE, header, rows, note, text=(3,))]
