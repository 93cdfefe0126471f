"""Forms of the moduli side by side: result.json, comparison.csv, figures and the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..experiments.tables import write_table
from ..identification.validation import FoldError
from ..projects.uniaxial import UniaxialProject
from ..reports import LawRow, Report, Table, plot_laws, plot_loads, write_report
from ..writing import replacing
from .results import BestFit
from .uniaxial_figures import load_panels
from .uniaxial_setup import UniaxialSetup

#: Of the smallest cross-validated error: a simpler form within it is as good.
AS_GOOD = 0.05


@dataclass(frozen=True, eq=False)
class FormResult:
    """One form of the moduli: its best fit, its errors on the data and in the folds."""

    form: str
    setup: UniaxialSetup
    fit: BestFit
    result: dict[str, Any]
    folds: list[FoldError]

    @property
    def coefficients(self) -> int:
        """How many are fitted."""
        return self.setup.problem.parameters.size

    def left_out(self, direction: str | None = None) -> list[float]:
        """Error in N of each fold at the points left out, NaN where it failed; the sum over the
        tests unless one is named."""
        return [
            math.nan
            if fold.rms is None
            else sum(fold.rms.values())
            if direction is None
            else fold.rms[direction]
            for fold in self.folds
        ]

    @property
    def validated(self) -> float:
        """Mean over the folds of the summed error, NaN where any of them failed."""
        return float(np.mean(self.left_out()))


def comparison(
    projects: Mapping[str, UniaxialProject], found: Sequence[FormResult]
) -> dict[str, Any]:
    """result.json: errors form by form, and the simplest form that is as good as the best."""
    forms = [
        {
            "form": f.form,
            "coefficients": f.coefficients,
            "e_uniaxial_N": f.result["e_uniaxial_N"],
            "rms_N": {d: t["rms_N"] for d, t in f.result["tests"].items()},
            "cross_validated_N": _number(f.validated),
            "cross_validated_by_test_N": {
                d: _number(float(np.mean(f.left_out(d)))) for d in f.result["tests"]
            },
            "folds_N": [_number(e) for e in f.left_out()],
            "starts_objective": [r.objective for r in f.fit.ranked],
        }
        for f in found
    ]
    project = next(iter(projects.values()))
    scatter = [s.scatter for s in project.strips.values()]
    whole = [f for f in found if math.isfinite(f.validated)]
    best = min(whole, key=lambda f: f.validated, default=None)
    simplest = None
    if best is not None:
        limit = (1 + AS_GOOD) * best.validated
        simplest = min((f for f in whole if f.validated <= limit), key=lambda f: f.coefficients)
    return {
        "command": "compare",
        "title": project.title,
        "forms": forms,
        "scatter_sum_N": None if None in scatter else float(sum(s for s in scatter if s)),
        "least_cross_validated": best.form if best else None,
        "simplest_as_good": simplest.form if simplest else None,
        "as_good_within": AS_GOOD,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def comparison_lines(result: dict[str, Any]) -> list[str]:
    """A table for the terminal."""
    lines = [f"{'moduli':<12}{'coefficients':>13}{'fitted, N':>12}{'cross-validated, N':>20}"]
    for form in result["forms"]:
        error = form["cross_validated_N"]
        validated = "a fold failed" if error is None else f"{error:.1f}"
        lines.append(
            f"{form['form']:<12}{form['coefficients']:>13}{form['e_uniaxial_N']:>12.1f}"
            f"{validated:>20}"
        )
    if result["scatter_sum_N"] is not None:
        lines.append(f"specimens scatter by {result['scatter_sum_N']:.1f} N (sum of the tests)")
    if result["simplest_as_good"] is not None:
        lines.append(
            f"least at points left out: {result['least_cross_validated']}; simplest within "
            f"{100 * AS_GOOD:.0f} % of it: {result['simplest_as_good']}"
        )
    return lines


def write_comparison(
    projects: Mapping[str, UniaxialProject],
    found: Sequence[FormResult],
    result: dict[str, Any],
    folder: Path,
) -> None:
    """comparison.csv, laws.png, loads.png and report.html."""
    directions = list(found[0].result["tests"])
    header = ["moduli", "coefficients", "e_uniaxial_N"]
    header += [f"rms_{d}_N" for d in directions] + ["cross_validated_N"]
    header += [f"cross_validated_{d}_N" for d in directions]
    rows: list[list[object]] = [
        [f.form, f.coefficients, f.result["e_uniaxial_N"],
         *(f.result["tests"][d]["rms_N"] for d in directions), f.validated,
         *(float(np.mean(f.left_out(d))) for d in directions)]
        for f in found
    ]  # fmt: skip
    with replacing(folder / "comparison.csv") as path:
        write_table(path, header, rows)
    laws = [
        LawRow(f.form, f.coefficients, f.result["e_uniaxial_N"], f.validated, f.left_out())
        for f in found
    ]
    plot_laws(folder / "laws.png", laws, result["scatter_sum_N"], "sum of the tests' RMS errors, N")
    _draw_loads(found, folder)
    project = next(iter(projects.values()))
    page = Report(
        title=f"{project.title}: forms of the moduli",
        summary="; ".join(comparison_lines(result)[-2:]),
        figures=[
            ("laws.png", "Error on the data, and at specimens or points left out of the fit"),
            ("loads.png", "Best fit of every form"),
        ],
        tables=[
            Table(
                "Errors in N",
                ["moduli", "coefficients", "fit", *directions, "left out", *directions],
                rows,
                "of the fit to all points, and at what the fits of the folds were not given",
            )
        ],
        files=[("comparison.csv", "the table"), ("result.json", "all numbers, for programs")],
    )
    write_report(folder, page)


def _draw_loads(found: Sequence[FormResult], folder: Path) -> None:
    setup = found[0].setup
    drawn: dict[str, list[Any]] = {s.direction: [] for s in setup.strips}
    rms: dict[str, list[float]] = {s.direction: [] for s in setup.strips}
    for f in found:
        for strip, model, objective, history in zip(
            f.setup.strips, f.setup.models, f.setup.objectives, f.fit.best.histories, strict=True
        ):
            u = np.array(model.elongations)
            drawn[strip.direction].append((f.form, u, history.load))
            rms[strip.direction].append(objective.rms(history))
    plot_loads(folder / "loads.png", load_panels(setup.strips, drawn, rms))
