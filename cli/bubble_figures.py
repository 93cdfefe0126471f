"""Figures, VTU and the HTML page of a bubble study."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..identification.objective import FieldTarget
from ..materials.law import MODULI, HypoelasticLaw
from ..reports import (
    Report,
    StartRow,
    Table,
    plot_heights,
    plot_moduli,
    plot_optima,
    plot_profiles,
    write_report,
    write_vtu,
)
from ..runs.folder import RESULT, OutputFolder
from .bubble_setup import BubbleSetup
from .project import BubbleProject

if TYPE_CHECKING:
    from .bubble_results import Assessment

Array = NDArray[np.float64]
NOT_MATCHED = "for the record: the fit matched the points themselves"
BEST = 5  # fits drawn beside the known solution, as in Figs 4.9 to 4.11
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
    figures = _figures(project, setup, found, folder)
    model = setup.model
    strains = found.fit.best.histories[0].displacement
    write_vtu(model.mesh, strains[-1], folder.path / "bubble.vtu")
    result = found.result
    runs = result["external_runs"]
    external = [(f"of them by {project.solver}", runs)] if runs else []
    facts: list[tuple[str, object]] = [
        ("objective " + result["objective_is"], found.fit.best.value),
        ("mean |dx| + |dy| + |dz|, mm", found.mean_absolute),
        ("method", f"{project.method} on {project.solver}"),
        ("starts", f"{len(found.fit.ranked)} feasible of {len(found.fit.records)}"),
        ("analyses", result["analyses"]),
        *external,
        ("wall time, s", result["wall_s"]),
        ("Poisson's ratio nu12 (fixed)", project.nu12),
    ]
    dropped = result["data"]["doubtful_dropped"], result["data"]["outside_dropped"]
    if any(dropped):
        facts.append(("points left out", f"{dropped[0]} doubtful, {dropped[1]} beyond the rim"))
    for name, value in result["nuisance"].items():
        if value is not None:
            facts.append((name.replace("_", " "), np.array2string(np.asarray(value), precision=3)))
    scale = project.modulus_scale
    coefficients = [
        (f"beta_{place}", float(c / scale), float(low / scale), float(high / scale))
        for place, c, low, high in zip(
            project.free, found.fit.best.coefficients, project.lower, project.upper, strict=True
        )
    ]
    page = Report(
        title=project.title,
        summary=f"Best of {len(found.fit.ranked)} starts: e = {found.fit.best.value:.3g}, mean "
        f"|dx| + |dy| + |dz| = {found.mean_absolute:.3g} mm.",
        facts=facts,
        coefficients=coefficients,
        unit=project.modulus_unit,
        moduli_error=result.get("moduli_error", {}),
        strain_reached=result["strain_reached"],
        warnings=result["warnings"],
        figures=figures,
        tables=_tables(project, setup, found),
        starts=[StartRow(r.number, r.objective, r.status, r.analyses) for r in found.fit.records],
        files=[f for f in FILES if f[0] == RESULT or (folder.path / f[0]).exists()],
        versions=result["versions"],
    )
    write_report(folder.path, page)


def _figures(
    project: BubbleProject, setup: BubbleSetup, found: Assessment, folder: OutputFolder
) -> list[tuple[str, str]]:
    problem = setup.problem
    displacement = found.fit.best.histories[0].displacement
    shown = displacement + found.offset
    label = "known solution" if setup.known is not None else "measured"
    values = [np.nan if r.objective is None else r.objective for r in found.fit.records]
    label_e = "objective e (Eq. 4.8)" if project.objective == "e" else "objective, sum of RMS, mm"
    plot_optima(folder.path / "optima.png", values, label=label_e)
    strains = np.array([np.linspace(0, found.fit.reached[c], 121) for _, c in MODULI.values()])
    laws = [
        problem.law.with_beta(project.full_beta(np.array(r.coefficients)))
        for r in found.fit.ranked[:BEST]
    ]
    known = _curves(setup.known, strains) if setup.known is not None else None
    curves = np.array([_curves(law, strains) for law in laws])
    plot_moduli(folder.path / "moduli.png", strains, curves, known)
    targets = setup.objective.targets
    plot_profiles(
        folder.path / "profiles.png",
        project.pressures,
        setup.model.mesh.points,
        shown,
        measured=[(f.points, f.displacement) for f in setup.fields],
        measured_label=label,
    )
    plot_heights(
        folder.path / "heights.png",
        project.pressures,
        [t.displacement[:, 2] for t in targets],
        [_at(t, u)[:, 2] + found.offset[2] for t, u in zip(targets, displacement, strict=True)],
        label,
    )
    return [
        ("optima.png", "Optimum of every start, from worst to best (as Fig. 4.8)"),
        ("moduli.png", "Tangent moduli of the best fits over the strain reached (as Fig. 4.9)"),
        ("profiles.png", "Cuts through the bubble along x and y (as Figs 4.10 and 4.11)"),
        ("heights.png", "Modelled against measured height (as Fig. 4.7)"),
    ]


def _at(target: FieldTarget, nodal: Array) -> Array:
    return target.at(nodal)


def _curves(law: HypoelasticLaw, strains: Array) -> Array:
    return np.array([law.modulus(name, x) for name, x in zip(MODULI, strains, strict=True)])


def _tables(project: BubbleProject, setup: BubbleSetup, found: Assessment) -> list[Table]:
    problem = setup.problem
    norms = problem.blocks.norms(found.fit.best.residual).reshape(-1, 3)
    kilo = [1e3 * p for p in project.pressures]
    header = ["pressure, kPa", "x", "y", "z"]
    note = (
        "RMS error over the largest measured value, direction by direction (Eq. 4.8)"
        if project.objective == "e"
        else "RMS error in mm, direction by direction"
    )
    rows: list[list[object]] = [[p, *n.tolist()] for p, n in zip(kilo, norms, strict=True)]
    tables = [Table("Misfit by pressure", header, rows, note)]
    if setup.surfaces:
        text: list[list[object]] = [
            [p, *(f"{r:.5f}" for r in s.r_squared)]
            for p, s in zip(kilo, setup.surfaces, strict=True)
        ]
        title = f"R² of the surfaces of degree {project.match_degree} (Table 4.1)"
        tables.append(
            Table(title, header, text, "" if project.match_by == "surfaces" else NOT_MATCHED)
        )
    if found.fit.certainty is not None:
        sure = found.fit.certainty
        body: list[list[object]] = [
            [name, f"{100 * float(np.median(s)):.2g} %", f"{100 * float(s.max()):.2g} %"]
            for name, s in sure.sigma.items()
        ]
        tables.append(
            Table(
                "What the data determine",
                ["modulus", "median 1 sigma", "largest 1 sigma"],
                body,
                f"white noise of {sure.noise['bubble']:.2g} mm on every displacement component; "
                "the single coefficients are far less certain than the moduli they make",
            )
        )
    return tables
