"""Meshes of cylinders, and displacements read on facets."""

from itertools import pairwise

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.mesh import Mesh, sampling_matrix
from bubblefit.meshes.reading import Facet, FacetReading, SmoothReading
from bubblefit.meshes.tube import GROWTH, Refinement, cylinder_mesh, rows
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ..mesh_quality import edges, least_scaled_jacobian

LENGTH, DIAMETER, SEAM = 3000.0, 150.0, 40.0  # thesis, section 6.1
RADIUS = DIAMETER / 2
BENDING = (Refinement("collar", 0.0, 90.0, 12.0), Refinement("support", 1000.0, 40.0, 12.0))


def area_vectors(mesh: Mesh) -> np.ndarray:
    """Normal of each quad, as long as its area."""
    p = mesh.points[mesh.quads]
    return 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])


def areas(mesh: Mesh) -> np.ndarray:
    return np.linalg.norm(area_vectors(mesh), axis=1)


def enclosed(mesh: Mesh) -> float:
    """Volume: every quad is flat."""
    p = mesh.points[mesh.quads]
    first = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    second = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])
    return float(((p[:, 0] * (first + second)).sum()) / 6)


def circumradius(mesh: Mesh) -> float:
    """Of the nodes of the tube."""
    return float(np.hypot(*mesh.points[mesh.node_sets["mid_span"], :2].T).max())


def section(mesh: Mesh) -> float:
    """Area of the whole cross-section at mid-span, by the triangles between its sides and the axis.

    On a quarter twice that of the half.
    """
    x, y = mesh.points[mesh.node_sets["mid_span"], :2].T
    angle = np.sort(np.arctan2(x, -y))
    quarter = "symmetry_x" in mesh.node_sets
    turns = np.diff(angle) if quarter else np.diff(angle, append=angle[0] + 2 * np.pi)
    return float((2 if quarter else 1) * 0.5 * circumradius(mesh) ** 2 * np.sin(turns).sum())


