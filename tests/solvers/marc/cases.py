"""Builders of the tests with Marc."""

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.marc.analyses import bubble_deck
from bubblefit.solvers.marc.settings import MarcSettings

from ...marc_stand_in.files import sts_text, t19_text
from ...support.refusals import raised

TRILINEAR_LAW = HypoelasticLaw(
    1e3 * np.array([0, 3.0, -0.6, 0.06, -0.8, 1.07, 0.07, 0.4, -589.0, 217.0, -20.4, 0.8]),
    strain_range=[0.13, 0.2, 0.25],
)


def bubble_of(elements=48, increments=(0.01, 0.03, 0.1)):
    return BubbleModel(disk_mesh(100.0, elements, "quarter"), 0.81, increments)


LINEAR_LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
# The stand-in refuses decks that Marc would refuse, and takes every deck of ours

SETTINGS = MarcSettings(increments=0)


def text_of_bubble_deck(settings=SETTINGS, law=LINEAR_LAW):
    return bubble_deck(
        BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03)), law, settings
    )


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)


def model():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


def write_run_files(folder, given, history, number=3004):
    """What Marc leaves of a run that ended as `history` (of the embedded solver) says."""
    folder.mkdir(exist_ok=True)
    u = history.path
    still = np.zeros_like(u[0])
    frames = [(float(i), {"Displacement": d, "Reaction Force": still})
              for i, d in enumerate([still, *u])]  # fmt: skip
    (folder / "job.t19").write_text(t19_text(given.mesh.points, given.mesh.quads, frames))
    (folder / "job.sts").write_text(sts_text([float(i + 1) for i in range(len(u))], number))
    (folder / "job.out").write_text("marc\n")
    return folder


def marc_failure_of(solver, given=None, **options):
    found = raised(SolverFailure, "", solver.run, given or model(), LAW, **options)
    assert found.solver == "marc"
    assert (found.scratch / "job.dat").exists()
    return found
