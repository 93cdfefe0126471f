"""solvers/membrane/wall.py: stiffness of the wall, its wrinkles and band."""

import re

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.base import BandedSolver
from bubblefit.solvers.membrane import closed as closed_model
from bubblefit.solvers.membrane import cylinder
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.cylinder import closed_membrane_of
from bubblefit.solvers.membrane.flexure import flexure_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.wall import LEFT, STIFF, TENSION_FIELD, Wall
from bubblefit.solvers.registry import solver_named

from ...support.refusals import complaint
from .cases import square_beam

# Stiff, so that the strain measure and the strain path do not matter.
LINEAR = HypoelasticLaw.linear(5000.0, 4000.0, 200.0)


def test_wall_has_its_whole_bending_stiffness_by_default():
    model = square_beam()
    planes = np.zeros(model.mesh.points.shape, dtype=bool)
    for name, axis in (("symmetry_x", 0), ("symmetry_z", 2)):
        planes[model.mesh.node_sets[name], axis] = True
    whole = flexure_of(model.mesh.points, model.mesh.quads, model.warp, model.thickness, planes)
    for solver in (MembraneSolver(), MembraneSolver(bending_stiffness=1.0)):
        membrane = closed_model.prepare(model, LINEAR, 1e-9, solver.wall)
        assert membrane.flexure.shares == pytest.approx(whole.shares)
    none = closed_model.prepare(model, LINEAR, 1e-9, Wall(bending_stiffness=0.0))
    assert none.flexure is None


def test_load_carried_by_wrinkles_is_their_work_over_the_way(monkeypatch):
    """Three N mm in the quarter's every step: most of the load where the step is shortest."""
    monkeypatch.setattr(ClosedMembrane, "wrinkle_work", lambda *_: 3.0)
    solver = MembraneSolver(1e-9, wrinkle_stiffness=0.01)
    history = solver.run(square_beam((2.0, 6.0)), LINEAR)
    (remark,) = [r for r in history.remarks if "left to wrinkles" in r]
    said = re.search(r"\(0\.01 of the taut fabric's\) carries (\S+) % of the largest load", remark)
    assert said is not None
    carried = 4 * 3.0 / 2.0  # of the whole beam, N
    assert float(said[1]) == pytest.approx(100 * carried / history.load.max(), rel=0.05)


def test_wrinkle_is_strain_of_fabric_less_that_of_surface():
    """A tube wider by 2 % and shorter by 3 %: what is left to its wrinkles is pushed together."""
    membrane = closed_model.prepare(square_beam(), LINEAR, 1e-9, Wall(0.01, 0.0))
    membrane.unbalance(membrane.reference * [0.02, 0.02, -0.03], 0.0, False)
    folded = membrane.wrinkle[..., 0] != 0.0  # the tube, not its ends
    along = membrane.strain_new[folded, 0] - np.log(0.97)
    assert along.min() > 0.02 and folded.sum() > 700
    assert membrane.wrinkle[folded, 0] == pytest.approx(along, rel=1e-6)
    assert membrane.wrinkle_work(0 * membrane.wrinkle) > 0


WALL_LAW = HypoelasticLaw.linear(700.0, 150.0, 20.0)


def wall_of(solver, model):
    return cylinder.prepare(model, WALL_LAW, 1e-8, solver.wall).wall


def test_band_of_a_wall_goes_from_tension_field_to_stiff_wall(short_tube_model):
    solver = MembraneSolver()
    assert wall_of(solver, short_tube_model) == TENSION_FIELD == Wall(LEFT, 1.0)
    assert isinstance(solver, BandedSolver)
    ends = solver.band(short_tube_model)
    assert [(end.name, end.predicted) for end in ends] == [
        ("tension field", True), ("stiff wall", False)
    ]  # fmt: skip
    own = [solver_named("membrane", wrinkle_stiffness=None, **end.options) for end in ends]
    walls = [wall_of(one, short_tube_model) for one in own]
    assert walls == [TENSION_FIELD, STIFF] == [Wall(LEFT, 1.0), Wall(None, 1.0)]
    assert [one.band(short_tube_model) for one in own] == [(), ()]
    assert not solver.band(closed_membrane_of(short_tube_model))


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
def test_requested_wall_has_no_band(short_tube_model, options, wall):
    solver = MembraneSolver(**options)
    assert wall_of(solver, short_tube_model) == wall
    assert not solver.band(short_tube_model)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"wall": "soft"}, "wall"),
        ({"wall": "stiff", "wrinkle_stiffness": 0.1}, "wrinkle_stiffness: a stiff wall has no"),
        ({"wrinkle_stiffness": 0.0}, "wrinkle_stiffness"),
        ({"wall": "stiff", "bending_stiffness": -1.0}, "bending_stiffness"),
    ],
)
def test_bad_wall_is_refused(options, field):
    assert complaint(MembraneSolver, **options).startswith(field)