def check_sound(mesh: Mesh, length: float, diameter: float, seam: float, symmetry: str) -> None:
    """Everything that any cylinder mesh must satisfy."""
    radius = diameter / 2
    p, sets = mesh.points, mesh.node_sets
    scale = np.array([radius, radius, length / 2])
    out = circumradius(mesh)
    # Of eight sides at least, the longest of them next to a wide seam.
    assert radius < out < 1.09 * radius
    assert len(np.unique(np.round(p / scale, 9), axis=0)) == len(p)  # nothing lies double
    assert set(mesh.quads.ravel()) == set(range(len(p)))
    assert (np.hypot(p[:, 0], p[:, 1]) <= out * (1 + 1e-9)).all()
    # Every cross-section and each cap has the area of the circle.
    assert section(mesh) == pytest.approx(np.pi * radius**2, rel=1e-12)
    flat = mesh.element_sets["caps"]
    caps = 2.0 if symmetry == "full" else 0.5
    assert areas(mesh)[flat].sum() == pytest.approx(caps * np.pi * radius**2, rel=1e-9)

    # Element sets share the mesh.
    names = ("body", "seam", "caps") if seam else ("body", "caps")
    assert set(mesh.element_sets) == set(names)
    members = np.concatenate([mesh.element_sets[n] for n in names])
    np.testing.assert_array_equal(np.sort(members), np.arange(len(mesh.quads)))
    for name in names:
        quads = mesh.quads[mesh.element_sets[name]]
        np.testing.assert_array_equal(sets[name], np.unique(quads))

    # Outward: radial on the tube, along the axis on the caps.
    normal, middle = area_vectors(mesh), p[mesh.quads].mean(axis=1)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    cap = np.isin(np.arange(len(mesh.quads)), mesh.element_sets["caps"])
    np.testing.assert_allclose(unit[cap, 2], np.sign(middle[cap, 2]), atol=1e-9)
    radial = middle[~cap, :2] / np.linalg.norm(middle[~cap, :2], axis=1)[:, None]
    np.testing.assert_allclose(unit[~cap, :2], radial, atol=1e-9)
    # The warp lies in the quad's plane.
    assert mesh.warp.shape == (len(mesh.quads), 3)
    np.testing.assert_allclose(np.einsum("mx,mx->m", mesh.warp, unit), 0, atol=1e-9)
    assert (mesh.warp[~cap] == [0, 0, 1]).all()

    # The seam is as wide as it should be, around the bottom.
    if seam:
        on_seam = p[sets["seam"]]
        half = radius * np.arctan2(np.abs(on_seam[:, 0]), -on_seam[:, 1])
        assert half.max() == pytest.approx(seam / 2, rel=1e-9)

    # Connection: closed, or open on the planes of symmetry alone.
    ends, owners = edges(mesh)
    euler = len(p) - len(ends) + len(mesh.quads)
    if symmetry == "full":
        assert set(owners) == {2}
        assert euler == 2  # a sphere
        assert "symmetry_x" not in sets
    else:
        assert set(owners) == {1, 2}
        assert euler == 1  # a disk
        assert (p[:, [0, 2]] >= 0).all()
        np.testing.assert_array_equal(sets["symmetry_x"], np.flatnonzero(p[:, 0] == 0))
        np.testing.assert_array_equal(sets["symmetry_z"], np.flatnonzero(p[:, 2] == 0))
        named = np.union1d(sets["symmetry_x"], sets["symmetry_z"])
        np.testing.assert_array_equal(np.unique(ends[owners == 1]), named)
        for a, b in ends[owners == 1]:  # the whole edge, not only its two nodes
            assert (p[[a, b], 0] == 0).all() or (p[[a, b], 2] == 0).all()

    # Lines and rows, from the coordinates.
    at_end = np.abs(p[:, 2]) == length / 2
    around = np.isclose(np.hypot(p[:, 0], p[:, 1]), out, rtol=1e-9)
    np.testing.assert_array_equal(sets["ends"], np.flatnonzero(at_end & around))
    np.testing.assert_array_equal(sets["mid_span"], np.flatnonzero(p[:, 2] == 0))
    middle_line = around & (p[:, 0] == 0)
    np.testing.assert_array_equal(sets["top_line"], np.flatnonzero(middle_line & (p[:, 1] > 0)))
    np.testing.assert_array_equal(sets["bottom_line"], np.flatnonzero(middle_line & (p[:, 1] < 0)))
    np.testing.assert_array_equal(sets["side_line"], np.flatnonzero(around & (p[:, 1] == 0)))
    centres = at_end & (p[:, :2] == 0).all(axis=1)
    np.testing.assert_array_equal(sets["cap_centres"], np.flatnonzero(centres))
    assert centres.sum() == (2 if symmetry == "full" else 1)
    assert least_scaled_jacobian(mesh)["all"] >= 0.62
    assert least_scaled_jacobian(mesh)["body"] >= 1 - 1e-9


@settings(deadline=None, max_examples=40)
@given(
    length=st.floats(50, 5000),
    diameter=st.floats(20, 500),
    fineness=st.floats(1, 12),
    wide=st.floats(0, 1),
    symmetry=st.sampled_from(["full", "quarter"]),
    around=st.floats(0.3, 1),
)
def test_any_size_gives_a_sound_well_shaped_mesh(
    length, diameter, fineness, wide, symmetry, around
):
    size = min(diameter, length) / 2 / fineness
    assume(length * diameter / size**2 / around < 5000)
    seam = 0.999 * wide * np.pi * diameter / 4
    assume(seam == 0 or seam >= around * size / 2)
    mesh = cylinder_mesh(length, diameter, size, seam, symmetry, around=around)
    check_sound(mesh, length, diameter, seam, symmetry)


@pytest.mark.parametrize(
    ("size", "around", "count"), [(30.0, 1.0, 16), (25.0, 0.5, 40), (25.0, 0.25, 72)]
)
def test_sides_around_the_tube_are_as_long_as_asked_for(size, around, count):
    """40, not 32, of half of 25 mm: 32 would be 17 % longer, 40 are 6 % shorter."""
    mesh = cylinder_mesh(LENGTH, DIAMETER, size, 0.0, "full", around=around)
    ring = mesh.points[mesh.node_sets["mid_span"], :2]
    ring = ring[np.argsort(np.arctan2(*ring.T))]
    assert len(ring) == count
    sides = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, np.pi * DIAMETER / count, rtol=0.02)
    assert mesh.quads[mesh.element_sets["body"]].size / 4 == count * (
        len(mesh.node_sets["top_line"]) - 1
    )


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_the_bending_mesh(symmetry):
    mesh = cylinder_mesh(LENGTH, DIAMETER, 20.0, SEAM, symmetry, BENDING)
    check_sound(mesh, LENGTH, DIAMETER, SEAM, symmetry)
    at = mesh.points[mesh.node_sets["support"]]
    assert set(at[:, 2]) == ({1000.0, -1000.0} if symmetry == "full" else {1000.0})
    np.testing.assert_allclose(np.hypot(at[:, 0], at[:, 1]), circumradius(mesh))
    bottom = mesh.points[mesh.node_sets["support_bottom"]]
    lowest = [0.0, mesh.points[:, 1].min()]
    np.testing.assert_array_equal(bottom[:, :2], np.tile(lowest, (len(bottom), 1)))
    np.testing.assert_array_equal(mesh.node_sets["collar"], mesh.node_sets["mid_span"])
    # Of the elements of the thesis' size, worst 0.86; three quads that meet can have 0.866.
    assert least_scaled_jacobian(mesh)["caps"] > 0.85


