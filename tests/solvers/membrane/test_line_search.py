"""solvers/membrane/line_search.py: steps past moduli that jump."""

from dataclasses import replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import raised

# Thesis Table 3.1 and section 3.3, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81
TIGHT = 1e-11


def bias_strip_of(increments=100, final=BIAS[1], **counts):
    return bias_strip(BIAS[0], final, THICKNESS, increments=increments, **counts)


def test_newton_gets_past_moduli_that_jump():
    """Full steps of Newton go to and fro between two sides of a break."""
    restless = HypoelasticLaw.trilinear(
        (1421.0, 379.0, 817.0), (61.0, 123.0, 447.0), (64.0, 46.0, 20.0),
        [[0.0032, 0.0567], [0.0719, 0.0722], [0.0619, 0.0653]],
    )  # fmt: skip
    assert (np.diff(MembraneSolver(TIGHT).run(bias_strip_of(20), restless).load) > 0).all()
    solver, model = MembraneSolver(TIGHT), bias_strip_of(20)
    membrane = solver._membrane(model, restless)
    assert isinstance(membrane, Membrane)
    settings = membrane.newton
    membrane.newton = replace(settings, max_fruitless=settings.max_iterations + 1)
    raised(SolverFailure, "no equilibrium", solver.run, model, restless)
