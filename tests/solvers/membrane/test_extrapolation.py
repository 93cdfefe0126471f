"""solvers/membrane/extrapolation.py: guesses along a history."""

import numpy as np
from bubblefit.solvers.membrane import extrapolation


def test_extrapolation_is_exact_for_polynomials():
    x = np.array([0.0, 1.0, 2.5, 4.0])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    known = cubic(x)[:, None, None] * np.ones((4, 2, 3))
    np.testing.assert_allclose(extrapolation.lagrange(x, known, 5.0), cubic(5.0), rtol=1e-12)
    path = [np.full((1, 3), 2.0), np.full((1, 3), 3.0)]
    np.testing.assert_allclose(extrapolation.straight_on([1.0, 3.0], path, 4.0), 3.5)
    assert extrapolation.straight_on([1.0], path[:1], 4.0) is path[0]
