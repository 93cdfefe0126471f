"""meshes/strip_models.py: meshes and models of strips."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip, straight_strip, strip_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.laws import TABLE_3_2
from ..support.refusals import complaint

LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2))
# Thesis Table 3.1 and section 3.3, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81


def straight_strip_of(direction, increments=100):
    lengths = WARP if direction == "warp" else FILL
    return straight_strip(direction, *lengths, THICKNESS, increments=increments)


def bias_strip_of(increments=100, final=BIAS[1], **counts):
    return bias_strip(BIAS[0], final, THICKNESS, increments=increments, **counts)


@pytest.mark.parametrize("symmetry", ["full", "half"])
@pytest.mark.parametrize(("along", "gauge"), [(7, 3.0), (8, 7.9), (3, 0.5), (5, None)])
def test_strip_mesh_has_its_quads_and_sets(symmetry, along, gauge):
    mesh = strip_mesh(4.0, 8.0, 4, along, gauge, symmetry)
    (x, y), corner, sets = mesh.points[:, :2].T, mesh.points[mesh.quads], mesh.node_sets
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])[:, 2] / 2
    assert (area > 0).all()
    assert area.sum() == pytest.approx(32.0 if symmetry == "full" else 16.0)
    assert (sets["bottom"] == np.flatnonzero(y == 0)).all()
    assert (sets["top"] == np.flatnonzero(y == 8.0)).all()
    assert (sets["free_edges"] == np.flatnonzero(np.abs(x) == 2.0)).all()
    assert symmetry == "full" or (sets["symmetry_x"] == np.flatnonzero(x == 0)).all()
    a, b = sets["gauge"]
    assert x[a] == x[b] == 0
    assert y[b] - y[a] == pytest.approx(8.0 if gauge is None else gauge, abs=1e-13)
    assert y[a] == pytest.approx(8.0 - y[b], abs=1e-13)


def test_bad_strip_mesh_or_model_names_its_field():
    good = {"width": 4.0, "length": 8.0, "across": 4, "along": 6}
    for change in ({"gauge_length": 9.0}, {"along": 2, "gauge_length": 4.0}):
        assert next(iter(change)) in complaint(strip_mesh, **{**good, **change})
    model = bias_strip_of()
    for word, call, values, options in (
        ("elongations", replace, [model], {"elongations": [1.0, 1.0]}),
        ("thickness", replace, [model], {"thickness": 0.0}),
        ("final_length", straight_strip, ["warp", 20.0, 19.0, THICKNESS], {}),
        ("pressure_offset", MembraneSolver().run_with_sensitivity,
         [straight_strip_of("warp"), LAW, ["pressure_offset"]], {}),
    ):  # fmt: skip
        assert word in complaint(call, *values, **options)
