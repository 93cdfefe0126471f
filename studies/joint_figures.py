"""Figures and the page of a joint study."""

from __future__ import annotations

import numpy as np

from ..materials.law import MODULI
from ..projects.joint import JointProject
from ..reports import Table, plot_moduli, plot_pinned
from ..runs.folder import OutputFolder
from .bubble_figures import bubble_facts, bubble_figures, bubble_tables
from .joint_results import JointAssessment, sigma_words
from .joint_setup import JointSetup
from .page import best_laws, draw_optima, moduli_curves, write_page
from .uniaxial_figures import FILES, order_figures, strip_figures, strip_table

JOINT_FILES = (*FILES, ("bubble.vtu", "the inflated bubble at the last pressure, for ParaView"))


def report_joint(
    project: JointProject, setup: JointSetup, found: JointAssessment, folder: OutputFolder
) -> None:
    """Draw everything and write report.html, bias.vtu and bubble.vtu."""
    fit, result = found.fit, found.result
    bubble, strips = fit.best.histories[0], fit.best.histories[1:]
    rows = setup.problem.rows(0)
    weight = project.bubble_weight / len(setup.bubble.objective.sizes)
    write_page(
        project,
        fit,
        result,
        folder,
        summary=f"Best of {len(fit.ranked)} starts: bubble mean |dx| + |dy| + |dz| = "
        f"{result['mean_abs_mm']:.3g} mm, strips e_uniaxial = {result['e_uniaxial_N']:.4g} N.",
        facts=bubble_facts(result),
        figures=[
            *_pinned(found, folder),
            *strip_figures(setup.uniaxial, strips, folder.path),
            *bubble_figures(project.bubble, setup.bubble, bubble, found.offset, folder),
            _moduli(project, setup, found, folder),
            draw_optima(fit, folder, result["objective_is"]),
            *order_figures(setup.uniaxial, folder.path),
        ],
        tables=[
            *_pinned_table(found),
            strip_table(setup.uniaxial, strips),
            *bubble_tables(project.bubble, setup.bubble, fit.best.residual[rows] / weight),
        ],
        files=JOINT_FILES,
    )


def _strains(found: JointAssessment, count: int) -> np.ndarray:
    ends = found.fit.valid
    return np.array([np.linspace(0.0, ends[c], count) for _, c in MODULI.values()])


def _pinned(found: JointAssessment, folder: OutputFolder) -> list[tuple[str, str]]:
    if not found.pinned:
        return []
    sigma = {
        source: 100 * np.array([sigmas[name] for name in MODULI])
        for source, sigmas in found.pinned.items()
    }
    count = next(iter(sigma.values())).shape[1]
    plot_pinned(folder.path / "pinned.png", _strains(found, count), sigma)
    return [("pinned.png", "What each data set pins down: one standard deviation of the moduli")]


def _pinned_table(found: JointAssessment) -> list[Table]:
    rows: list[list[object]] = [
        [source, name, sigma_words(s["median"]), sigma_words(s["largest"])]
        for source, sigmas in found.result["pinned"].items()
        for name, s in sigmas.items()
    ]
    note = (
        "white noise of every test, its misfit or its scatter, whichever is larger; before the "
        "tests every modulus is taken to be known to 1000 %"
    )
    header = ["data", "modulus", "median 1 sigma", "largest 1 sigma"]
    return [Table("What each data set pins down", header, rows, note)] if rows else []


def _moduli(
    project: JointProject, setup: JointSetup, found: JointAssessment, folder: OutputFolder
) -> tuple[str, str]:
    strains = _strains(found, 121)
    known = None
    if setup.bubble.known is not None:
        known = moduli_curves(setup.bubble.known, strains)
    laws = np.array([moduli_curves(law, strains) for law in best_laws(project, found.fit)])
    plot_moduli(folder.path / "moduli.png", strains, laws, known)
    return "moduli.png", "Tangent moduli of the best fits over the strains they are fitted to"
