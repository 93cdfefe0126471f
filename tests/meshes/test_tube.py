"""meshes/tube.py: meshes of capped cylinders."""

from itertools import pairwise

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.tube import GROWTH, RefinedZone, cylinder_mesh, rows
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ..support.refusals import refused
from .mesh_checks import edges, least_scaled_jacobian

LENGTH, DIAMETER, SEAM = 3000.0, 150.0, 40.0  # thesis, section 6.1
RADIUS = DIAMETER / 2
BENDING = (RefinedZone("collar", 0.0, 90.0, 12.0), RefinedZone("support", 1000.0, 40.0, 12.0))


def area_vectors(mesh):
    p = mesh.points[mesh.quads]
    return 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])


def areas(mesh):
    return np.linalg.norm(area_vectors(mesh), axis=1)


def enclosed(mesh):
    return float((mesh.points[mesh.quads[:, 0]] * area_vectors(mesh)).sum() / 3)


def circumradius(mesh):
    return float(np.hypot(*mesh.points[mesh.node_sets["mid_span"], :2].T).max())


def section(mesh):
    x, y = mesh.points[mesh.node_sets["mid_span"], :2].T
    angle = np.sort(np.arctan2(x, -y))
    quarter = "symmetry_x" in mesh.node_sets
    turns = np.diff(angle) if quarter else np.diff(angle, append=angle[0] + 2 * np.pi)
    return float((2 if quarter else 1) * 0.5 * circumradius(mesh) ** 2 * np.sin(turns).sum())


