"""meshes/facets.py: what facets of image correlation see of a displacement."""

import numpy as np
import pytest
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.facets import Facet, FacetReading
from bubblefit.meshes.sampling import SmoothReading

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
