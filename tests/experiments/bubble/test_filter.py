"""A bubble seen through a coarse facet: fitted with the camera's filter, and without it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.reading import Facet, FacetReading, SmoothReading
from bubblefit.project.project import read_project
from bubblefit.runs.best import limit_of_meshes
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.solver import MembraneSolver

PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.2, 1.5]
E2 = [0.2, 1.5]
G12 = [0.02, 0.3]
[[bubble]]
radius = 100.0
pressures = [30, 120]
elements = 108
SYMMETRY
[bubble.data.points]
files = ["a.csv", "b.csv"]
FILTER
[fit]
starts = 1
jobs = 1
"""
FILTER = "[bubble.data.points.filter]\nfacet = 40.0\nsmoothing = 3\nstep = 10.0\n"
TRUE = {"E1": 800.0, "E2": 500.0, "G12": 80.0}


def project_in(folder: Path, filtered: str, symmetry: str = "") -> Path:
    path = folder / "project.toml"
    path.write_text(PROJECT.replace("FILTER", filtered).replace("SYMMETRY", symmetry))
    return path


def seen(folder: Path) -> None:
    """What a camera of such facets sees of the true bubble, at points 12 mm apart."""
    for name in ("a", "b"):
        (folder / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    model = read_project(project_in(folder, "")).tests["bubble"].model()
    law = HypoelasticLaw.linear(TRUE["E1"], TRUE["E2"], TRUE["G12"])
    moved = MembraneSolver().run(model, law).displacement
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-84.0, 85.0, 12.0)] * 2))
    points = np.column_stack([x, y])[np.hypot(x, y) < 85.0]
    facet = Facet(40.0, window=3, step=10.0)
    matrix, inside = FacetReading(SmoothReading.of(model.mesh), facet).matrix(points)
    assert inside.all()
    for name, frame in zip(("a", "b"), moved, strict=True):
        table = np.column_stack([points, matrix @ frame])
        np.savetxt(folder / f"{name}.csv", table, "%.12g", ",", header="x,y,dx,dy,dz", comments="")


def test_a_fit_through_the_same_filter_is_exact(tmp_path: Path) -> None:
    seen(tmp_path)
    through = fit(read_project(project_in(tmp_path, FILTER)))
    plain = fit(read_project(project_in(tmp_path, "")))
    for name, true in TRUE.items():
        assert float(through.law.modulus(name, 0.0)) == pytest.approx(true, rel=1e-4), name
    off = {name: float(plain.law.modulus(name, 0.0)) / true - 1 for name, true in TRUE.items()}
    assert min(abs(off["E1"]), abs(off["E2"])) > 0.02, off
    assert through.objective < 1e-5 < 1e-2 < plain.objective
    # What the error of the mesh is found by is seen through the filter, too.
    limit = limit_of_meshes(through.setup, through.problem, through.best)
    assert limit is not None and np.abs(limit.step).max() < 0.2


@pytest.mark.parametrize(
    ("filtered", "symmetry", "said"),
    [
        (FILTER, 'symmetry = "quarter"', "data.points.filter: a facet reaches over the edge"),
        (FILTER, '[bubble.match]\nby = "surfaces"', "data.points.filter: surfaces are matched"),
        (FILTER.replace("3", "2"), "", "data.points.filter.smoothing: expected 1, 3, 5"),
        (FILTER.replace("step = 10.0", ""), "", "data.points.filter.step: this key is missing"),
    ],
)
def test_what_is_no_filter(tmp_path: Path, filtered: str, symmetry: str, said: str) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    with pytest.raises(InputError, match=said):
        read_project(project_in(tmp_path, filtered, symmetry))
