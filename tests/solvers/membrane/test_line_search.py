"""solvers/membrane/line_search.py: steps past moduli that jump, and down to stable states."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.solvers.membrane.line_search import SETTINGS, searched_equilibrium
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


class Well:
    """A point whose energy x^4 / 4 - x^2 / 2 is least at 1 and -1; it rests unstably at 0."""

    tolerance, step_limit, needed_viscosity = 1e-12, 10.0, 0.0
    free = np.array([0])

    def __init__(self):
        self.tangent, self.states, self.factor = self, [], None

    def unbalance(self, u, pressure, with_tangent):
        x = u.reshape(-1)[0]
        self.states.append(x)
        self.residual, self.stiffness = np.array([x**3 - x]), 3 * x**2 - 1
        return abs(x**3 - x)

    def resist(self, viscosity):
        self.stiffness = 3 * self.states[-1] ** 2 - 1 + viscosity

    def renew_definite(self):
        self.factor = self.stiffness
        return self.stiffness > 0

    def near_inverse(self):
        return self.factor and (lambda rhs: rhs / self.factor)

    def times(self, columns):
        return self.stiffness * columns

    def step_into_contact(self, u, step):
        return step


@pytest.mark.parametrize("start", [0.1, -1e-3, 5.0])
def test_search_descends_to_a_stable_state_not_to_the_next(start):
    """From 0.1 Newton's iteration goes to 0."""
    well = Well()
    u = searched_equilibrium(well, np.array([[start, 0.0, 0.0]]), 0.0)
    assert u[0, 0] == pytest.approx(np.sign(start), abs=1e-8)
    assert np.sign(well.states).tolist() == [np.sign(start)] * len(well.states)
    assert len(well.states) < 50
    assert (well.needed_viscosity > 0) == (abs(start) < 1)
    least = replace(SETTINGS, largest_viscosity=0.1)
    limited = searched_equilibrium(Well(), np.array([[start, 0.0, 0.0]]), 0.0, least)
    assert (limited is None) == (abs(start) < 1)
