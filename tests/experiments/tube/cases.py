"""Builders of the tests of tubes."""

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import TubeModel
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS, THICKNESS = 100.0, 0.8
LINEAR = HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)
PULLED = [(0.02, force, 0.0) for force in np.linspace(200, 2000, 5)]
TWISTED = [(0.02, 0.0, torque) for torque in np.linspace(5e3, 6e4, 7)]
LOADED = [*((p, 0.0, 0.0) for p in np.linspace(0.004, 0.02, 5)), *PULLED, *TWISTED]


def strains_of_tube(loads, law=LINEAR):
    model = TubeModel(loads, RADIUS, THICKNESS)
    return model.strains(MembraneSolver().run(model, law).displacement)
