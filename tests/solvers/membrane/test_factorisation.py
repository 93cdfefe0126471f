"""solvers/membrane/factorisation.py: tangents assembled, solved and judged."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.solvers.membrane import bubble, factorisation
from bubblefit.solvers.membrane.factorisation import (
    BandedTangent,
    BorderedTangent,
    SingularTangent,
    SparseTangent,
    SymmetricBand,
    near_step,
    tangent_for,
)
from bubblefit.solvers.membrane.loading import load_labels
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...inference.cases import MODEL as CASE_MODEL
from .cases import distorted_grid


@pytest.mark.parametrize(("limit", "kind"), [(10**9, BandedTangent), (0, SparseTangent)])
def test_tangents_assemble_and_solve_a_known_matrix(monkeypatch, limit, kind):
    points, quads = distorted_grid(3, 4, 3.0, 4.0)
    free = np.arange(6, points.size)
    random = np.random.default_rng(3)
    element = random.standard_normal((len(quads), 144)) + 40 * np.eye(12).ravel()
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    whole = sp.csr_matrix((element.ravel(), (rows, columns)), shape=(points.size,) * 2)
    expected = np.linalg.solve(whole.toarray()[6:, 6:], rhs := random.standard_normal((54, 2)))
    monkeypatch.setattr(factorisation, "LARGEST_BAND", limit)
    tangent = tangent_for(quads, points, free)
    assert isinstance(tangent, kind)
    used = tangent.slot >= 0
    np.add.at(tangent.data, tangent.slot[used], element[used])
    tangent.factor()
    assert tangent.solve(rhs) == pytest.approx(expected, rel=1e-9)
    assert tangent.solve(rhs[:, 0]) == pytest.approx(expected[:, 0], rel=1e-9)
    if kind is SparseTangent:  # the symmetric part, looked at last, is near enough
        tangent.definite()
        near, exact = tangent.near, tangent.exact
        left = rhs[:, 0] - tangent.times(tangent.step(rhs[:, 0], True)[:, None])[:, 0]
        assert np.linalg.norm(left) <= 1e-3 * np.linalg.norm(rhs[:, 0])
        assert tangent.exact is exact and tangent.near is near is not exact
    # Steps keep a factorisation only where it leads to the solution of the present matrix.
    for change, kept in ((1.0, kind is SparseTangent), (60.0, False)):
        before, known = tangent.near, np.flatnonzero(tangent.data)
        tangent.data[known] += change * random.standard_normal(len(known))
        left = rhs[:, 0] - tangent.times(tangent.step(rhs[:, 0], True)[:, None])[:, 0]
        assert np.linalg.norm(left) <= 1e-3 * np.linalg.norm(rhs[:, 0])
        assert (tangent.near is before) == kept


def test_band_of_a_strip_is_as_wide_as_a_row_of_its_quads():
    mesh = bias_strip(20.0, 22.0, 0.8, across=6, along=12).mesh
    unknowns = np.arange(mesh.points.size)
    tangent = tangent_for(mesh.quads, mesh.points, unknowns[unknowns % 3 < 2])
    assert isinstance(tangent, BandedTangent)
    assert tangent.width == 2 * (6 + 2) + 1


#: Sewn 4 % too long both ways: pressed together at low pressures, taut from 97 kPa on.
LOOSE = replace(CASE_MODEL, slack=(0.04, 0.04))
EVEN = HypoelasticLaw.linear(500.0, 500.0, 150.0)


def judged(monkeypatch, model, law):
    every = replace(model, pressures=model.increments)
    solver, pairs = MembraneSolver(), []
    membrane = solver._membrane(every, law)
    tangent, count = membrane.tangent, len(membrane.free)
    accept = bubble.IncrementRecord.accept

    def look(self, i, u):
        tangent.factor()
        whole = np.linalg.inv(tangent.solve(np.eye(count)))
        least = float(np.linalg.eigvalsh(0.5 * (whole + whole.T))[0])
        pairs.append((least > 0, tangent.definite()))
        accept(self, i, u)

    with monkeypatch.context() as patch:
        patch.setattr(bubble.IncrementRecord, "accept", look)
        solver._prepared = (every, membrane)
        found = solver.run(every, law)
    pressures = 1e3 * np.array(every.pressures)
    unstable = np.array([not stable for stable, _ in pairs])
    assert found.unstable == load_labels(pressures[unstable], "kPa")
    return pairs


@pytest.mark.parametrize("largest", [factorisation.LARGEST_BAND, 0], ids=["band", "sparse"])
def test_stability_is_the_sign_of_the_smallest_eigenvalue(monkeypatch, largest):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", largest)
    pairs = judged(monkeypatch, LOOSE, EVEN)
    assert pairs == 4 * [(False, False)] + 5 * [(True, True)]


@pytest.mark.parametrize(
    ("least", "exact_count", "is_definite"), [(1e-2, 0, True), (1e-6, 1, True), (-1e-9, 1, False)]
)
def test_doubtful_pivots_are_looked_at_in_double_precision(
    monkeypatch, least, exact_count, is_definite
):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", 0)
    points, quads = distorted_grid(1, 1, 1.0, 1.0)
    tangent = tangent_for(quads, points, np.arange(points.size))
    factorised, types = tangent.fronts.factorised, []

    def counted(data, number=np.float32):
        types.append(number)
        return factorised(data, number)

    monkeypatch.setattr(tangent.fronts, "factorised", counted)
    # Two equal and nearly dependent rows; x + a skew part, which does not count.
    matrix = np.eye(12)
    matrix[:2, :2] = [[1.0, 1.0], [1.0, 1.0 + least]]
    matrix[2, 3], matrix[3, 2] = 5.0, -5.0
    tangent.data[tangent.slot.ravel()] = matrix.ravel()
    assert tangent.definite() == is_definite
    assert types == [np.float32] + exact_count * [float]


def bordered_band(random, asymmetry):
    """A banded tangent with random entries, its border, and the whole matrix."""
    points, quads = distorted_grid(6, 5, 6.0, 5.0)
    tangent = BorderedTangent(tangent_for(quads, points, np.arange(points.size)))
    element = random.standard_normal((12, 12)) / 12
    element = element @ element.T + asymmetry * random.standard_normal((12, 12)) + np.eye(12)
    np.add.at(tangent.data, tangent.slot, np.broadcast_to(element.ravel(), tangent.slot.shape))
    tangent.stiffness, tangent.border = 0.5, random.standard_normal(points.size)
    return tangent, tangent.times(np.eye(points.size))


def test_step_is_solved_with_a_factorisation_near_by(monkeypatch):
    random = np.random.default_rng(8)
    tangent, matrix = bordered_band(random, 1e-3)
    inner, renewals = tangent.inner, []
    renew = type(inner).renew
    monkeypatch.setattr(type(inner), "renew", lambda self: renewals.append(self) or renew(self))
    rhs = random.standard_normal(len(matrix))

    def step(is_changed):
        x = near_step(tangent, rhs, is_changed)
        assert np.linalg.norm(matrix @ x - rhs) <= 1.001e-3 * np.linalg.norm(rhs)
        return len(renewals)

    assert step(False) == 1  # there was none
    assert isinstance(inner.near, SymmetricBand)
    tangent.data *= 1.0 + 1e-3 * random.standard_normal(len(tangent.data))
    matrix = tangent.times(np.eye(len(matrix)))
    assert step(False) == 1 and step(True) == 2
    # Not definite: the matrix is factorised as it is.
    tangent.data *= random.choice([-1.0, 1.0], len(tangent.data))
    matrix = tangent.times(np.eye(len(matrix)))
    assert step(True) == 3 and not isinstance(inner.near, SymmetricBand)
    tangent.data[:] = 0.0
    tangent.stiffness = 0.0
    with pytest.raises(SingularTangent):
        near_step(tangent, rhs, True)
