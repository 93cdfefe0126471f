"""Made-up histories of bubbles: round, and flat sheets that are stretched evenly."""

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import History

BETA = np.zeros(12)


BETA[[11, 7, 3]] = 500.0, 200.0, 40.0


LAW = HypoelasticLaw(BETA, 0.25)


MODEL = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.8, (0.022, 0.3), (0.022, 0.3))


#: In mm: a paraboloid of 10 and 30 mm, sheared aside by 1 mm at the end.
ROUND = 1 - (MODEL.mesh.points[:, :2] ** 2).sum(axis=1) / 100.0**2


def history() -> History:
    u = np.zeros((2, len(ROUND), 3))
    u[:, :, 2] = np.outer([10.0, 30.0], ROUND)
    u[1, :, 0] = ROUND
    strain = np.array([0.11, 0.22, 0.04]), np.array([0.0, 0.0, -0.33])
    return History(np.array([0.022, 0.3]), u, strain[1], strain[0])


MESH = disk_mesh(100.0, 48)


QUARTER = BubbleModel(MESH, 0.8, (0.05, 0.1), (0.02, 0.05, 0.1))


def stretched(warp, fill):
    return MESH.points * [warp - 1, fill - 1, 0.0]


def history_of(path):
    path = np.asarray(path)
    own = {"path": path, "model": QUARTER, "law": LAW}
    return History(np.array([0.05, 0.1]), path[1:], np.zeros(3), np.zeros(3), **own)
