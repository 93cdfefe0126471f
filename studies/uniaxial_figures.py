"""Figures and the page of a uniaxial study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..experiments.polynomial_order import compare_orders
from ..materials.law import MODULI
from ..meshes.strain import middle_strain
from ..models.uniaxial import UniaxialModel
from ..projects.uniaxial import UniaxialProject
from ..projects.uniaxial_data import StripData
from ..reports import (
    OrderErrors,
    StripCurves,
    Table,
    plot_loads,
    plot_moduli,
    plot_moduli_together,
    plot_orders,
    plot_strip,
    write_vtu,
)
from ..runs.folder import RESULT, OutputFolder
from ..solvers.base import History
from .page import best_laws, certainty_table, draw_optima, moduli_curves, write_page
from .uniaxial_results import UniaxialAssessment
from .uniaxial_setup import UniaxialSetup

Array = NDArray[np.float64]

SMOOTH = 200  # places at which a polynomial is drawn
ORDERS = range(1, 9)
MATCHED = {"polynomial": "load polynomials", "points": "measured points"}
FILES = (
    (RESULT, "all numbers of this page, for programs"),
    ("material.toml", "the material card"),
    ("history.csv", "one row an analysis of all strips"),
    ("loads.csv", "load curves of the best fit"),
    ("bias.vtu", "the deformed bias strip at the end, for ParaView"),
)


def report_uniaxial(
    project: UniaxialProject, setup: UniaxialSetup, found: UniaxialAssessment, folder: OutputFolder
) -> None:
    """Draw everything and write report.html and bias.vtu."""
    fit, result = found.fit, found.result
    errors = ", ".join(f"{d} {t['rms_N']:.3g}" for d, t in result["tests"].items())
    write_page(
        project,
        fit,
        result,
        folder,
        summary=f"Best of {len(fit.ranked)} starts: e = {fit.best.value:.4g}; RMS errors in N: "
        f"{errors}, together {result['e_uniaxial_N']:.4g}.",
        facts=[("matched", MATCHED[project.match_by])],
        figures=[
            *strip_figures(setup, fit.best.histories, folder.path),
            *_moduli(project, setup, found, folder.path),
            draw_optima(fit, folder, result["objective_is"]),
            *order_figures(setup, folder.path),
        ],
        tables=[
            strip_table(setup, fit.best.histories),
            *certainty_table(
                fit,
                "white noise as large as the specimen scatter (or the misfit) at every load "
                "matched; neighbouring points of a specimen err together, so this flatters",
            ),
        ],
        files=FILES,
    )


def strip_figures(
    setup: UniaxialSetup, histories: Sequence[History], folder: Path
) -> list[tuple[str, str]]:
    """Load curves against the data (Fig. 3.7), and the deformed bias strip."""
    named = {
        s.direction: [("model", np.array(m.elongations), h.load)]
        for s, m, h in zip(setup.strips, setup.models, histories, strict=True)
    }
    rms = {
        s.direction: [o.rms(h)]
        for s, o, h in zip(setup.strips, setup.objectives, histories, strict=True)
    }
    plot_loads(folder / "loads.png", load_panels(setup.strips, named, rms))
    figures = [("loads.png", "Load over gauge elongation: data and model (as Fig. 3.7)")]
    for strip, model, history in zip(setup.strips, setup.models, histories, strict=True):
        if strip.direction == "bias":
            draw_bias(model, history, folder)
            figures.append(("bias.png", "The bias strip at the end, with its shear strain"))
    return figures


def load_panels(
    strips: Sequence[StripData],
    models: Mapping[str, Sequence[tuple[str, Array, Array]]],
    rms: Mapping[str, Sequence[float]],
) -> list[StripCurves]:
    """What the panels of `plot_loads` show, by direction."""
    panels = []
    for strip in strips:
        curve = None
        if strip.polynomial is not None:
            u = np.linspace(0.0, strip.final_length - strip.gauge_length, SMOOTH)
            curve = u, strip.polynomial(u)
        panels.append(
            StripCurves(
                strip.direction,
                models[strip.direction],
                strip.points if strip.curves else None,
                curve,
                strip.scatter,
                rms.get(strip.direction, ()),
            )
        )
    return panels


def draw_bias(model: UniaxialModel, history: History, folder: Path, name: str = "bias") -> None:
    """The deformed strip with its shear strain as a picture and for ParaView."""
    u = history.displacement[-1]
    strain = middle_strain(model.mesh, u, model.warp)
    mesh = model.mesh
    gauge = mesh.node_sets["gauge"]
    plot_strip(folder / f"{name}.png", mesh.points, mesh.quads, u, strain[:, 2], gauge)
    fields = {"log_strain_1_2_12": strain}
    write_vtu(mesh, u, folder / f"{name}.vtu", cell_data=fields)


def _moduli(
    project: UniaxialProject, setup: UniaxialSetup, found: UniaxialAssessment, folder: Path
) -> list[tuple[str, str]]:
    """Moduli up to each direction's failure strain (Fig. 3.8), one axes and one panel each."""
    fit = found.fit
    ends = failure_strains(setup, fit.best.histories, fit.valid)
    strains = np.array([np.linspace(0.0, ends[c], 121) for _, c in MODULI.values()])
    best = moduli_curves(fit.law, strains)
    plot_moduli_together(folder / "failure.png", strains, best)
    laws = np.array([moduli_curves(law, strains) for law in best_laws(project, fit)])
    sigma = None
    if fit.certainty is not None:
        sure = fit.certainty
        sigma = best * np.array(
            [
                np.interp(x, sure.strain[name], sure.sigma[name])
                for name, x in zip(MODULI, strains, strict=True)
            ]
        )
    plot_moduli(folder / "moduli.png", strains, laws, sigma=sigma)
    return [
        ("failure.png", "Tangent moduli up to each direction's failure strain (as Fig. 3.8)"),
        ("moduli.png", "Tangent moduli of the best fits, with one standard deviation"),
    ]


