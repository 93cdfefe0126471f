"""solvers/membrane/solver.py: bad input, guesses and failure."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.meshes.strip_models import PatchModel, bias_strip, straight_strip
from bubblefit.solvers.base import analysis_of
from bubblefit.solvers.membrane.kernel import reference_elements
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...builders.laws import TABLE_3_2, TABLE_4_2
from ...support.refusals import complaint, raised
from .cases import distorted_grid, quarter_bubble

LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2))
# Thesis Table 3.1 and section 3.3, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81
TIGHT = 1e-11


def straight_strip_of(direction, increments=100):
    lengths = WARP if direction == "warp" else FILL
    return straight_strip(direction, *lengths, THICKNESS, increments=increments)


def bias_strip_of(increments=100, final=BIAS[1], **counts):
    return bias_strip(BIAS[0], final, THICKNESS, increments=increments, **counts)


def test_guesses_and_earlier_runs_do_not_change_a_strip():
    model = bias_strip_of(20)
    cold = MembraneSolver(TIGHT).run(model, LAW)
    history, _ = MembraneSolver().run_with_sensitivity(model, LAW)
    assert history.load == pytest.approx(cold.load, rel=1e-7)
    assert cold.load_slope is None and cold.unstable == history.unstable == ()
    other = LAW.with_beta(1.01 * LAW.beta)
    expected = MembraneSolver(TIGHT).run(model, other)
    warm = MembraneSolver(TIGHT).run(model, other, guess=cold.path)
    assert warm.load == pytest.approx(expected.load, rel=1e-8)
    assert warm.iterations < expected.iterations
    guess = np.random.default_rng(0).uniform(-20, 20, cold.displacement.shape)
    guess[3] = np.nan
    found = MembraneSolver(TIGHT).run(model, LAW, guess=guess)
    assert found.load == pytest.approx(cold.load, rel=1e-8)
    solver, strip = MembraneSolver(), straight_strip_of("fill", 10)
    first = solver.run(strip, LAW)
    bubble = BubbleModel(disk_mesh(100.0, 48, "quarter"), THICKNESS, [0.1, 0.2])
    inflated = solver.run(bubble, LAW)
    raised(SolverFailure, "", solver.run, strip, HypoelasticLaw.linear(300.0, -200.0, 5.0))
    assert (solver.run(strip, LAW).load == first.load).all()
    assert (solver.run(bubble, LAW).path == inflated.path).all()


@pytest.mark.parametrize(
    ("name", "amount"), [("z0_1", 2.0), ("slack_warp", 0.01), ("thickness", 0.1)]
)
def test_run_of_another_sheet_does_not_change_a_bubble(name, amount):
    """The storage of its tangent is used again, and nothing else of the run before."""
    mesh = disk_mesh(100.0, 48, "full")
    model = BubbleModel(mesh, 0.81, (0.02, 0.1), modes=disk_modes(mesh.points / 100.0, 6))
    other = model.with_parameters({name: amount})
    solver = MembraneSolver()
    solver.run(model, LAW)
    tangent = solver._prepared[1].tangent
    again, fresh = (s.run_with_sensitivity(other, LAW, ["beta_3", name])
                    for s in (solver, MembraneSolver()))  # fmt: skip
    assert solver._prepared[1].tangent is tangent
    for run, expected in zip(again, fresh, strict=True):
        of_run, of_fresh = (getattr(side, "path", side) for side in (run, expected))
        np.testing.assert_array_equal(of_run, of_fresh)


HOPELESS_LAWS = {
    "negative warp modulus": HypoelasticLaw.linear(-300.0, 220.0, 5.0),
    "negative fill modulus": HypoelasticLaw.linear(300.0, -220.0, 5.0),
    "negative shear modulus": HypoelasticLaw.linear(300.0, 220.0, -5.0),
    "nu12 nu21 above one": HypoelasticLaw.linear(1.0, 500.0, 5.0, 0.4),
    "no stiffness at all": HypoelasticLaw.linear(1e-9, 1e-9, 1e-9),
    "limit load far below": HypoelasticLaw.linear(0.5, 0.5, 0.2),
    "negative on the way": HypoelasticLaw([0, 0, 0, 5.0, 0, 0, 0, 220.0, 0, 0, -5e3, 300.0]),
}
BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), THICKNESS, 1e-3 * np.array([22.0, 59, 97, 132, 186, 251, 300])
)


@pytest.mark.parametrize("law", HOPELESS_LAWS)
@pytest.mark.parametrize(
    ("model", "unit"),
    [
        (straight_strip_of("warp", 10), "mm of gauge elongation"),
        (bias_strip_of(10), "mm"),
        (BUBBLE, "kPa"),
    ],
    ids=["warp", "bias", "bubble"],
)
def test_hopeless_moduli_raise_solver_failure(model, unit, law):
    if model is not BUBBLE and law in ("no stiffness at all", "limit load far below"):
        return  # a strip is pulled by its length
    where = unit if law == "negative on the way" else ""
    raised(
        SolverFailure,
        f"no equilibrium at.*{where}",
        MembraneSolver().run,
        model,
        HOPELESS_LAWS[law],
    )


PLANE_LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])


def test_solver_refuses_bad_models_laws_and_settings():
    points, quads = distorted_grid(2, 2, 1.0, 1.0)
    points[4] = [2.0, 2.0, 0.0]
    assert "mend the mesh" in complaint(reference_elements, points, quads)
    mesh = disk_mesh(100.0, 48, "quarter")
    for field, *values in (
        *(("pressures", mesh, 1.0, p) for p in ([], [0, 0.1], [0.2, 0.1], [0.1, 0.1], [-0.1])),
        ("increments", mesh, 1.0, [0.1, 0.2], [0.05, 0.2]),
        ("thickness", mesh, 0.0, [0.1]),
    ):
        assert field in complaint(BubbleModel, *values)
    assert "thickness" in complaint(PatchModel, [[1.0, 1.0]], 0.0)
    check = solver_named("membrane").check()
    assert check.available and check.carries_law
    assert "membrane" in complaint(solver_named, "abacus")
    assert analysis_of({BubbleModel: 1, object: 2}, quarter_bubble(), "") == 1
    with pytest.raises(SolverFailure, match="membrane: cannot run a str, only: BubbleModel, "):
        MembraneSolver().run("a bubble", PLANE_LAW)
