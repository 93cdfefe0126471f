"""solvers/calculix/sheets.py: decks of sheets and what they note."""

import re
from dataclasses import replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.calculix.deck import rim_paths, shell_mesh, tilt_remarks, without_stress
from bubblefit.solvers.calculix.sheets import bubble_decks

from ...support.refusals import raised
from .cases import uneven_bubble

LINEAR = HypoelasticLaw.linear(800.0, 400.0, 20.0)
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)


def bubble_model_of(elements, symmetry="quarter", pressures=PRESSURES):
    mesh = disk_mesh(100.0, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, default_increments(pressures))


def test_steep_shells_are_noted():
    """Slopes of up to 0.1 of a paraboloid 5 mm high and 100 mm in radius; of 10 mm 0.2."""
    model = uneven_bubble(432, (0.022,))
    shells = without_stress(shell_mesh(model.mesh, "S8R"), model)
    strained = replace(model, strain=np.zeros_like(model.mesh.points))
    raised(SolverFailure, "takes no metric", without_stress, shells, strained)
    assert not tilt_remarks(shells) and not tilt_remarks(shell_mesh(bubble_model_of(64).mesh, "S4"))
    (words,) = tilt_remarks(replace(shells, points=shells.points * [1, 1, 2]))
    assert re.search(r"slopes of up to 0\.(18|19) lower .* up to (6|7)\.\d %", words), words


def test_rim_stays_through_the_first_increment_of_a_step():
    model = uneven_bubble(64, (0.022, 0.059))
    paths = rim_paths(shell_mesh(model.mesh, "S8R"), model)
    corner = model.mesh.node_sets["rim"][1]
    one = next(p for p in paths if (p["node"], p["dof"]) == (corner + 1, 3))
    times, heights = np.array(one["path"]).T
    np.testing.assert_allclose(times, [0, 0.01, 1, 1.01, 2, 2.01, 3, 3.01, 4])
    assert heights[0] == heights[1] and heights[2] == heights[3]
    np.testing.assert_allclose(heights[2::2], model.rim_motion[:, 1, 2])
    text = bubble_decks(model, LINEAR, shell_mesh(model.mesh, "S8R"), "S8R")["job.inp"]
    firsts = [float(f) for f in re.findall(r"STATIC, SOLVER=SPOOLES\n([^,]+),", text)]
    assert max(firsts) <= 0.01 and text.count("TIME=TOTAL TIME") == len(paths)
    assert not rim_paths(shell_mesh(bubble_model_of(64).mesh, "S8R"), bubble_model_of(64))
