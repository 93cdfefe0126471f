"""solvers/membrane/nested_cholesky.py: parts of a mesh, and factors of its symmetric matrices."""

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.solvers.membrane.nested_cholesky import Dissection, Fronts

from .cases import distorted_grid

POINTS, QUADS = distorted_grid(7, 5, 7.0, 5.0)


@pytest.fixture
def system():
    """The fronts of small parts with an edge held, and a definite matrix (csc) of the mesh."""
    place = np.full(POINTS.size, -1)
    place[18:] = np.arange(POINTS.size - 18)
    element = np.random.default_rng(5).standard_normal((12, 12))
    element = element @ element.T + 5.0 * np.eye(12)
    unknowns = place[(3 * QUADS[:, :, None] + np.arange(3)).reshape(len(QUADS), 12)]
    rows, columns = np.repeat(unknowns, 12, axis=1), np.tile(unknowns, (1, 12))
    free = (rows >= 0) & (columns >= 0)
    values = np.broadcast_to(element.ravel(), rows.shape)[free]
    matrix = sp.csc_matrix((values, (rows[free], columns[free])))
    matrix.sum_duplicates()
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    return Fronts(Dissection(QUADS, POINTS, 3), place, matrix.indices, columns), matrix


def test_nodes_are_eliminated_once_and_after_the_parts_that_they_border():
    parts = Dissection(QUADS, POINTS, 3)
    part_of = np.empty(len(POINTS), dtype=int)
    for number, inner in enumerate(parts.inner):
        part_of[inner] = number
    assert np.sort(np.concatenate(parts.inner)).tolist() == list(range(len(POINTS)))
    assert all((part_of[border] > k).all() for k, border in enumerate(parts.border))
    assert parts.halves.count([]) == 16 and not len(parts.border[-1])


def test_factors_solve_to_single_precision_and_know_the_determinant(system):
    fronts, matrix = system
    factors = fronts.factorised(matrix.data)
    rhs = np.random.default_rng(6).standard_normal(matrix.shape[0])
    assert matrix @ factors(rhs) == pytest.approx(rhs, abs=1e-4)
    sign, logarithm = np.linalg.slogdet(matrix.toarray())
    assert sign == 1 and np.log(factors.pivots()).sum() == pytest.approx(logarithm, rel=1e-5)
    held = np.delete(np.arange(matrix.shape[0]), fronts.order[-1])
    ratio = logarithm - np.linalg.slogdet(matrix.toarray()[held][:, held])[1]
    assert np.log(factors.pivots()[fronts.order[-1]]) == pytest.approx(ratio, abs=1e-4)


def test_no_factors_of_a_matrix_that_is_not_definite(system):
    fronts, matrix = system
    smallest = np.linalg.eigvalsh(matrix.toarray())[0]
    assert fronts.factorised((matrix - 0.99 * smallest * sp.eye(matrix.shape[0])).data) is not None
    assert fronts.factorised((matrix - 1.01 * smallest * sp.eye(matrix.shape[0])).data) is None