def failure_strains(
    setup: UniaxialSetup, histories: Sequence[History], reached: Array
) -> tuple[float, float, float]:
    """Log strain of the warp and the fill gauge at the end, and shear strain in the bias gauge.

    `reached` (3,) takes the place of a test that is not there.
    """
    ends = list(map(float, reached))
    for strip, model, history in zip(setup.strips, setup.models, histories, strict=True):
        stretch = float(np.log(strip.final_length / strip.gauge_length))
        if strip.direction == "bias":
            strain = middle_strain(model.mesh, history.displacement[-1], model.warp)
            corners = model.mesh.points[model.mesh.quads][:, :, 1]
            low, high = model.mesh.points[model.mesh.node_sets["gauge"]][:, 1]
            inside = (corners.min(axis=1) > low - 1e-9) & (corners.max(axis=1) < high + 1e-9)
            ends[2] = min(ends[2], float(np.abs(strain[inside, 2]).max()))
        else:
            ends[0 if strip.direction == "warp" else 1] = stretch
    return ends[0], ends[1], ends[2]


def order_figures(setup: UniaxialSetup, folder: Path) -> list[tuple[str, str]]:
    """Which order the load polynomials should have, where there are points to ask."""
    panels = []
    for strip in setup.strips:
        if strip.polynomial is None or len(strip.points[0]) < max(ORDERS) + 2:
            continue
        elongation, load = strip.points
        whose = strip.specimen_of
        specimens = whose.tolist() if len(set(whose.tolist())) > 1 else None
        scores = compare_orders(elongation, load, ORDERS, specimens=specimens).scores
        panels.append(
            OrderErrors(
                strip.direction,
                [s.order for s in scores],
                [s.rmse for s in scores],
                [s.left_out for s in scores],
                strip.polynomial.order,
            )
        )
    if not panels:
        return []
    plot_orders(folder / "orders.png", panels)
    return [("orders.png", "Error of load polynomials by order, and with a specimen left out")]


def strip_table(setup: UniaxialSetup, histories: Sequence[History]) -> Table:
    """Misfit test by test beside the specimen scatter."""
    rows: list[list[object]] = []
    for strip, objective, history in zip(setup.strips, setup.objectives, histories, strict=True):
        polynomial = strip.polynomial
        rows.append(
            [
                strip.direction,
                objective.rms(history),
                strip.scatter,
                polynomial.r_squared if polynomial is not None else None,
                polynomial.rmse if polynomial is not None else None,
                len(objective.load),
                float(history.load[-1]),
            ]
        )
    header = ["test", "RMS error, N", "scatter of specimens, N", "R² of polynomial",
              "its RMSE, N", "points matched", "load at the end, N"]  # fmt: skip
    note = "Eqs 3.4 to 3.6; the scatter is the standard deviation about the polynomial"
    return Table("Misfit by test", header, rows, note)
