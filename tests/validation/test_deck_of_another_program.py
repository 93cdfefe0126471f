"""A deck of a second program: scikit-fem reads a filled text deck and writes VTU.

A sheet of 20 mm by 10 mm is clamped on the left, pulled and sheared on the right, plane stress.
"""

import subprocess
import sys

import bubblefit as bf
import meshio
import numpy as np
import pytest
from bubblefit.project.project import read_project
from bubblefit.solvers.settings import PROGRAMS_FROM

from ..builders.decks import HEAD
from ..support import needs

#: MPa, and Poisson's ratio.
TRUE = {"young": 480.0, "poisson": 0.32}
DECK = "[material]\nyoung = {{ young | number }}\npoisson = {{ poisson | number }}\n"
SCRIPT = """\
import tomllib
from pathlib import Path

import meshio
import numpy as np
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

material = tomllib.loads(Path("job.toml").read_text())["material"]
mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 20, 11), np.linspace(0, 10, 6))
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()))
lam, mu = lame_parameters(material["young"], material["poisson"])
stiffness = linear_elasticity(2 * lam * mu / (lam + 2 * mu), mu).assemble(basis)
right = mesh.facets_satisfying(lambda x: np.isclose(x[0], 20))
traction = skfem.LinearForm(lambda v, w: 3.0 * v[0] + 0.5 * v[1])
load = traction.assemble(skfem.FacetBasis(mesh, basis.elem, facets=right))
clamped = basis.get_dofs(lambda x: np.isclose(x[0], 0))
moved = skfem.solve(*skfem.condense(stiffness, load, D=clamped))[basis.nodal_dofs].T
for t in (1, 2):
    points, shift = (np.column_stack([a, np.zeros(len(a))]) for a in (mesh.p.T, t * moved))
    data = {"displacement": shift}
    meshio.write(f"out-{t}.vtu", meshio.Mesh(points, [("quad", mesh.t.T)], point_data=data))
"""
PROJECT = """\
[[deck]]
name = "sheet"
program = ["{program}", "solve.py"]
template = "job.toml.j2"
files = ["sets.inp"]
result = "out-*.vtu"

[deck.parameters]
young = {{ bounds = [100.0, 2000.0], unit = "MPa" }}
poisson = {{ bounds = [0.0, 0.45] }}

[[deck.compare]]
measured = "field_*.csv"
quantity = "displacement"
set = "SHEET"
times = [1.0, 2.0]
noise = 0.001
"""


def write_fields(folder):
    """Run the program with the true constants; write its fields as frames of image correlation."""
    folder.mkdir()
    (folder / "job.toml").write_text("[material]\nyoung = 480.0\npoisson = 0.32\n")
    subprocess.run([sys.executable, "-c", SCRIPT], cwd=folder, check=True)
    for t in (1, 2):
        result = meshio.read(folder / f"out-{t}.vtu")
        rows = np.column_stack([result.points, result.point_data["displacement"]])
        text = "\n".join(",".join(f"{value:.10g}" for value in row) for row in rows)
        (folder.parent / f"field_{t}.csv").write_text(f"x,y,z,dx,dy,dz\n{text}\n")
    return len(rows)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::bubblefit.BubblefitWarning")  # no noise at all
def test_constants_of_scikit_fem_are_found_through_vtu(tmp_path, monkeypatch):
    needs.library("skfem")
    monkeypatch.setenv(PROGRAMS_FROM, str(tmp_path))
    count = write_fields(tmp_path / "truth")
    (tmp_path / "solve.py").write_text(SCRIPT)
    (tmp_path / "job.toml.j2").write_text(DECK)
    (tmp_path / "sets.inp").write_text(f"*NSET, NSET=SHEET, GENERATE\n1, {count}\n")
    path = tmp_path / "project.toml"
    path.write_text(HEAD + PROJECT.format(program=sys.executable))
    fit = bf.fit(read_project(path), jobs=1)
    assert {name: number["value"] for name, number in fit.parameters.items()} == {
        name: pytest.approx(value, rel=1e-4) for name, value in TRUE.items()
    }
