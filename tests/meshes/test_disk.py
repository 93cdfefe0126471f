"""meshes/disk.py: meshes of round and elliptic disks."""

import builtins
import subprocess
import sys

import numpy as np
import pytest
from bubblefit.errors import BubblefitError
from bubblefit.meshes.disk import (
    Outline,
    disk_mesh,
    divisions,
    elliptic_disk_mesh,
    rim_form,
    rim_share,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support import needs
from ..support.refusals import raised, refused
from .mesh_checks import edges, scaled_jacobian

RADIUS, TURNED = 100.0, Outline(120.0, 80.0, 30.0)
WELL_SHAPED = np.sin(np.deg2rad(120))  # three quads meet in a node of each quarter


def areas(mesh):
    p = mesh.points[mesh.quads]
    return 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])[:, 2]


def check_sound(mesh, symmetry, radius=RADIUS):
    p, sets = mesh.points, mesh.node_sets
    assert (areas(mesh) > 0).all()
    assert (p[:, 2] == 0).all()
    assert set(mesh.quads.ravel()) == set(range(len(p)))
    assert len(np.unique(np.round(p / radius, 9), axis=0)) == len(p)
    ends, owners = edges(mesh)
    assert set(owners) <= {1, 2}
    assert len(p) - len(ends) + len(mesh.quads) == 1
    at_rim = np.isclose(np.hypot(*p[:, :2].T), radius, rtol=1e-12)
    np.testing.assert_array_equal(sets["rim"], np.flatnonzero(at_rim))
    assert sets["apex"].shape == (1,) and (p[sets["apex"]] == 0).all()
    lines = [] if symmetry == "full" else ["symmetry_x", "symmetry_y"]
    assert set(sets) == {"rim", "apex", *lines}
    assert symmetry == "full" or (p >= 0).all()
    for axis, name in enumerate(lines):
        np.testing.assert_array_equal(sets[name], np.flatnonzero(p[:, axis] == 0))
    named = np.concatenate([sets["rim"], *(sets[name] for name in lines)])
    np.testing.assert_array_equal(np.unique(ends[owners == 1]), np.unique(named))


@settings(deadline=None, max_examples=60)
@given(
    elements=st.integers(8, 3000),
    symmetry=st.sampled_from(["full", "quarter"]),
    radius=st.floats(1e-3, 1e5),
)
def test_disk_mesh_of_any_count_is_sound_and_well_shaped(elements, symmetry, radius):
    mesh = disk_mesh(radius, elements, symmetry)
    check_sound(mesh, symmetry, radius)
    assert scaled_jacobian(mesh).min() >= WELL_SHAPED - 1e-6
    assert areas(mesh).max() < 3.5 * areas(mesh).min()
    full = len(mesh.quads) * (4 if symmetry == "quarter" else 1)
    # Few quads leave few choices: 3, 8, 12, 15, 21, 27 ... a quarter.
    assert abs(full - elements) <= max(16, 0.07 * elements)


