"""solvers/membrane/increments.py: guesses along a history."""

import numpy as np
from bubblefit.solvers.membrane import increments


def test_extrapolation_is_exact_for_polynomials():
    x = np.array([0.0, 1.0, 2.5, 4.0])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    known = cubic(x)[:, None, None] * np.ones((4, 2, 3))
    np.testing.assert_allclose(increments.lagrange(x, known, 5.0), cubic(5.0), rtol=1e-12)
    path = [np.full((1, 3), 2.0), np.full((1, 3), 3.0)]
    np.testing.assert_allclose(increments.straight_on([1.0, 3.0], path, 4.0), 3.5)
    assert increments.straight_on([1.0], path[:1], 4.0) is path[0]