def check_sound(mesh, length, diameter, seam, symmetry):
    radius = diameter / 2
    p, sets, count = mesh.points, mesh.node_sets, len(mesh.quads)
    out = circumradius(mesh)
    # Of eight sides at least, the longest of them next to a wide seam.
    assert radius < out < 1.09 * radius
    scale = np.array([radius, radius, length / 2])
    assert len(np.unique(np.round(p / scale, 9), axis=0)) == len(p)  # nothing lies double
    assert set(mesh.quads.ravel()) == set(range(len(p)))
    assert (np.hypot(p[:, 0], p[:, 1]) <= out * (1 + 1e-9)).all()
    assert section(mesh) == pytest.approx(np.pi * radius**2, rel=1e-12)
    flat = mesh.element_sets["caps"]
    caps = 2.0 if symmetry == "full" else 0.5
    assert areas(mesh)[flat].sum() == pytest.approx(caps * np.pi * radius**2, rel=1e-9)

    names = ("body", "seam", "caps") if seam else ("body", "caps")
    assert set(mesh.element_sets) == set(names)
    members = np.concatenate([mesh.element_sets[n] for n in names])
    np.testing.assert_array_equal(np.sort(members), np.arange(count))
    for name in names:
        np.testing.assert_array_equal(sets[name], np.unique(mesh.quads[mesh.element_sets[name]]))

    # Outward: radial on the tube, along the axis on the caps. The warp lies in the quad's plane.
    normal, middle = area_vectors(mesh), p[mesh.quads].mean(axis=1)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    cap = np.isin(np.arange(count), flat)
    np.testing.assert_allclose(unit[cap, 2], np.sign(middle[cap, 2]), atol=1e-9)
    radial = middle[~cap, :2] / np.linalg.norm(middle[~cap, :2], axis=1)[:, None]
    np.testing.assert_allclose(unit[~cap, :2], radial, atol=1e-9)
    np.testing.assert_allclose(np.einsum("mx,mx->m", mesh.warp, unit), np.zeros(count), atol=1e-9)
    assert (mesh.warp[~cap] == [0, 0, 1]).all()

    if seam:  # as wide as it should be, around the bottom
        on_seam = p[sets["seam"]]
        half = radius * np.arctan2(np.abs(on_seam[:, 0]), -on_seam[:, 1])
        assert half.max() == pytest.approx(seam / 2, rel=1e-9)

    # Connection: closed, or open on the planes of symmetry alone.
    ends, owners = edges(mesh)
    euler = len(p) - len(ends) + count
    if symmetry == "full":
        assert set(owners) == {2} and euler == 2  # a sphere
        assert "symmetry_x" not in sets
    else:
        assert set(owners) == {1, 2} and euler == 1  # a disk
        assert (p[:, [0, 2]] >= 0).all()
        np.testing.assert_array_equal(sets["symmetry_x"], np.flatnonzero(p[:, 0] == 0))
        np.testing.assert_array_equal(sets["symmetry_z"], np.flatnonzero(p[:, 2] == 0))
        named = np.union1d(sets["symmetry_x"], sets["symmetry_z"])
        on_edge = ends[owners == 1]
        np.testing.assert_array_equal(np.unique(on_edge), named)
        assert (p[on_edge][..., [0, 2]] == 0).all(axis=1).any(axis=1).all()

    (x, y, z), at_end = p.T, np.abs(p[:, 2]) == length / 2
    around = np.isclose(np.hypot(x, y), out, rtol=1e-9)
    for name, inside in {
        "ends": at_end & around, "mid_span": z == 0, "top_line": around & (x == 0) & (y > 0),
        "bottom_line": around & (x == 0) & (y < 0), "side_line": around & (y == 0),
        "cap_centres": at_end & (x == 0) & (y == 0),
    }.items():  # fmt: skip
        np.testing.assert_array_equal(sets[name], np.flatnonzero(inside), err_msg=name)
    assert len(sets["cap_centres"]) == (2 if symmetry == "full" else 1)
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
def test_cylinder_mesh_of_any_size_is_sound_and_well_shaped(
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
def test_sides_around_the_tube_have_the_requested_length(size, around, count):
    """40, not 32, of half of 25 mm: 32 would be 17 % longer, 40 are 6 % shorter."""
    mesh = cylinder_mesh(LENGTH, DIAMETER, size, 0.0, "full", around=around, cap_warp="y")
    ring = mesh.points[mesh.node_sets["mid_span"], :2]
    ring = ring[np.argsort(np.arctan2(*ring.T))]
    assert len(ring) == count
    sides = np.linalg.norm(ring - np.roll(ring, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, np.pi * DIAMETER / count, rtol=0.02)
    rows_along = len(mesh.node_sets["top_line"]) - 1
    assert len(mesh.element_sets["body"]) == count * rows_along
    assert (mesh.warp[mesh.element_sets["caps"]] == [0, 1, 0]).all()


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_cylinder_mesh_for_bending_is_sound_and_graded(symmetry):
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


def test_cylinder_mesh_has_exact_volume_and_area_of_second_order():
    base = np.pi * RADIUS**2
    area, gaps = np.pi * DIAMETER * 400 + 2 * base, []
    for n in (2, 4, 8, 16):
        mesh = cylinder_mesh(400.0, DIAMETER, np.pi * RADIUS / (4 * n), SEAM, "full")
        assert len(mesh.node_sets["mid_span"]) == 8 * n
        gaps.append(areas(mesh).sum() / area - 1)
        assert enclosed(mesh) == pytest.approx(base * 400, rel=1e-12)
    # A polygon of the circle's area has the longer way around.
    np.testing.assert_allclose(-np.diff(np.log2(gaps))[1:], 2.0, atol=0.12)
    assert gaps[-1] < 2e-4
    # Without a seam the rows are even: the prism over a regular polygon, exactly.
    mesh = cylinder_mesh(400.0, DIAMETER, 20.0, 0.0, "full")
    n = len(mesh.node_sets["mid_span"])
    out = np.sqrt(2 * np.pi / (n * np.sin(2 * np.pi / n))) * RADIUS
    assert circumradius(mesh) == pytest.approx(out, rel=1e-12)
    sides = 2 * n * out * np.sin(np.pi / n) * 400
    assert areas(mesh).sum() == pytest.approx(2 * base + sides, rel=1e-12)


def test_quarter_of_a_cylinder_is_a_quarter_of_the_whole():
    quarter, full = (
        cylinder_mesh(LENGTH, DIAMETER, 30.0, SEAM, symmetry, BENDING)
        for symmetry in ("quarter", "full")
    )
    mirrored = {tuple(p * (sx, 1, sz)) for p in quarter.points for sx in (1, -1) for sz in (1, -1)}
    assert {tuple(p) for p in full.points} == mirrored
    assert len(full.quads) == 4 * len(quarter.quads)
    assert areas(full).sum() == pytest.approx(4 * areas(quarter).sum(), rel=1e-12)
    for name, numbers in quarter.element_sets.items():
        assert len(full.element_sets[name]) == 4 * len(numbers)
    for name, numbers in full.node_sets.items():
        folded = {(abs(x), y, abs(z)) for x, y, z in full.points[numbers]}
        assert folded == {tuple(p) for p in quarter.points[quarter.node_sets[name]]}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        *(({key: value}, key) for key, values in {
            "size": [76.0, 0.01], "seam_width": [200.0, 5.0],
        }.items() for value in values),
        ({"seam_width": 7.0, "around": 0.5}, "seam_width"),
        ({"refinements": [RefinedZone("support", 1498.0, 40.0, 10.0)]},
         "refinements.support.position"),
    ],
)  # fmt: skip
def test_bad_sizes_of_a_cylinder_name_their_field(change, field):
    values = {"length": LENGTH, "diameter": DIAMETER, "size": 30.0, "seam_width": SEAM} | change
    assert refused(cylinder_mesh, **values).field == field


@settings(deadline=None, max_examples=60)
@given(
    end=st.floats(500, 3000),
    size=st.floats(10, 80),
    places=st.lists(st.floats(0.05, 0.9), max_size=3),
    finer=st.floats(0.1, 1),
)
def test_tube_rows_are_graded(end, size, places, finer):
    fine = [RefinedZone(f"r{i}", end * f, 20.0, size * finer) for i, f in enumerate(places)]
    try:
        z = rows(end, size, fine)
    except InputError as error:
        assert error.field.endswith("position")  # two of them too near to each other
        return
    assert z[0] == 0 and z[-1] == end
    steps, middles = np.diff(z), 0.5 * (z[1:] + z[:-1])
    assert (steps > 0).all()
    assert {r.position for r in fine} <= set(z)
    wanted = np.full(len(middles), size)
    for r in fine:
        away = np.maximum(abs(middles - r.position) - r.reach, 0)
        wanted = np.minimum(wanted, r.size + GROWTH * away)
    # A whole number of rows must fit between two places: 1.5 of them become 1 or 2.
    assert (steps <= 1.6 * wanted).all()
    for a, b in pairwise(sorted({0.0, end, *(r.position for r in fine)})):
        assert (np.abs(np.diff(np.log(np.diff(z[(z >= a) & (z <= b)])))) < np.log(1.6)).all()