def test_the_volume_is_that_of_the_cylinder_and_the_area_converges_with_second_order():
    area = np.pi * DIAMETER * 400 + 2 * np.pi * RADIUS**2
    volume = np.pi * RADIUS**2 * 400
    gaps, around = [], []
    for n in (2, 4, 8, 16):
        mesh = cylinder_mesh(400.0, DIAMETER, np.pi * RADIUS / (4 * n), SEAM, "full")
        around.append(len(mesh.node_sets["mid_span"]))
        gaps.append(areas(mesh).sum() / area - 1)
        assert enclosed(mesh) == pytest.approx(volume, rel=1e-12)
    assert around == [16, 32, 64, 128]
    # A polygon of the circle's area has the longer way around.
    orders = -np.diff(np.log(gaps)) / np.log(2)
    np.testing.assert_allclose(orders[1:], 2.0, atol=0.12)
    assert gaps[-1] < 2e-4
    # Without a seam the rows are even: the prism over a regular polygon, exactly.
    mesh = cylinder_mesh(400.0, DIAMETER, 20.0, 0.0, "full")
    n = len(mesh.node_sets["mid_span"])
    base = np.pi * RADIUS**2
    out = np.sqrt(2 * np.pi / (n * np.sin(2 * np.pi / n))) * RADIUS
    assert circumradius(mesh) == pytest.approx(out, rel=1e-12)
    assert enclosed(mesh) == pytest.approx(400 * base, rel=1e-12)
    sides = 2 * n * out * np.sin(np.pi / n) * 400
    assert areas(mesh).sum() == pytest.approx(2 * base + sides, rel=1e-12)


def test_a_quarter_is_a_quarter_of_the_whole():
    quarter = cylinder_mesh(LENGTH, DIAMETER, 30.0, SEAM, "quarter", BENDING)
    full = cylinder_mesh(LENGTH, DIAMETER, 30.0, SEAM, "full", BENDING)
    mirrored = {tuple(p * (sx, 1, sz)) for p in quarter.points for sx in (1, -1) for sz in (1, -1)}
    assert {tuple(p) for p in full.points} == mirrored
    assert len(full.quads) == 4 * len(quarter.quads)
    assert areas(full).sum() == pytest.approx(4 * areas(quarter).sum(), rel=1e-12)
    assert enclosed(full) == pytest.approx(4 * enclosed(quarter), rel=1e-12)
    for name, numbers in quarter.element_sets.items():
        assert len(full.element_sets[name]) == 4 * len(numbers)
    for name, numbers in full.node_sets.items():
        at = full.points[numbers]
        folded = {tuple(p) for p in np.abs(at) * [1, 0, 1] + at * [0, 1, 0]}
        assert folded == {tuple(p) for p in quarter.points[quarter.node_sets[name]]}


def test_the_caps_can_be_turned():
    for axis, direction in (("x", [1, 0, 0]), ("y", [0, 1, 0])):
        mesh = cylinder_mesh(600.0, DIAMETER, 30.0, SEAM, "full", cap_warp=axis)
        found = mesh.warp[mesh.element_sets["caps"]]
        assert (found == direction).all()


