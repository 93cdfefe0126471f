"""VTU files, numbers of the page, files written whole."""

from __future__ import annotations

import os
from pathlib import Path

import meshio
import numpy as np
import pytest
from bubblefit.errors import OutputError
from bubblefit.files import replacing
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports.html import number, percent
from bubblefit.reports.vtu import write_vtu


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
