"""meshes/sampling.py: displacements between the nodes, and as facets see them."""

import numpy as np
import pytest
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.sampling import Facet, FacetReading, SmoothReading, sampling_matrix

from ..support.refusals import complaint
from .mesh_checks import quadratic_field

FINE = SmoothReading.of(disk_mesh(100.0, 3072, "full"))
#: Of a wave of 50 mm, and where it is looked at.
WAVE = 2 * np.pi / 50.0
FACET_PLACES = np.array([[11.0, -7.0], [-20.0, 30.0], [3.0, 44.0]])


def wave(points):
    return np.cos(WAVE * points[:, 0] + 0.3)


HALF_FACET = 0.5 * WAVE * 6.0
#: The mean, and that of P2 times the wave, over a facet of 35 mm; a = k f / 2.
FIRST_ORDER = 0.5 * WAVE * 35.0
MEAN, SECOND = (
    np.sin(FIRST_ORDER) / FIRST_ORDER,
    np.sin(FIRST_ORDER) / FIRST_ORDER
    + 3 * np.cos(FIRST_ORDER) / FIRST_ORDER**2
    - 3 * np.sin(FIRST_ORDER) / FIRST_ORDER**3,
)


@pytest.mark.parametrize(
    ("facet", "share"),
    [
        *((Facet(size), np.sinc(size / 50.0)) for size in (5.0, 20.0, 35.0)),
        # Of five points 6 mm apart less is left.
        (
            Facet(20.0, window=5, step=6.0),
            np.sinc(0.4) * np.sin(5 * HALF_FACET) / (5 * np.sin(HALF_FACET)),
        ),
        # Of the second order 5/2 terms of Legendre's second polynomial are added.
        (Facet(35.0, order=2), MEAN - 2.5 * SECOND),
    ],
)
def test_facet_damps_a_wave_as_its_transfer_function_says(facet, share):
    """sin(k f / 2) / (k f / 2) of the first order; 0.76 of one of 50 mm by a facet of 20."""
    matrix, inside = FacetReading(FINE, facet).matrix(FACET_PLACES)
    assert inside.all()
    np.testing.assert_allclose(
        matrix @ wave(FINE.mesh.points), share * wave(FACET_PLACES), atol=1e-3
    )


def test_facet_of_second_order_keeps_a_parabola():
    parabola, kept = quadratic_field(FINE.mesh.points), quadratic_field(FACET_PLACES)
    first, second = (
        FacetReading(FINE, Facet(35.0, order=order)).matrix(FACET_PLACES)[0] @ parabola
        for order in (1, 2)
    )
    np.testing.assert_allclose(second, kept, rtol=1e-9)
    np.testing.assert_allclose(first - kept, 35.0**2 / 24 * (0.02 + 0.06), rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_facet_over_the_edge_keeps_a_plane(order):
    """Nothing is invented beyond the rim: a plane is kept, also by a third of a facet."""
    places = np.array([[97.0, 0.0], [0.0, -99.0], [70.0, 70.0], [99.5, 2.0]])
    matrix, inside = FacetReading(FINE, Facet(20.0, order)).matrix(places)
    assert inside.all()
    x, y = FINE.mesh.points[:, :2].T
    kept = matrix @ (1.0 + 0.5 * x - 0.3 * y)
    np.testing.assert_allclose(kept, 1.0 + places @ [0.5, -0.3], rtol=1e-9)
    outside = FacetReading(FINE, Facet(20.0)).matrix(np.array([[0.0, 0.0], [105.0, 0.0]]))
    assert outside[0].shape[0] == 1 and outside[1].tolist() == [True, False]


@pytest.mark.parametrize(
    ("given", "field"),
    [
        ({"size": 0.0}, "facet"), ({"size": 1.0, "order": 3}, "order"),
        ({"size": 1.0, "window": 4, "step": 1.0}, "smoothing"),
        ({"size": 1.0, "window": 3}, "step"),
    ],
)  # fmt: skip
def test_bad_facet_names_its_field(given, field):
    assert f"{field}: " in complaint(Facet, **given)


POINTS = np.random.default_rng(5).uniform(-100, 100, (900, 2))


def dome(points):
    x, y = points[:, :2].T / 100.0
    return 30.0 * np.cos(1.2 * x + 0.3) * np.cos(1.0 * y - 0.2)


@pytest.mark.parametrize(
    "mesh",
    [
        disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 112),
        elliptic_disk_mesh(Outline(120.0, 30.0, 40.0), 112),
    ],
    ids=["quarter", "full", "slender"],
)  # fmt: skip
def test_smooth_reading_keeps_nodes_and_quadratics(mesh):
    reading = SmoothReading.of(mesh)
    matrix, inside = reading.matrix(mesh.points[:, :2])
    assert inside.all()
    np.testing.assert_allclose(matrix.toarray(), np.eye(len(mesh.points)), atol=1e-9)
    matrix, inside = reading.matrix(POINTS)
    np.testing.assert_array_equal(inside, sampling_matrix(mesh, POINTS)[1])
    read = matrix @ quadratic_field(mesh.points)
    np.testing.assert_allclose(read, quadratic_field(POINTS[inside]), rtol=1e-8)
    few = SmoothReading.of(disk_mesh(100.0, 8, "quarter"))
    matrix, inside = few.matrix(np.array([[30.0, 30.0], [200.0, 0.0]]))
    assert inside.tolist() == [True, False]
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)


def test_smooth_reading_converges_with_third_order():
    """Third order instead of second; on 112 quads 0.03 mm instead of 0.3 mm."""
    own, facets = [], []
    for elements in (128, 512, 2048):
        mesh = disk_mesh(100.0, elements)
        readings = SmoothReading.of(mesh).matrix(POINTS), sampling_matrix(mesh, POINTS)
        for (matrix, inside), errors in zip(readings, (own, facets), strict=True):
            left = matrix @ dome(mesh.points) - dome(POINTS[inside])
            errors.append(float(np.sqrt(np.mean(left**2))))
    assert facets[0] > 0.1 and own[0] < 0.03
    assert np.log2(np.divide(facets[:-1], facets[1:])) == pytest.approx([2.0, 2.0], abs=0.2)
    assert (np.log2(np.divide(own[:-1], own[1:])) > 2.7).all(), own


def test_smooth_reading_is_continuous_from_quad_to_quad():
    mesh = disk_mesh(100.0, 112)
    ends = mesh.points[mesh.quads[:, :2], :2]
    ends = ends[np.hypot(*ends.mean(axis=1).T) < 80]
    across = 1e-7 * (ends[:, 1] - ends[:, 0])[:, ::-1] * [1, -1]
    reading = SmoothReading.of(mesh)
    sides = [reading.matrix(ends.mean(axis=1) + s * across)[0] @ dome(mesh.points) for s in (1, -1)]
    np.testing.assert_allclose(*sides, atol=1e-4)
