"""Figures, VTU and the HTML page of a bubble study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..identification.blocks import Blocks
from ..materials.law import MODULI
from ..projects.bubble import BubbleProject
from ..reports import Table, plot_heights, plot_moduli, plot_profiles, write_vtu
from ..runs.folder import RESULT, OutputFolder
from ..solvers.base import History
from .bubble_setup import BubbleSetup
from .page import best_laws, certainty_table, draw_optima, moduli_curves, write_page

if TYPE_CHECKING:
    from .bubble_results import Assessment

Array = NDArray[np.float64]
NOT_MATCHED = "for the record: the fit matched the points themselves"
OBJECTIVES = {"e": "objective e (Eq. 4.8)", "mm": "objective, sum of RMS, mm"}
FILES = (
    (RESULT, "all numbers of this page, for programs"),
    ("material.toml", "the material card"),
    ("history.csv", "one row an analysis"),
    ("surfaces.csv", "polynomial surfaces of the data"),
    ("bubble.vtu", "the inflated bubble at the last pressure, for ParaView"),
)


def report(
    project: BubbleProject, setup: BubbleSetup, found: Assessment, folder: OutputFolder
) -> None:
    """Draw everything and write report.html and bubble.vtu."""
    fit, result = found.fit, found.result
    write_page(
        project,
        fit,
        result,
        folder,
        summary=f"Best of {len(fit.ranked)} starts: e = {fit.best.value:.3g}, mean "
        f"|dx| + |dy| + |dz| = {found.mean_absolute:.3g} mm.",
        facts=bubble_facts(result),
        figures=[
            draw_optima(fit, folder, OBJECTIVES[project.objective]),
            _moduli(project, setup, found, folder),
            *bubble_figures(project, setup, fit.best.histories[0], found.offset, folder),
        ],
        tables=bubble_tables(project, setup, fit.best.residual) + _certainty(found),
        files=FILES,
    )


def bubble_facts(result: dict[str, Any]) -> list[tuple[str, object]]:
    """What a bubble has to say at the head of the page."""
    facts: list[tuple[str, object]] = [("mean |dx| + |dy| + |dz|, mm", result["mean_abs_mm"])]
    dropped = result["data"]["doubtful_dropped"], result["data"]["outside_dropped"]
    if any(dropped):
        facts.append(("points left out", f"{dropped[0]} doubtful, {dropped[1]} beyond the rim"))
    for name, value in result["nuisance"].items():
        if value is not None:
            facts.append((name.replace("_", " "), np.array2string(np.asarray(value), precision=3)))
    return facts


def _moduli(
    project: BubbleProject, setup: BubbleSetup, found: Assessment, folder: OutputFolder
) -> tuple[str, str]:
    fit = found.fit
    strains = np.array([np.linspace(0, fit.reached[c], 121) for _, c in MODULI.values()])
    known = moduli_curves(setup.known, strains) if setup.known is not None else None
    curves = np.array([moduli_curves(law, strains) for law in best_laws(project, fit)])
    plot_moduli(folder.path / "moduli.png", strains, curves, known)
    return "moduli.png", "Tangent moduli of the best fits over the strain reached (as Fig. 4.9)"


def bubble_figures(
    project: BubbleProject,
    setup: BubbleSetup,
    history: History,
    offset: Array,
    folder: OutputFolder,
) -> list[tuple[str, str]]:
    """Cuts and heights against what was measured, and bubble.vtu."""
    displacement = history.displacement
    write_vtu(setup.model.mesh, displacement[-1], folder.path / "bubble.vtu")
    label = "known solution" if setup.known is not None else "measured"
    targets = setup.objective.targets
    plot_profiles(
        folder.path / "profiles.png",
        project.pressures,
        setup.model.mesh.points,
        displacement + offset,
        measured=[(f.points, f.displacement) for f in setup.fields],
        measured_label=label,
    )
    plot_heights(
        folder.path / "heights.png",
        project.pressures,
        [t.displacement[:, 2] for t in targets],
        [t.at(u)[:, 2] + offset[2] for t, u in zip(targets, displacement, strict=True)],
        label,
    )
    return [
        ("profiles.png", "Cuts through the bubble along x and y (as Figs 4.10 and 4.11)"),
        ("heights.png", "Modelled against measured height (as Fig. 4.7)"),
    ]


def bubble_tables(project: BubbleProject, setup: BubbleSetup, residual: Array) -> list[Table]:
    """Misfit by pressure and R^2 of the surfaces; `residual` of the bubble's own rows."""
    norms = Blocks(setup.objective.sizes).norms(residual).reshape(-1, 3)
    kilo = [1e3 * p for p in project.pressures]
    note = (
        "RMS error over the largest measured value, direction by direction (Eq. 4.8)"
        if project.objective == "e"
        else "RMS error in mm, direction by direction"
    )
    rows: list[list[object]] = [[p, *n.tolist()] for p, n in zip(kilo, norms, strict=True)]
    tables = [Table("Misfit by pressure", ["pressure, kPa", "x", "y", "z"], rows, note)]
    if setup.surfaces:
        text: list[list[object]] = [
            [p, *(f"{r:.5f}" for r in s.r_squared)]
            for p, s in zip(kilo, setup.surfaces, strict=True)
        ]
        title = f"R² of the surfaces of degree {project.match_degree} (Table 4.1)"
        header = ["pressure, kPa", "x", "y", "z"]
        tables.append(
            Table(title, header, text, "" if project.match_by == "surfaces" else NOT_MATCHED)
        )
    return tables


def _certainty(found: Assessment) -> list[Table]:
    sure = found.fit.certainty
    noise = 0.0 if sure is None else sure.noise["bubble"]
    return certainty_table(
        found.fit,
        f"white noise of {noise:.2g} mm on every displacement component; "
        "the single coefficients are far less certain than the moduli they make",
    )
