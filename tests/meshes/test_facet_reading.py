"""A camera's facet: how much of a wave it leaves, what it keeps, and where it meets the edge."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.reading import Facet, FacetReading, SmoothReading

FINE = SmoothReading.of(disk_mesh(100.0, 3072, "full"))
#: Of a wave of 50 mm, and where it is looked at.
WAVE = 2 * np.pi / 50.0
PLACES = np.array([[11.0, -7.0], [-20.0, 30.0], [3.0, 44.0]])


def wave(points: np.ndarray) -> np.ndarray:
    return np.cos(WAVE * points[:, 0] + 0.3)


def check(facet: Facet, share: float) -> None:
    """What a facet leaves of the wave, of height one."""
    matrix, inside = FacetReading(FINE, facet).matrix(PLACES)
    assert inside.all()
    np.testing.assert_allclose(matrix @ wave(FINE.mesh.points), share * wave(PLACES), atol=1e-3)


@pytest.mark.parametrize("size", [5.0, 20.0, 35.0])
def test_a_facet_of_the_first_order_leaves_a_mean(size: float) -> None:
    """sin(k f / 2) / (k f / 2) of a wave; 0.76 of one of 50 mm by a facet of 20."""
    check(Facet(size), float(np.sinc(size / 50.0)))


def test_smoothing_leaves_less() -> None:
    """Of five points 6 mm apart sin(5 k s / 2) / (5 sin(k s / 2)) more is left."""
    half = 0.5 * WAVE * 6.0
    expected = np.sinc(20.0 / 50.0) * np.sin(5 * half) / (5 * np.sin(half))
    assert expected < 0.5
    check(Facet(20.0, window=5, step=6.0), expected)


def test_a_facet_of_the_second_order_keeps_a_parabola_and_more_of_a_wave() -> None:
    """Of the square, in a = k f / 2: 5/2 terms of Legendre's second polynomial are added."""
    a = 0.5 * WAVE * 35.0
    mean = np.sin(a) / a
    second = mean + 3 * np.cos(a) / a**2 - 3 * np.sin(a) / a**3  # the mean of P2 times the wave
    expected = mean - 2.5 * second
    check(Facet(35.0, order=2), expected)
    x, y = FINE.mesh.points[:, :2].T
    parabola = 3.0 + 0.1 * x - 0.2 * y + 0.01 * x * x - 0.02 * x * y + 0.03 * y * y
    px, py = PLACES.T
    kept = 3.0 + 0.1 * px - 0.2 * py + 0.01 * px * px - 0.02 * px * py + 0.03 * py * py
    second_order = FacetReading(FINE, Facet(35.0, order=2)).matrix(PLACES)[0] @ parabola
    np.testing.assert_allclose(second_order, kept, rtol=1e-9)
    # Of the first order f^2/24 of each curvature is added.
    first_order = FacetReading(FINE, Facet(35.0)).matrix(PLACES)[0] @ parabola
    np.testing.assert_allclose(first_order - kept, 35.0**2 / 24 * (0.02 + 0.06), rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_facet_over_the_edge_sees_what_is_there(order: int) -> None:
    """Nothing is invented beyond the rim: a plane is kept, also by a third of a facet."""
    places = np.array([[97.0, 0.0], [0.0, -99.0], [70.0, 70.0], [99.5, 2.0]])
    matrix, inside = FacetReading(FINE, Facet(20.0, order)).matrix(places)
    assert inside.all()
    x, y = FINE.mesh.points[:, :2].T
    np.testing.assert_allclose(
        matrix @ (1.0 + 0.5 * x - 0.3 * y), 1.0 + places @ [0.5, -0.3], rtol=1e-9
    )
    outside = FacetReading(FINE, Facet(20.0)).matrix(np.array([[0.0, 0.0], [105.0, 0.0]]))
    assert outside[0].shape[0] == 1 and outside[1].tolist() == [True, False]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"size": 0.0}, "facet: expected more than 0 mm"),
        ({"size": 1.0, "order": 3}, "order: expected 1 or 2"),
        ({"size": 1.0, "window": 4, "step": 1.0}, "smoothing: expected 1, 3, 5"),
        ({"size": 1.0, "window": 3}, "step: this key is missing"),
    ],
)
def test_what_is_no_facet(given: dict, said: str) -> None:
    with pytest.raises(InputError, match=said):
        Facet(**given)