@settings(deadline=None, max_examples=60)
@given(
    end=st.floats(500, 3000),
    size=st.floats(10, 80),
    places=st.lists(st.floats(0.05, 0.9), max_size=3),
    finer=st.floats(0.1, 1),
)
def test_rows_are_graded(end, size, places, finer):
    fine = [Refinement(f"r{i}", end * f, 20.0, size * finer) for i, f in enumerate(places)]
    try:
        z = rows(end, size, fine)
    except InputError as error:
        assert error.field.endswith("position")  # two of them too near to each other
        return
    assert z[0] == 0 and z[-1] == end
    steps = np.diff(z)
    assert (steps > 0).all()
    assert {r.position for r in fine} <= set(z)
    middles = 0.5 * (z[1:] + z[:-1])
    wanted = np.min(
        [np.full(len(middles), size)]
        + [r.size + GROWTH * np.maximum(abs(middles - r.position) - r.reach, 0) for r in fine],
        axis=0,
    )
    # A whole number of rows must fit between two places: 1.5 of them become 1 or 2.
    assert (steps <= 1.6 * wanted).all()
    inner = [
        np.diff(z[(z >= a) & (z <= b)])
        for a, b in pairwise(sorted({0.0, end, *(r.position for r in fine)}))
    ]
    assert all((s[1:] < 1.6 * s[:-1]).all() and (s[:-1] < 1.6 * s[1:]).all() for s in inner)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        *(({key: value}, key) for key, values in {
            "length": [0.0, float("nan"), "3000"], "diameter": [-1.0, True],
            "size": [0.0, 76.0, 0.01], "seam_width": [-1.0, 200.0, 5.0], "symmetry": ["half"],
            "cap_warp": ["z"], "around": [0.0, 1.5],
        }.items() for value in values),
        ({"seam_width": 7.0, "around": 0.5}, "seam_width"),
        *(({"refinements": [Refinement("support", at, 40.0, 10.0)]}, "refinements.support.position")
          for at in (1600.0, 1498.0)),
        ({"refinements": [Refinement("caps", 1000.0, 40.0, 10.0)]}, "refinements"),
        ({"refinements": [BENDING[0], Refinement("collar", 500.0, 40.0, 10.0)]}, "refinements"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_by_name(change, field):
    values = {"length": LENGTH, "diameter": DIAMETER, "size": 30.0, "seam_width": SEAM} | change
    with pytest.raises(InputError) as caught:
        cylinder_mesh(**values)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change", [{"name": "no name"}, {"position": -1.0}, {"reach": float("inf")}, {"size": 0.0}]
)
def test_refinements_are_checked(change):
    with pytest.raises(InputError, match="expected"):
        Refinement(**({"name": "support", "position": 1.0, "reach": 1.0, "size": 1.0} | change))


FINE = SmoothReading.of(disk_mesh(100.0, 3072, "full"))
#: Of a wave of 50 mm, and where it is looked at.
WAVE = 2 * np.pi / 50.0
PLACES = np.array([[11.0, -7.0], [-20.0, 30.0], [3.0, 44.0]])


def wave(points: np.ndarray) -> np.ndarray:
    return np.cos(WAVE * points[:, 0] + 0.3)


def quadratic(points: np.ndarray) -> np.ndarray:
    x, y = points[:, :2].T
    return 3.0 + 0.2 * x - 0.1 * y + 0.01 * x**2 - 0.02 * x * y + 0.03 * y**2


def check(facet: Facet, share: float) -> None:
    """What a facet leaves of the wave, of height one."""
    matrix, inside = FacetReading(FINE, facet).matrix(PLACES)
    assert inside.all()
    np.testing.assert_allclose(matrix @ wave(FINE.mesh.points), share * wave(PLACES), atol=1e-3)


@pytest.mark.parametrize("size", [5.0, 20.0, 35.0])
def test_a_facet_of_the_first_order_leaves_a_mean(size):
    """sin(k f / 2) / (k f / 2) of a wave; 0.76 of one of 50 mm by a facet of 20."""
    check(Facet(size), float(np.sinc(size / 50.0)))


def test_smoothing_leaves_less():
    """Of five points 6 mm apart sin(5 k s / 2) / (5 sin(k s / 2)) more is left."""
    half = 0.5 * WAVE * 6.0
    expected = np.sinc(20.0 / 50.0) * np.sin(5 * half) / (5 * np.sin(half))
    assert expected < 0.5
    check(Facet(20.0, window=5, step=6.0), expected)


