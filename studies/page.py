"""The page of a fit: what every kind of study shows, around a kind's own figures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..materials.law import MODULI, HypoelasticLaw
from ..projects.fit import FitProject
from ..reports import Report, StartRow, Table, percent, plot_optima, write_report
from ..runs.folder import OutputFolder
from .results import BestFit

Array = NDArray[np.float64]
BEST = 5  # fits drawn together, as in Figs 4.9 to 4.11


def write_page(
    project: FitProject,
    found: BestFit,
    result: dict[str, Any],
    folder: OutputFolder,
    *,
    summary: str,
    facts: Sequence[tuple[str, object]],
    figures: Sequence[tuple[str, str]],
    tables: Sequence[Table],
    files: Sequence[tuple[str, str]],
) -> None:
    """Write report.html; `facts` come after how the fit was made, `files` where they are there."""
    runs = result["external_runs"]
    external = [(f"of them by {project.solver}", runs)] if runs else []
    scale = project.modulus_scale
    page = Report(
        title=project.title,
        summary=summary,
        facts=[
            ("objective: " + result["objective_is"], found.best.value),
            ("method", f"{project.method} on {project.solver}"),
            ("moduli", project.moduli),
            ("starts", f"{len(found.ranked)} feasible of {len(found.records)}"),
            ("analyses", result["analyses"]),
            *external,
            ("wall time, s", result["wall_s"]),
            ("Poisson's ratio nu12 (fixed)", project.nu12),
            ("thickness", f"{project.thickness:g} mm, {project.thickness_change}"),
            *facts,
        ],
        coefficients=[
            (f"beta_{place}", float(c / scale), float(low / scale), float(high / scale))
            for place, c, low, high in zip(
                project.free, found.best.coefficients, project.lower, project.upper, strict=True
            )
        ],
        unit=project.modulus_unit,
        moduli_error=result.get("moduli_error", {}),
        strain_reached=result["strain_reached"],
        warnings=result["warnings"],
        figures=figures,
        tables=tables,
        starts=[StartRow(r.number, r.objective, r.status, r.analyses) for r in found.records],
        files=[f for f in files if f[0] == "result.json" or (folder.path / f[0]).exists()],
        versions=result["versions"],
    )
    write_report(folder.path, page)


def draw_optima(found: BestFit, folder: OutputFolder, label: str) -> tuple[str, str]:
    """Draw the optimum of every start."""
    values = [np.nan if r.objective is None else r.objective for r in found.records]
    plot_optima(folder.path / "optima.png", values, label=label)
    return "optima.png", "Optimum of every start, from worst to best (as Fig. 4.8)"


def best_laws(project: FitProject, found: BestFit) -> list[HypoelasticLaw]:
    """The laws of the best starts, best first."""
    return [
        found.law.with_beta(project.full_beta(np.array(r.coefficients)))
        for r in found.ranked[:BEST]
    ]


def moduli_curves(law: HypoelasticLaw, strains: Array) -> Array:
    """(3, k) E1, E2, G12 in MPa at strains (3, k)."""
    return np.array([law.modulus(name, x) for name, x in zip(MODULI, strains, strict=True)])


def certainty_table(found: BestFit, note: str) -> list[Table]:
    """What the data determine, modulus by modulus; nothing where it is not known."""
    if found.certainty is None:
        return []
    body: list[list[object]] = [
        [name, percent(float(np.median(s))), percent(float(s.max()))]
        for name, s in found.certainty.sigma.items()
    ]
    header = ["modulus", "median 1 sigma", "largest 1 sigma"]
    return [Table("What the data determine", header, body, note)]
