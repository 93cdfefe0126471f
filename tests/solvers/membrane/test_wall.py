"""Which wall a bent cylinder has: the band, one end of it, or what settings say."""

from __future__ import annotations

from typing import Any

import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, inflated_cylinder
from bubblefit.solvers.base import BandedSolver
from bubblefit.solvers.membrane import bending as cylinder
from bubblefit.solvers.membrane.bending import closed_membrane_of
from bubblefit.solvers.membrane.bubble import LEFT, STIFF, TENSION_FIELD, Wall
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...complaints import complaint

LAW = HypoelasticLaw.linear(700.0, 150.0, 20.0)


@pytest.fixture(scope="module")
def model() -> CylinderModel:
    return inflated_cylinder(150.0, 0.14, 0.81, 75.0, deflections=[2.0])


def membrane_of(solver: MembraneSolver, model: CylinderModel) -> ClosedMembrane:
    """What the solver would run."""
    return cylinder.prepare(model, LAW, 1e-8, solver.wall)


def test_a_cylinder_is_predicted_as_a_tension_field(model: CylinderModel) -> None:
    membrane = membrane_of(MembraneSolver(), model)
    assert membrane.wall == TENSION_FIELD == Wall(LEFT, 1.0)
    assert membrane.wrinkle_stiffness == LEFT and membrane.flexure is not None


def test_the_band_goes_from_a_tension_field_to_a_stiff_wall(model: CylinderModel) -> None:
    solver = MembraneSolver()
    assert isinstance(solver, BandedSolver)
    ends = solver.band(model)
    assert [(end.name, end.predicted) for end in ends] == [
        ("tension field", True), ("stiff wall", False)
    ]  # fmt: skip
    own = [solver_named("membrane", wrinkle_stiffness=None, **end.options) for end in ends]
    walls = [membrane_of(one, model).wall for one in own]  # type: ignore[arg-type]
    assert walls == [TENSION_FIELD, STIFF] == [Wall(LEFT, 1.0), Wall(None, 1.0)]
    assert [one.band(model) for one in own] == [(), ()]  # type: ignore[attr-defined]
    assert "carries no compression" in ends[0].meaning
    assert "like a solid sheet of its thickness" in ends[1].meaning
    # Only of cylinders that are bent: nothing else is pressed together.
    assert not solver.band(closed_membrane_of(model))


@pytest.mark.parametrize(
    ("options", "wall"),
    [
        ({"wall": "tension field"}, Wall(LEFT, 1.0)),
        ({"wall": "stiff"}, Wall(None, 1.0)),
        ({"wrinkle_stiffness": 0.01}, Wall(0.01, 1.0)),
        ({"bending_stiffness": 0.5}, Wall(None, 0.5)),
        ({"wrinkle_stiffness": 0.01, "bending_stiffness": 0.0}, Wall(0.01, 0.0)),
        ({"wall": "tension field", "bending_stiffness": 0.5}, Wall(LEFT, 0.5)),
        ({"wall": "tension field", "wrinkle_stiffness": 0.02}, Wall(0.02, 1.0)),
        ({"wall": "stiff", "bending_stiffness": 0.0}, Wall(None, 0.0)),
    ],
)
def test_a_wall_that_is_asked_for_has_no_band(
    model: CylinderModel, options: dict[str, Any], wall: Wall
) -> None:
    solver = MembraneSolver(**options)
    assert membrane_of(solver, model).wall == wall
    assert not solver.band(model)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"wall": "soft"}, "wall: expected 'band', 'tension field' or 'stiff', got 'soft'"),
        ({"wall": "stiff", "wrinkle_stiffness": 0.1}, "wrinkle_stiffness: a stiff wall has no"),
        ({"wrinkle_stiffness": 0.0}, "wrinkle_stiffness: expected 0 < share <= 1"),
        ({"wall": "stiff", "bending_stiffness": -1.0}, "bending_stiffness: expected 0 or more"),
    ],
)
def test_a_wall_that_cannot_be(options: dict[str, Any], words: str) -> None:
    assert complaint(MembraneSolver, **options).startswith(words)