def test_a_facet_of_the_second_order_keeps_a_parabola_and_more_of_a_wave():
    """Of the square, in a = k f / 2: 5/2 terms of Legendre's second polynomial are added."""
    a = 0.5 * WAVE * 35.0
    mean = np.sin(a) / a
    second = mean + 3 * np.cos(a) / a**2 - 3 * np.sin(a) / a**3  # the mean of P2 times the wave
    expected = mean - 2.5 * second
    check(Facet(35.0, order=2), expected)
    parabola, kept = quadratic(FINE.mesh.points), quadratic(PLACES)
    second_order = FacetReading(FINE, Facet(35.0, order=2)).matrix(PLACES)[0] @ parabola
    np.testing.assert_allclose(second_order, kept, rtol=1e-9)
    # Of the first order f^2/24 of each curvature is added.
    first_order = FacetReading(FINE, Facet(35.0)).matrix(PLACES)[0] @ parabola
    np.testing.assert_allclose(first_order - kept, 35.0**2 / 24 * (0.02 + 0.06), rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_facet_over_the_edge_sees_what_is_there(order):
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
    ("given", "said"),
    [
        ({"size": 0.0}, "facet: expected more than 0 mm"),
        ({"size": 1.0, "order": 3}, "order: expected 1 or 2"),
        ({"size": 1.0, "window": 4, "step": 1.0}, "smoothing: expected 1, 3, 5"),
        ({"size": 1.0, "window": 3}, "step: this key is missing"),
    ],
)
def test_what_is_no_facet(given, said):
    with pytest.raises(InputError, match=said):
        Facet(**given)


POINTS = np.random.default_rng(5).uniform(-100, 100, (900, 2))


def dome(points: np.ndarray) -> np.ndarray:
    """Not a polynomial, neither symmetric nor zero at the rim, mm."""
    x, y = points[:, :2].T / 100.0
    return 30.0 * np.cos(1.2 * x + 0.3) * np.cos(1.0 * y - 0.2)


@pytest.mark.parametrize(
    "mesh",
    [
        disk_mesh(100.0, 48, "quarter"),
        disk_mesh(100.0, 112),
        elliptic_disk_mesh(Outline(120.0, 30.0, 40.0), 112),
    ],
    ids=["quarter", "full", "slender"],
)
def test_nodes_are_kept_and_quadratics_are_exact(mesh):
    reading = SmoothReading.of(mesh)
    matrix, inside = reading.matrix(mesh.points[:, :2])
    assert inside.all()
    np.testing.assert_allclose(matrix.toarray(), np.eye(len(mesh.points)), atol=1e-9)
    matrix, inside = reading.matrix(POINTS)
    np.testing.assert_array_equal(inside, sampling_matrix(mesh, POINTS)[1])
    read = matrix @ quadratic(mesh.points)
    np.testing.assert_allclose(read, quadratic(POINTS[inside]), rtol=1e-8)


def test_what_is_read_converges_faster_than_facets_do():
    """Third order instead of second; on 112 quads 0.03 mm instead of 0.3 mm."""
    own, facets = [], []
    for elements in (128, 512, 2048):
        mesh = disk_mesh(100.0, elements)
        for read, errors in ((SmoothReading.of(mesh).matrix, own), (None, facets)):
            matrix, inside = read(POINTS) if read else sampling_matrix(mesh, POINTS)
            left = matrix @ dome(mesh.points) - dome(POINTS[inside])
            errors.append(float(np.sqrt(np.mean(left**2))))
    assert facets[0] > 0.1 and own[0] < 0.03 * 1.0
    assert np.log2(np.divide(facets[:-1], facets[1:])) == pytest.approx([2.0, 2.0], abs=0.2)
    assert (np.log2(np.divide(own[:-1], own[1:])) > 2.7).all(), own


def test_the_reading_is_continuous_from_quad_to_quad():
    mesh = disk_mesh(100.0, 112)
    values = dome(mesh.points)
    ends = mesh.points[mesh.quads[:, :2], :2]
    middle = ends.mean(axis=1)
    across = np.stack([ends[:, 1, 1] - ends[:, 0, 1], ends[:, 0, 0] - ends[:, 1, 0]], axis=1)
    across = across[np.hypot(*middle.T) < 80] * 1e-7
    middle = middle[np.hypot(*middle.T) < 80]
    reading = SmoothReading.of(mesh)
    sides = [reading.matrix(middle + s * across)[0] @ values for s in (1, -1)]
    np.testing.assert_allclose(*sides, atol=1e-4)


def test_few_nodes_are_enough():
    mesh = disk_mesh(100.0, 8, "quarter")
    matrix, inside = SmoothReading.of(mesh).matrix(np.array([[30.0, 30.0], [200.0, 0.0]]))
    assert inside.tolist() == [True, False]
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
