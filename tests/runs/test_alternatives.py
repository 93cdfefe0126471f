"""runs/alternatives.py: a loaded reference picture beside the sheet that a fit assumes."""

import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble.loaded_reference import LOADED_REFERENCE
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.alternatives import NOT_BETTER
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.bubbles import DOUBTED_LAW, THICKNESS

PRESSURES = (0.003, 0.02, 0.06, 0.15)


def fit_with_slack(*, tension=0.0, is_loaded=False):
    """Fit a slack to a sheet whose reference picture was taken under 3 kPa, or under tension."""
    model = BubbleModel(disk_mesh(100.0, 60), THICKNESS, PRESSURES, tension=(tension, tension))
    reference, *frames = MembraneSolver().run(model, DOUBTED_LAW).displacement
    points = np.array(model.mesh.points)
    if is_loaded:
        points += reference
        frames = [frame - reference for frame in frames]
    random = np.random.default_rng(1)
    bubble = bf.Bubble(
        points,
        [frame + 0.02 * random.standard_normal(points.shape) for frame in frames],
        PRESSURES[1:],
        radius=100.0,
        elements=60,
        objective="mm",
        sheet={"slack": True, "surface": "measured", "degree": 4},
    )
    return bf.fit(
        bubble,
        bf.Law("constant"),
        fabric=bf.Fabric("made", THICKNESS),
        starts=1,
        jobs=1,
        mesh_error="told",
        trust=["loaded-reference"],
    )


def test_reference_picture_under_pressure_is_tried_and_its_misfit_told():
    fit = fit_with_slack(is_loaded=True)
    (note,) = fit.best.notes
    assert note.kind is LOADED_REFERENCE
    pressure = re.search(r"a reference picture under (\S+) kPa", note)[1]
    assert float(pressure) == pytest.approx(3.0, rel=0.05)
    loaded, assumed = (float(words.split()[-1]) for words in note.split(" mm")[:2])
    assert loaded == pytest.approx(0.02, rel=0.1) and assumed > 1.15 * loaded
    assert fit.verdict.state == "not to be used"
    assert "a reference picture under pressure explains the data better" in fit.verdict.reasons


def test_sheet_clamped_under_tension_is_explained_better_at_rest():
    fit = fit_with_slack(tension=4.0)
    (note,) = fit.best.notes
    assert note.kind is NOT_BETTER and "the latter explains the data better" in note
