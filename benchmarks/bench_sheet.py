"""Fit computed tests of sheets that were neither flat nor taut, or on coarser quads than those."""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.mesh import SmoothReading, sampling_matrix
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import start_on
from uneven_test import RANGE, Uneven, errors, model, project_text, write_test

PRESSURES = (0.02, 0.05, 0.09, 0.14, 0.19, 0.24)
RIM, MODES, SURFACE = 'rim = "measured"', "modes = 10\nmisfit = 0.05", 'surface = "measured"'
WAYS = {
    "flat and taut": "",
    "measured rim only": RIM,
    "modes, no rim": MODES,
    "modes, measured rim": f"{MODES}\n{RIM}",
    "measured surface, no rim": SURFACE,
    "measured surface and rim": f"{SURFACE}\n{RIM}",
    "and slack": f"{SURFACE}\n{RIM}\nslack = true",
    "modes, rim, slack": f"{MODES}\n{RIM}\nslack = true",
}
#: MPa at rest and at a strain of 0.06: of G12, E2, E1.
MODULI, STEP = np.array([12.0, 12.0, 220.0, 196.0, 300.0, 228.0]), 0.01


def surfaces(elements: int = 112, *ways: str, data: int = 0) -> None:
    """Fit a computed uneven test on ELEMENTS quads in each of WAYS of [bubble.sheet].

    Six points at each node of the fit's mesh, or about as many at the nodes of another, --data.
    """
    repeats = max(1, round(6 * elements / data)) if data else 6
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        truth = write_test(folder, Uneven(repeats=repeats), PRESSURES, data or elements)
        z = truth.mesh.points[:, 2]
        print(f"z0 from {z.min():.2f} to {z.max():.2f} mm; errors of the moduli between a fifth of "
              "the strain reached and all of it")  # fmt: skip
        for name in ways or WAYS:
            path = folder / "project.toml"
            path.write_text(project_text(PRESSURES, elements, WAYS[name]))
            begun = time.perf_counter()
            # Several points at each node, the centre too, are no points without correlation.
            result = fit(read_project(path), trust=["zero-points"])
            off = errors(result.law, result.best.reached)
            numbers = result.findings["uneven"].numbers
            sheet, slack = numbers["sheet"]["surface_mm"], numbers["sheet"]["slack_percent"]
            words = "" if slack is None else f", slack {slack[0]:.3f} and {slack[1]:.3f} %"
            print(f"{name:26s} E1 {100 * off['E1']:6.1f} %  E2 {100 * off['E2']:6.1f} %  residual "
                  f"{numbers['mean_abs_mm']:.3f} mm, z0 {sheet['least']:.2f} to "
                  f"{sheet['largest']:.2f} mm{words}; G12 at rest "
                  f"{float(np.asarray(result.law.modulus('G12', 0.0))):.1f} MPa, "
                  f"{result.result['analyses']} analyses, {time.perf_counter() - begun:.0f} s",
                  flush=True)  # fmt: skip


def field(sheet: BubbleModel, moduli: np.ndarray) -> np.ndarray:
    """Return the displacements of a sheet with these moduli."""
    beta = np.zeros(12)
    for block, (rest, end) in enumerate(moduli.reshape(3, 2)):
        beta[4 * block + 2 : 4 * block + 4] = (end - rest) / 0.06, rest
    law = HypoelasticLaw(beta, 0.24, np.array(RANGE), "incompressible")
    return np.asarray(MembraneSolver(1e-9).run(sheet, law).displacement)


def facets(*quads: str) -> None:
    """Estimate what moduli lose on QUADS quads where the measured sheet had 3,072, without noise.

    By derivatives at the true law; read as flat quads, and as fits read them (`meshes/mesh.py`).
    """
    sheet = Uneven(slack=0.0, rim=0.0, noise=0.0)
    fine = model(sheet, PRESSURES, 3072)
    height = float(fine.mesh.points[fine.mesh.node_sets["apex"][0], 2])
    seen, places = field(fine, MODULI), fine.mesh.points[:, :2]
    chosen = np.flatnonzero(np.hypot(*places.T) < 98)[::2]
    for count in map(int, quads or (112, 240, 432, 1000)):
        own = model(sheet, PRESSURES, count)
        points = np.array(own.mesh.points)  # its largest height depends on the mesh
        points[:, 2] *= height / points[own.mesh.node_sets["apex"][0], 2]
        own = replace(own, mesh=replace(own.mesh, points=points))
        here = field(own, MODULI)
        slopes = [(field(own, MODULI * (1 + STEP * one)) - here) / STEP for one in np.eye(6)]
        for name, (sample, inside) in (
            ("flat quads", sampling_matrix(own.mesh, places[chosen])),
            ("smooth", SmoothReading.of(own.mesh).matrix(places[chosen])),
        ):

            def at(values: np.ndarray, sample=sample) -> np.ndarray:
                return np.concatenate([(sample @ frame).ravel() for frame in values])

            off = at(here) - seen[:, chosen[inside]].ravel()
            found = np.linalg.lstsq(np.stack([at(s) for s in slopes], axis=1), -off)[0]
            e2, e1 = 100 * found[2:4], 100 * found[4:6]
            print(f"{len(own.mesh.quads):5d} quads, {name:10s}: misfit "
                  f"{np.sqrt(np.mean(off**2)):.3f} mm RMS; E1 {e1[0]:+6.2f} % at rest, "
                  f"{e1[1]:+6.2f} % at 0.06, E2 {e2[0]:+6.2f} %, {e2[1]:+6.2f} %",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    start_on(surfaces, facets)
