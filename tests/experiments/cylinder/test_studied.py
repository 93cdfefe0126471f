"""What a study of a cylinder compares: refinements of it, and quantities of a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.cylinder.predicted import STUDIED, quantities
from bubblefit.experiments.cylinder.test import CylinderTest
from bubblefit.project.project import read_project
from bubblefit.runs.refinement import edge_length
from bubblefit.solvers.base import History

from ...cylinder_cases import STUDIED_PROJECT


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = tmp_path / "project.toml"
    path.write_text(STUDIED_PROJECT)
    return path


def cylinders(project: Path) -> list[CylinderTest]:
    return list(read_project(project).tests.values())


def test_finer_cylinders(project: Path) -> None:
    narrow, wide = cylinders(project)
    own, finer = (narrow.models(0.5, "elements", f)["cylinder"] for f in (3.0, 6.0))
    # What lies between seam, collar and supports is a whole number of rows: nearly a half.
    assert edge_length(finer.mesh) == pytest.approx(edge_length(own.mesh) / 2, rel=0.05)
    assert set(np.unique(wide.models(0.5, "elements", 6.0)["cylinder"].thickness)) == {0.5, 1.5}


def test_finer_increments_keep_what_is_reported(project: Path) -> None:
    test, _ = cylinders(project)
    own, finer = (test.models(0.81, "increments", f)["cylinder"] for f in (1.0, 3.0))
    assert finer.deflections == own.deflections and len(finer.increments) == 12
    assert finer.increments[:3] == pytest.approx([10 / 3, 20 / 3, 10.0])
    assert len(finer.inflation) == 3 * len(own.inflation) and finer.pressure == own.pressure
    np.testing.assert_array_equal(finer.reported, [2, 5, 8, 11])
    assert len(STUDIED.steps(finer)) == 42
    with pytest.raises(InputError, match="--coarser 0"):
        test.models(0.81, "increments", 0.5)


def test_quantities_of_a_history_made_up(project: Path) -> None:
    """A cylinder that swells by a tenth, then a load that is straight up to a limit and falls."""
    model = cylinders(project)[0].model()
    model = replace(model, deflections=np.arange(4.0, 241, 4.0), increments=())
    d = np.array([0.0, *model.deflections])
    swollen = 0.1 * model.mesh.points * [1, 1, 0]
    moves = np.repeat(swollen[None], len(d), axis=0)
    load = np.where(d < 120, 3.0 * d, 360.0 - 0.5 * (d - 120))
    history = History(load, moves, np.zeros(3), np.zeros(3), cavity_volume=np.full(len(d), 6.0e7))
    found = quantities(model, history)
    assert found["radius at mid-span, inflated, mm"] == pytest.approx(82.5)
    assert found["volume, inflated, l"] == pytest.approx(60.0)
    assert found["initial stiffness, N/mm"] == pytest.approx(3.0)
    assert found["load at 100 mm, N"] == pytest.approx(300.0)
    assert found["load at 240 mm, N"] == pytest.approx(300.0)
    assert found["load at the limit point, N"] == pytest.approx(360.0)
    assert 110 < found["load at the knee point, N"] / 3.0 < 120
    early = replace(history, load=load[:26], displacement=moves[:26])
    gone = set(found) - set(quantities(model, early))
    assert gone == {
        "load at 240 mm, N", "load at the limit point, N", "load at the knee point, N"
    }  # fmt: skip
