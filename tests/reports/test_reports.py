"""Cuts through a bubble, VTU files, numbers of the page, files written whole."""

from __future__ import annotations

import os
from pathlib import Path

import meshio
import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.files import replacing
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports.bubbles import node_cut, point_cut
from bubblefit.reports.html import number, percent
from bubblefit.reports.vtu import write_vtu


def cap(xy: np.ndarray, height: float) -> np.ndarray:
    """Displacement (n, 3) of a parabolic cap of radius 100 mm."""
    inside = 1 - (xy**2).sum(axis=1) / 1e4
    return np.column_stack([0.05 * xy * inside[:, None], height * inside])


def polar(angles: np.ndarray) -> np.ndarray:
    r, t = np.meshgrid(np.linspace(10, 100, 10), angles)
    ring = np.column_stack([(r * np.cos(t)).ravel(), (r * np.sin(t)).ravel()])
    return np.vstack([[0.0, 0.0], ring])


QUARTER, FULL = polar(np.linspace(0, np.pi / 2, 7)), polar(np.linspace(0, 2 * np.pi, 25)[:-1])


@pytest.mark.parametrize("axis", [0, 1])
def test_cut_follows_the_nodes_on_the_axis(axis: int):
    cut = node_cut(QUARTER, cap(QUARTER, 30.0), axis)
    assert len(cut.position) == 11 and cut.height[0] == pytest.approx(30.0)
    assert (np.diff(cut.position) > 0).all() and (np.diff(cut.height) < 0).all()
    assert cut.position[5] == pytest.approx(50 + 0.05 * 50 * 0.75)


def test_cut_of_a_mesh_without_nodes_on_the_axis_is_interpolated():
    turned = polar(np.linspace(0, 2 * np.pi, 73)[:-1] + np.pi / 72)
    cut = node_cut(turned, cap(turned, 30.0), 0)
    middle = np.interp(0.0, cut.position, cut.height)
    assert len(cut.position) > 70 and middle == pytest.approx(30.0, rel=0.01)


def test_measured_points_beside_the_axis_count():
    x, y = np.meshgrid(np.arange(-87.5, 90, 5.0), np.arange(-87.5, 90, 5.0))
    grid = np.column_stack([x.ravel(), y.ravel()])
    assert len(point_cut(grid, cap(grid, 30.0), 0).position) == 2 * x.shape[1]


def square() -> Mesh:
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    return Mesh(points, np.array([[0, 1, 2, 3]]), {"rim": np.arange(4)})


def test_vtu_holds_the_deformed_mesh(tmp_path: Path):
    mesh = square()
    u = np.arange(12.0).reshape(4, 3)
    path = write_vtu(
        mesh, u, tmp_path / "b.vtu", {"height": u[:, 2]}, {"thickness": np.array([0.81])}
    )
    back = meshio.read(path)
    assert back.points == pytest.approx(mesh.points + u)
    assert back.point_data["displacement"] == pytest.approx(u)
    assert back.point_data["height"] == pytest.approx(u[:, 2])
    assert back.cell_data["thickness"][0] == pytest.approx([0.81])
    with pytest.raises(ValueError, match="height: 3 rows for 4 nodes"):
        write_vtu(mesh, u, path, {"height": np.zeros(3)})


def test_numbers():
    assert [number(v) for v in (None, float("nan"), 3, "x", 0.123456)] == [
        "–", "–", "3", "x", "0.1235",
    ]  # fmt: skip
    assert [number(v) for v in (float("inf"), 12345.6, True)] == ["–", "1.235e+04", "True"]
    shares = (0.01234, 0.9949, 0.995, 0.996, 1.234, 12.0, 0.1, 0.0)
    assert [percent(share) for share in shares] == [
        "1.2 %", "99 %", "100 %", "100 %", "123 %", "1200 %", "10 %", "0 %",
    ]  # fmt: skip


def test_replacing_keeps_the_old_file_when_the_block_fails(tmp_path: Path):
    path = tmp_path / "result.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["result.txt"]
    with pytest.raises(OutputError, match="No space left"), replacing(path) as temporary:
        temporary.write_text("half")
        raise OSError(28, "No space left on device")
    assert path.read_text() == "old" and os.listdir(tmp_path) == ["result.txt"]