def test_area_of_a_disk_mesh_converges_with_second_order():
    wanted = np.pi * RADIUS**2
    counts = [8 * n**2 for n in (4, 10, 20, 40)]  # alike: n / 2 layers around a core of n
    assert [divisions(c / 4) for c in counts] == [(n, n // 2) for n in (4, 10, 20, 40)]
    gaps = [1 - areas(disk_mesh(RADIUS, n)).sum() / wanted for n in counts]
    assert gaps[1] < 1.1e-3
    order = 2 * np.diff(np.log(gaps)) / -np.diff(np.log(counts))
    np.testing.assert_allclose(order, 2.0, atol=0.05)
    mesh = disk_mesh(RADIUS, 800)
    n = len(mesh.node_sets["rim"])
    assert areas(mesh).sum() == pytest.approx(n / 2 * np.sin(2 * np.pi / n) * RADIUS**2, rel=1e-12)


def test_full_disk_is_the_mirrored_quarter():
    quarter, full = disk_mesh(RADIUS, 800, "quarter"), disk_mesh(RADIUS, 800, "full")
    assert (len(quarter.quads), len(full.quads), divisions(200)) == (200, 800, (10, 5))
    mirrored = {tuple(p * (sx, sy, 1)) for p in quarter.points for sx in (1, -1) for sy in (1, -1)}
    assert {tuple(p) for p in full.points} == mirrored


NONSENSE = [
    *((disk_mesh, {"elements": value}, "elements") for value in (7, 0, -800, 10**12)),
    (elliptic_disk_mesh, {"outline": TURNED, "symmetry": "quarter"}, "symmetry"),
    *((elliptic_disk_mesh, {"outline": Outline(*axes)}, "minor")
      for axes in ((80.0, 120.0), (120.0, -80.0), (120.0, 29.0))),
]  # fmt: skip


@pytest.mark.parametrize(("mesh", "values", "field"), NONSENSE)
def test_bad_disk_names_its_field(mesh, values, field):
    good = {"radius": RADIUS} if mesh is disk_mesh else {}
    assert refused(mesh, **good | {"elements": 800} | values).field == field


def test_gmsh_mesh_is_sound():
    gmsh = needs.library("gmsh")
    for symmetry in ("full", "quarter"):
        mesh = disk_mesh(RADIUS, 800, symmetry, "gmsh")
        check_sound(mesh, symmetry)
        assert scaled_jacobian(mesh).min() > 0.5
        assert len(mesh.quads) == pytest.approx(800 / (4 if symmetry == "quarter" else 1), rel=0.1)
    assert not gmsh.isInitialized()


def test_closed_pipe_is_an_error_after_gmsh_not_the_end():
    needs.library("gmsh")
    script = (
        "import os; from bubblefit.meshes.disk import disk_mesh\n"
        'disk_mesh(100.0, 48, "quarter", "gmsh")\n'
        "read, write = os.pipe(); os.close(read)\n"
        "try:\n    os.write(write, b'x')\nexcept BrokenPipeError:\n    print('goes on')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "goes on\n")


@pytest.mark.parametrize(
    "failure",
    [ImportError("No module named 'gmsh'"), OSError("libGLU.so.1: cannot open shared object file")],
)
def test_missing_gmsh_is_refused_with_advice(monkeypatch, failure):
    plain = builtins.__import__

    def no_gmsh(name, *arguments, **options):
        if name == "gmsh":
            raise failure
        return plain(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", no_gmsh)
    caught = raised(BubblefitError, "", disk_mesh, RADIUS, 800, "quarter", "gmsh")
    for words in (str(failure), "pip install gmsh", "libglu1-mesa", 'generator = "blocks"'):
        assert words in str(caught)
    assert len(disk_mesh(RADIUS, 800, "quarter").quads) == 200


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_elliptic_disk_of_equal_semi_axes_is_the_disk(symmetry):
    own = elliptic_disk_mesh(Outline(90.0, 90.0, 20.0), 192, symmetry)
    disk = disk_mesh(90.0, 192, symmetry)
    np.testing.assert_array_equal(own.points, disk.points)
    np.testing.assert_array_equal(own.quads, disk.quads)
    slender = elliptic_disk_mesh(Outline(120.0, 80.0, 90.0), 192, symmetry)
    np.testing.assert_allclose(slender.points.max(axis=0), (80.0, 120.0, 0.0))
    for axis, name in enumerate(("symmetry_x", "symmetry_y") if symmetry == "quarter" else ()):
        assert (slender.points[slender.node_sets[name], axis] == 0).all()


def test_elliptic_disk_has_its_rim_and_an_area_of_second_order():
    counts = [128, 512, 2048]
    meshes = [elliptic_disk_mesh(TURNED, n) for n in counts]
    gaps = [1 - areas(mesh).sum() / (np.pi * 120.0 * 80.0) for mesh in meshes]
    assert gaps[-1] < 2e-3
    assert np.log2(np.divide(gaps[:-1], gaps[1:])) == pytest.approx([2.0, 2.0], abs=0.1)
    mesh = meshes[1]
    assert (areas(mesh) > 0).all() and scaled_jacobian(mesh).min() > 0.4
    assert (mesh.points[mesh.node_sets["apex"]] == 0).all()
    share = TURNED.share(mesh.points[:, :2])
    np.testing.assert_array_equal(mesh.node_sets["rim"], np.flatnonzero(share > 1 - 1e-9))
    form = rim_form(mesh.points[mesh.node_sets["rim"], :2])
    np.testing.assert_allclose(rim_share(form, mesh.points[:, :2]), share, atol=1e-12)


@settings(max_examples=20)
@given(major=st.floats(1.0, 500.0), ratio=st.floats(0.25, 1.0), angle=st.floats(-90, 90))
def test_places_map_to_the_unit_disk_and_back(major, ratio, angle):
    outline = Outline(major, major * ratio, angle)
    points = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    np.testing.assert_allclose(outline.unit(outline.places(points)), points, atol=1e-12)
    np.testing.assert_allclose(outline.share(outline.places(points)), np.hypot(*points.T))
    np.testing.assert_allclose(outline.share(outline.edge(9)), 1.0)


def test_major_axis_lies_at_its_angle_from_the_warp():
    outline = Outline(120.0, 80.0, 30.0)
    along = np.array([np.cos(np.pi / 6), 0.5])
    ends = np.array([120.0 * along, 80.0 * np.array([-along[1], along[0]])])
    np.testing.assert_allclose(outline.share(ends), 1.0)
    assert (np.hypot(*outline.edge(721).T).max(), outline.radius) == pytest.approx((120.0, 100.0))
    assert not outline.round and not outline.doubly_symmetric
    assert Outline(120.0, 80.0, -90.0).doubly_symmetric
    assert outline.words == "semi-axes 120 and 80 mm"
    points = np.random.default_rng(2).uniform(-1, 1, (20, 2))
    for outline in (Outline.circle(80.0), Outline(80.0, 80.0, 33.0)):
        np.testing.assert_array_equal(outline.places(points), 80.0 * points)
        np.testing.assert_array_equal(outline.unit(points), points / 80.0)
        assert outline.round and outline.doubly_symmetric and outline.words == "radius 80 mm"
