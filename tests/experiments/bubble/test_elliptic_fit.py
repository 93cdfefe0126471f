"""Fits of sheets whose clamped edge is an ellipse turned to the yarns."""

from __future__ import annotations

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.meshes.reading import SmoothReading
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...commands import in_process, result_in

OUTLINE = Outline(120.0, 80.0, 30.0)
KILO = [40, 120, 250]
LAW = HypoelasticLaw.linear(700.0, 300.0, 15.0)
PROJECT = """\
[fabric]
name = "computed"
thickness = 0.81
[units]
modulus = "MPa"
[law]
form = "constant"
strain_range = [0.13, 0.13, 0.13]
[law.bounds]
E1 = [100.0, 2000.0]
E2 = [50.0, 1500.0]
G12 = [2.0, 100.0]
[[bubble]]
name = "oval"
ellipse = { major = 120, minor = 80, angle = 30 }
pressures = [40, 120, 250]
elements = 112
[bubble.data.points]
files = ["0.csv", "1.csv", "2.csv"]
columns = { z = "z" }
[bubble.data.points.registration]
[fit]
starts = 1
seed = 3
jobs = 1
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A test on the mesh of the fit, seen by a camera whose x is 20 degrees from the warp."""
    place = tmp_path_factory.mktemp("oval")
    mesh = elliptic_disk_mesh(OUTLINE, 112)
    pressures = [1e-3 * p for p in KILO]
    model = BubbleModel(mesh, 0.81, pressures, default_increments(pressures))
    turn = Rotation.from_euler("z", 20.0, degrees=True).as_matrix().T
    line = np.linspace(-1, 1, 25)
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = OUTLINE.places(points[np.hypot(*points.T) < 0.98])
    sample, inside = SmoothReading.of(mesh).matrix(points)
    places = np.column_stack([points[inside], np.zeros(inside.sum())]) @ turn + [2.0, -3.0, 600.0]
    for k, moved in enumerate(MembraneSolver().run(model, LAW).displacement):
        table = np.hstack([places, (sample @ moved) @ turn])
        np.savetxt(place / f"{k}.csv", table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    (place / "project.toml").write_text(PROJECT)
    return place


def test_the_moduli_come_back(folder):
    """Which side of the yarns the ellipse lies on is what they stand on."""
    done = in_process("bubble", folder / "project.toml", "--out", folder / "out", cwd=folder)
    result = result_in(folder / "out")
    law = bf.read_card(folder / "out" / "material.toml").law
    # The turn of the rim is told to a few tenths of a degree; G12 feels it.
    for name, modulus, within in (("E1", 700.0, 0.01), ("E2", 300.0, 0.01), ("G12", 15.0, 0.06)):
        assert float(law.modulus(name, 0.02)) == pytest.approx(modulus, rel=within), name
    assert result["registration"]["warp_degrees"] == pytest.approx(20.0, abs=0.6)
    assert result["registration"]["warp"]["clear"] is None
    assert "found by the turn of the elliptic rim" in (folder / "out" / "report.html").read_text()
    assert "warp" in done.output
