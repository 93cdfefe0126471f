"""Meshes of a sheet with an elliptic edge."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh, rim_form, rim_share

from ..mesh_quality import scaled_jacobian
from .test_meshes import areas

TURNED = Outline(120.0, 80.0, 30.0)


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_equal_semi_axes_give_the_disk(symmetry) -> None:
    own, disk = (
        elliptic_disk_mesh(Outline(90.0, 90.0, 20.0), 192, symmetry),
        disk_mesh(90.0, 192, symmetry),
    )
    np.testing.assert_array_equal(own.points, disk.points)
    np.testing.assert_array_equal(own.quads, disk.quads)


def test_the_rim_is_the_ellipse_and_the_area_its_own_to_second_order() -> None:
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
    # What the solvers take the rim for, from its nodes alone.
    form = rim_form(mesh.points[mesh.node_sets["rim"], :2])
    np.testing.assert_allclose(rim_share(form, mesh.points[:, :2]), share, atol=1e-12)


def test_a_quarter_has_its_lines_of_symmetry() -> None:
    quarter = elliptic_disk_mesh(Outline(120.0, 80.0, 90.0), 192, "quarter")
    assert (quarter.points[quarter.node_sets["symmetry_x"], 0] == 0).all()
    assert (quarter.points[quarter.node_sets["symmetry_y"], 1] == 0).all()
    np.testing.assert_allclose(quarter.points.max(axis=0), (80.0, 120.0, 0.0))


@pytest.mark.parametrize(
    ("outline", "symmetry", "field"),
    [
        (Outline(120.0, 80.0, 30.0), "quarter", "symmetry"),
        (Outline(80.0, 120.0), "full", "minor"),
        (Outline(120.0, -80.0), "full", "minor"),
        (Outline(120.0, 29.0), "full", "minor"),
    ],
)
def test_what_cannot_be_meshed_is_named(outline, symmetry, field) -> None:
    with pytest.raises(InputError) as error:
        elliptic_disk_mesh(outline, 192, symmetry)
    assert error.value.field == field
