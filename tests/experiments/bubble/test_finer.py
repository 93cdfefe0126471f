"""A bubble's comparison on a finer mesh: the same places, read from other nodes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError
from bubblefit.experiments.bubble.objective import FieldTarget
from bubblefit.experiments.bubble.parts import INWARD, _sample, finer_bubble, resampled
from bubblefit.experiments.kinds import Weighting
from bubblefit.meshes.disk import disk_mesh
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit

from ...projects import small

OWN, OTHER = disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 192, "quarter")


def test_the_same_places_from_other_nodes() -> None:
    """Nodes, but for those of a rim whose polygon is another: these a little inside."""
    some = sp.csr_matrix(np.eye(len(OWN.points))[[0, 5, 9]])
    targets = tuple(
        FieldTarget(p, np.zeros((n, 3)), sample, places=np.arange(n))
        for p, n, sample in ((0.1, len(OWN.points), None), (0.2, 3, some), (0.3, 3, some))
    )
    every, one, two = resampled(targets, OWN, OTHER)
    assert one.sample is two.sample is not every.sample
    assert [t.pressure for t in (every, one, two)] == [0.1, 0.2, 0.3]
    assert one.places is targets[1].places and targets[0].sample is None
    for moved, target in ((every, targets[0]), (one, targets[1])):
        here, there = moved.at(OTHER.points)[:, :2], target.at(OWN.points)[:, :2]
        np.testing.assert_allclose(here, there, atol=1.01e-2)
    inside = np.hypot(*OWN.points[:, :2].T) < 90.0
    np.testing.assert_allclose(every.at(OTHER.points)[inside], OWN.points[inside], atol=1e-9)


def test_places_beyond_the_polygon_are_looked_for_farther_and_farther_in() -> None:
    asked: list[np.ndarray] = []

    def matrix(within: float) -> Any:
        def look(at: np.ndarray) -> Any:
            asked.append(at.copy())
            return "matrix", at[:, 0] < within

        asked.clear()
        found = _sample(SimpleNamespace(matrix=look), places)  # type: ignore[arg-type]
        assert found == "matrix"
        return [at[1, 0] for at in asked]

    places = np.array([[50.0, 0.0], [100.0, 0.0]])
    assert matrix(101.0) == [100.0] and places[1, 0] == 100.0
    assert matrix(99.95) == pytest.approx([100.0, 99.99, 99.9])
    assert matrix(99.5) == pytest.approx([100.0, 99.99, 99.9, 99.0])
    assert all(at[0, 0] == 50.0 for at in asked)
    # Where the polygon has few edges (the sag of four in a quarter is 2 % of the radius).
    assert matrix(97.0) == pytest.approx([100.0, 99.99, 99.9, 99.0, 95.0])
    assert matrix(91.0)[-1] == pytest.approx(100 * INWARD[-1])
    with pytest.raises(InputError, match="1 places of the data lie outside"):
        matrix(90.0)


@pytest.mark.parametrize("factor", [2.0, 1.6])
def test_quads_and_increments_are_divided(tmp_path: Path, factor: float) -> None:
    project = read_project(small(tmp_path))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    assert prepared.finer(setup.make_solver, Weighting(), factor)[0].model.mesh is not None
    (own,) = prepared.comparisons(setup.make_solver, Weighting())
    (found,) = finer_bubble(prepared, setup.make_solver, Weighting(), factor)
    assert found.name == own.name and found.objective is not own.objective
    quads = len(found.model.mesh.quads) / len(own.model.mesh.quads)
    assert quads == (4.0 if factor == 2.0 else pytest.approx(factor**2, rel=0.35))
    assert len(found.model.increments) == 2 * len(own.model.increments)
    assert found.model.increments[1::2] == pytest.approx(own.model.increments)
    assert found.model.pressures == own.model.pressures
    # The objective of the fit is as it was.
    assert own.objective.targets[0].sample is None
    assert found.objective.targets[0].sample.shape[1] == len(found.model.mesh.points)
    # Data of this very model are asked of no other.
    (same,) = prepared.finer(setup.make_solver, Weighting(), factor)
    assert len(same.model.mesh.quads) == len(own.model.mesh.quads)
