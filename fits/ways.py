"""How a fit was found: method, starts and their optima, coefficients with their bounds."""

from __future__ import annotations

from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np

from ..reports import Facts, Section, Table
from ..reports.content import Part
from .coefficients import coefficients_table

if TYPE_CHECKING:
    from .result import Fit

TITLE = "How it was found"


def ways_section(fit: Fit, parts: list[Part]) -> Section:
    """Facts, `parts` (the picture of the optima), and the tables."""
    every = [
        Facts(found_by(fit)), *parts, starts_table(fit), bounds_table(fit), *coefficients_table(fit)
    ]  # fmt: skip
    return Section(TITLE, every)


def found_by(fit: Fit) -> list[tuple[str, object]]:
    """Method, starts and cost."""
    result, project, best = fit.result, fit.project, fit.best
    runs, cached = result["external_runs"], result["cached_runs"]
    return [
        (f"objective: {fit.setup.objective_is}", fit.objective),
        ("method", f"{project.fit.method} on {project.fit.solver}"),
        ("starts", f"{len(best.ranked)} feasible of {len(best.records)}"),
        *([("coarse to fine", fit.stages)] if fit.stages else []),
        ("analyses", result["analyses"]),
        *([(f"of them by {project.fit.solver}", runs)] if runs or cached else []),
        *([("of them from the cache", cached)] if cached else []),
        ("wall time, s", result["wall_s"]),
    ]


def starts_table(fit: Fit) -> Table:
    """Every start, best first."""

    def value(objective: float | None) -> float:
        return objective if objective is not None and isfinite(objective) else inf

    records = sorted(fit.best.records, key=lambda record: value(record.objective))
    rows: list[list[object]] = [
        [k, r.number, r.objective, r.analyses, r.status] for k, r in enumerate(records, start=1)
    ]
    header = ["rank", "start", "objective", "analyses", "how it ended"]
    return Table("Starts, best first", header, rows, text=(4,))


def bounds_table(fit: Fit) -> Table:
    """Value, lower and upper bound of everything that was fitted of the law."""
    form, unknowns, scale = fit.law.form, fit.problem.unknowns, fit.project.scales.modulus
    rows: list[list[object]] = [
        [form.labels[i], f"{float(fit.law.beta[i] / scale):.6g}", float(low / scale),
         float(high / scale)]
        for i, low, high in zip(form.free, *unknowns.box, strict=True)
    ]  # fmt: skip
    header = ["coefficient", f"value, {fit.project.scales.modulus_unit}", "lower bound",
              "upper bound"]  # fmt: skip
    return Table("Coefficients of the law", header, rows)


def optima(fit: Fit) -> np.ndarray:
    """(starts,) objective of every start, NaN where it has none."""
    return np.array([np.nan if r.objective is None else r.objective for r in fit.best.records])


def optima_words(fit: Fit) -> str:
    """The caption of their picture."""
    words = f"Optimum of every start: {fit.setup.objective_is}, from worst to best"
    if fit.coarse_to_fine is not None:
        words += "; starts with the same optimum on the coarse mesh have one on the full mesh"
    return words
