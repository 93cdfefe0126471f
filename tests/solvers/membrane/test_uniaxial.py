"""The strip tests: mesh, model, closed forms, gauge, derivatives, failure."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import (
    UniaxialModel,
    bias_strip,
    straight_strip,
    strip_mesh,
    yarn_direction,
)
from bubblefit.solvers.bars import BARS, bar_law
from bubblefit.solvers.base import parameters_of
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.strip import Pulling

from ...builders.laws import TABLE_3_2
from ...materials.forms.test_forms import integral
from ...support.paths import PUBLISHED
from ...support.refusals import complaint, raised
from .test_sensitivity import differences

LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2))
PARAMETERS = parameters_of(LAW)
# Thesis Table 3.1 and section 3.3, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81
TIGHT = 1e-11
# Three regions of every strain, with breaks that the strips pass.
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
    [[0.01, 0.03], [0.02, 0.06], [0.05, 0.2]],
)  # fmt: skip
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
STRAIGHT = pytest.mark.parametrize("direction", ["warp", "fill"])


def straight(direction, increments=100):
    lengths = WARP if direction == "warp" else FILL
    return straight_strip(direction, *lengths, THICKNESS, increments=increments)


def bias(increments=100, final=BIAS[1], **counts):
    return bias_strip(BIAS[0], final, THICKNESS, increments=increments, **counts)


@pytest.mark.parametrize("symmetry", ["full", "half"])
@pytest.mark.parametrize(("along", "gauge"), [(7, 3.0), (8, 7.9), (3, 0.5), (5, None)])
def test_every_quad_and_set(symmetry, along, gauge):
    mesh = strip_mesh(4.0, 8.0, 4, along, gauge, symmetry)
    (x, y), corner, sets = mesh.points[:, :2].T, mesh.points[mesh.quads], mesh.node_sets
    area = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])[:, 2] / 2
    assert (area > 0).all()
    assert area.sum() == pytest.approx(32.0 if symmetry == "full" else 16.0)
    assert (sets["bottom"] == np.flatnonzero(y == 0)).all()
    assert (sets["top"] == np.flatnonzero(y == 8.0)).all()
    assert (sets["free_edges"] == np.flatnonzero(np.abs(x) == 2.0)).all()
    assert symmetry == "full" or (sets["symmetry_x"] == np.flatnonzero(x == 0)).all()
    a, b = sets["gauge"]
    assert x[a] == x[b] == 0
    assert y[b] - y[a] == pytest.approx(8.0 if gauge is None else gauge, abs=1e-13)
    assert y[a] == pytest.approx(8.0 - y[b], abs=1e-13)


def test_bad_meshes_and_models_are_named():
    good = {"width": 4.0, "length": 8.0, "across": 4, "along": 6}
    for change in ({"gauge_length": 9.0}, {"along": 2, "gauge_length": 4.0}):
        assert next(iter(change)) in complaint(strip_mesh, **{**good, **change})
    model = bias()
    for word, call, values, options in (
        ("elongations", replace, [model], {"elongations": [1.0, 1.0]}),
        ("thickness", replace, [model], {"thickness": 0.0}),
        ("final_length", straight_strip, ["warp", 20.0, 19.0, THICKNESS], {}),
        ("pressure_offset", MembraneSolver().run_with_sensitivity,
         [straight("warp"), LAW, ["pressure_offset"]], {}),
    ):  # fmt: skip
        assert word in complaint(call, *values, **options)


@STRAIGHT
@BOTH
@pytest.mark.parametrize("law", [LAW, TRILINEAR], ids=["cubic", "trilinear"])
@pytest.mark.parametrize(
    ("increments", "distort"), [(1, 0.0), (2, 0.0), (9, 0.0), (100, 0.0), (100, 0.25)]
)
def test_the_homogeneous_strip(direction, thickness_change, law, increments, distort):
    """Load, width and length by the integral of the modulus, in any number of increments.

    In the fill test E1 is held at its value at zero strain, because the warp gets shorter. At the
    whole elongation another equilibrium is near that of the fill strip in one increment: the least
    eigenvalue of its tangent is 0.2 N/mm there, and 2.7 N/mm at 0.98 of the elongation.
    """
    model, law = straight(direction, increments), replace(law, thickness_change=thickness_change)
    model = replace(model, elongations=tuple(0.98 * np.array(model.elongations)))
    if distort:
        points = model.mesh.points.copy()
        x, y = points[:, 0], points[:, 1]
        inside = (x > 0) & (x < 12.5) & (y > 0) & (y < y.max())
        random = np.random.default_rng(5)
        points[inside, :2] += distort * random.uniform(-2.5, 2.5, (int(inside.sum()), 2))
        model = replace(model, mesh=Mesh(points, model.mesh.quads, model.mesh.node_sets))
    strain = np.log1p(np.array(model.elongations) / model.gauge_length)
    modulus = "E1" if direction == "warp" else "E2"
    stress = np.array([integral(law, modulus, 0.0, end) for end in strain])
    across = -law.nu12 * (strain if direction == "warp" else stress / law.E1(0.0))
    narrowed = across if thickness_change == "constant" else -strain
    history = MembraneSolver(TIGHT).run(model, law)
    assert history.load == pytest.approx(stress * WIDTH * THICKNESS * np.exp(narrowed), rel=1e-9)
    sideways = history.displacement[:, :, 0]
    assert sideways == pytest.approx(np.expm1(across)[:, None] * model.mesh.points[:, 0], abs=1e-8)
    share = (1.0 - model.mesh.points[:, 1] / model.gauge_length) * -1.0
    along = np.outer(model.elongations, share)
    assert history.displacement[:, :, 1] == pytest.approx(along, abs=1e-8)
    top, bottom = history.reactions["top"], history.reactions["bottom"]
    assert top[:, 1] == pytest.approx(-bottom[:, 1], rel=1e-9)
    assert 2 * top[:, 1] == pytest.approx(history.load, rel=1e-9)
    assert np.abs(history.reactions["symmetry_x"]).max() < 1e-6 * history.load[-1]


def test_patch_of_turned_material():
    angle, e1, e2, g12, nu = np.radians(30.0), 300.0, 220.0, 5.0, 0.24
    c, s = np.cos(angle), np.sin(angle)
    compliance = c**4 / e1 + s**4 / e2 + (1 / g12 - 2 * nu / e1) * c**2 * s**2
    mesh, elongation = strip_mesh(10.0, 20.0, 4, 6), 1e-6
    points = mesh.points.copy()
    inside = (np.abs(points[:, 0]) < 5.0) & (points[:, 1] > 0) & (points[:, 1] < 20.0)
    moves = np.random.default_rng(3).uniform(-0.5, 0.5, (int(inside.sum()), 2))
    points[inside, :2] += moves
    # One node keeps the strip from sliding; the middle of both ends carries the gauge.
    sets = {**mesh.node_sets, "pin": mesh.node_sets["gauge"][1:]}
    model = UniaxialModel(Mesh(points, mesh.quads, sets), yarn_direction(30.0), THICKNESS,
                          [elongation], {"top": (1,), "pin": (0,)})  # fmt: skip
    history = MembraneSolver(1e-12).run(model, HypoelasticLaw.linear(e1, e2, g12, nu))
    expected = elongation / 20.0 / compliance * 10.0 * THICKNESS
    # The gauge also turns with the sheared ends, to second order.
    assert history.load[0] == pytest.approx(expected, rel=1e-4)
    even = np.column_stack([points[:, :2], np.ones(len(points))])
    _, left, *_ = np.linalg.lstsq(even, history.displacement[0][:, :2], rcond=None)
    assert np.sqrt(left).max() < 1e-6 * elongation


def test_the_gauge_has_the_measured_length_in_every_increment():
    model = bias()
    history, slope = MembraneSolver(TIGHT).run_with_sensitivity(model, LAW)
    position = model.mesh.points + history.displacement
    lower, upper = model.mesh.node_sets["gauge"]
    axis = position[:, upper] - position[:, lower]
    length = np.linalg.norm(axis, axis=1)
    assert length == pytest.approx(BIAS[0] + np.array(model.elongations), abs=1e-8)
    opens = np.einsum("fk,fkj->fj", axis, slope[:, upper] - slope[:, lower])
    assert np.abs(opens).max() < 1e-8 * np.abs(slope).max() * BIAS[1]
    assert np.abs(slope[:, model.mesh.node_sets["bottom"], 1]).max() > 0
    bottom, top = (history.displacement[:, model.mesh.node_sets[n]] for n in ("bottom", "top"))
    assert (top == 0).all()
    assert np.ptp(bottom[:, :, 1], axis=1).max() == 0
    assert (bottom[:, :, [0, 2]] == 0).all()
    # The middle stretches more than what the grips hold, so the grips move less than evenly.
    grip = -bottom[:, 0, 1]
    assert (np.diff(grip) > 0).all()
    assert grip[-1] < 75.0 / BIAS[0] * model.elongations[-1]
    assert history.reactions["top"] == pytest.approx(-history.reactions["bottom"], abs=1e-4)
    assert history.load == pytest.approx(history.reactions["top"][:, 1], rel=1e-6)


def test_bias_at_zero_and_ninety_degrees():
    swapped = HypoelasticLaw.linear(220.0, 300.0, 20.0, 0.24 * 220.0 / 300.0)
    law = HypoelasticLaw.linear(300.0, 220.0, 20.0, 0.24)
    counts = {"increments": 4, "across": 4, "along": 12}
    a = MembraneSolver(TIGHT).run(bias_strip(20.0, 22.0, THICKNESS, angle=90.0, **counts), law)
    b = MembraneSolver(TIGHT).run(bias_strip(20.0, 22.0, THICKNESS, angle=0.0, **counts), swapped)
    assert a.load == pytest.approx(b.load, rel=1e-8)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-7)
    a, b = (MembraneSolver(TIGHT).run(bias_strip(*BIAS, THICKNESS, angle=angle, increments=20), LAW)
            for angle in (45.0, -45.0))  # fmt: skip
    assert a.load == pytest.approx(b.load, rel=1e-8)


def test_refinement_of_the_bias_strip():
    """Moduli are held at the end of their range: strains at the grips' corners have no limit."""
    law = replace(LAW, strain_range=[0.153, 0.232, 0.7])
    loads = np.array([
        MembraneSolver().run(bias(8, across=10 * k, along=30 * k), law).load for k in (1, 2, 3)
    ])  # fmt: skip
    off = np.abs(loads[:2] / loads[2] - 1.0)
    assert off.max() < 1e-2
    assert off[:, -1].max() < 1e-4
    assert off[1].max() < 0.5 * off[0].max()
    assert LAW.E1(0.34) < 0 < LAW.E1(0.32)
    with pytest.raises(SolverFailure, match="mm of gauge elongation"):
        MembraneSolver().run(bias(20, across=20, along=60), LAW)


def check_derivatives(model, law, names, move=0.05):
    history, slope = MembraneSolver(1e-12).run_with_sensitivity(model, law, names)
    assert history.load_slope is not None
    assert history.load_slope.shape == (len(model.elongations), len(names))
    for j, name in enumerate(names):
        largest = np.abs(history.load_slope[:, j]).max()
        load, displacement = differences(model, law, name, move / largest, 1e-12)
        assert np.abs(history.load_slope[:, j] - load).max() < 1e-5 * largest, name
        size = np.abs(displacement).max()
        # Where a parameter moves next to nothing, differences are rounding.
        assert np.abs(slope[..., j] - displacement).max() < 1e-5 * size + 1e-8 * largest, name


@BOTH
@STRAIGHT
def test_derivatives_of_the_straight_strips(direction, thickness_change):
    places = range(8, 12) if direction == "warp" else range(4, 8)
    own = [f"beta_{i}" for i in places]
    # The load of an incompressible strip does not depend on its width.
    if thickness_change == "constant":
        check_derivatives(straight(direction, 10), TRILINEAR, [*own[1:], "nu12"])
        own += ["nu12", "beta_11"] if direction == "fill" else ["nu12"]
    law = replace(LAW, thickness_change=thickness_change)
    check_derivatives(straight(direction, 10), law, [*own, "thickness"])


@pytest.mark.parametrize(
    ("law", "names", "move"),
    [
        (LAW, PARAMETERS[:13], 0.05),
        (replace(LAW, thickness_change="incompressible"), PARAMETERS[1:13:4], 0.05),
        # In eight increments most points pass a break inside of one.
        (TRILINEAR, [n for i, n in enumerate(PARAMETERS[:13]) if i % 4 or i > 11], 0.001),
    ],
    ids=["cubic", "incompressible", "trilinear"],
)
def test_derivatives_of_the_bias_strip(law, names, move):
    check_derivatives(bias(8, across=4, along=12), law, names, move)


def test_guesses_and_earlier_runs_leave_the_result():
    model = bias(20)
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
    solver, strip = MembraneSolver(), straight("fill", 10)
    first = solver.run(strip, LAW)
    bubble = BubbleModel(disk_mesh(100.0, 48, "quarter"), THICKNESS, [0.1, 0.2])
    inflated = solver.run(bubble, LAW)
    raised(SolverFailure, "", solver.run, strip, HypoelasticLaw.linear(300.0, -200.0, 5.0))
    assert (solver.run(strip, LAW).load == first.load).all()
    assert (solver.run(bubble, LAW).path == inflated.path).all()


@pytest.mark.parametrize(("model", "share"), [(straight("warp", 7), 1.0), (bias(7), 0.8)])
def test_pull_and_displacement_together_or_in_turn(monkeypatch, model, share):
    """Both ways lead to one equilibrium; together takes fewer assemblies."""
    together = MembraneSolver(TIGHT).run(model, LAW)
    monkeypatch.setattr(Pulling, "_together", lambda *given: None)
    in_turn = MembraneSolver(TIGHT).run(model, LAW)
    assert together.load == pytest.approx(in_turn.load, rel=1e-9)
    assert together.displacement == pytest.approx(in_turn.displacement, abs=1e-8)
    assert together.iterations < share * in_turn.iterations


def test_newton_gets_past_moduli_that_jump():
    """Full steps of Newton go to and fro between two sides of a break."""
    restless = HypoelasticLaw.trilinear(
        (1421.0, 379.0, 817.0), (61.0, 123.0, 447.0), (64.0, 46.0, 20.0),
        [[0.0032, 0.0567], [0.0719, 0.0722], [0.0619, 0.0653]],
    )  # fmt: skip
    assert (np.diff(MembraneSolver(TIGHT).run(bias(20), restless).load) > 0).all()
    solver, model = MembraneSolver(TIGHT), bias(20)
    membrane = solver._membrane(model, restless)
    assert isinstance(membrane, Membrane)
    settings = membrane.newton
    membrane.newton = replace(settings, max_fruitless=settings.max_iterations + 1)
    raised(SolverFailure, "no equilibrium", solver.run, model, restless)


HOPELESS = {
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


@pytest.mark.parametrize("law", HOPELESS)
@pytest.mark.parametrize(
    ("model", "unit"),
    [(straight("warp", 10), "mm of gauge elongation"), (bias(10), "mm"), (BUBBLE, "kPa")],
    ids=["warp", "bias", "bubble"],
)
def test_hopeless_moduli_raise_solver_failure(model, unit, law):
    if model is not BUBBLE and law in ("no stiffness at all", "limit load far below"):
        return  # a strip is pulled by its length
    where = unit if law == "negative on the way" else ""
    raised(SolverFailure, f"no equilibrium at.*{where}", MembraneSolver().run, model, HOPELESS[law])


@pytest.mark.parametrize(
    ("direction", "thickness_change", "error"),
    [
        ("warp", "constant", 3.107), ("fill", "constant", 16.578), ("bias45", "constant", 153.145),
        ("warp", "incompressible", 68.0), ("fill", "incompressible", 90.4),
        ("bias45", "incompressible", 42.3),
    ],
)  # fmt: skip
def test_table_3_2_on_the_published_curves(direction, thickness_change, error):
    """RMS in N (Eqs 3.4-3.6), as measured here: a change of model or mesh shows."""
    path = PUBLISHED / "published_uniaxial_polynomials.csv"
    with path.open() as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    row = next(row for row in rows if row["direction"] == direction)
    model = bias() if direction == "bias45" else straight(direction)
    measured = np.polyval([float(row[f"c{k}"]) for k in (4, 3, 2, 1)] + [0.0], model.elongations)
    load = MembraneSolver().run(model, replace(LAW, thickness_change=thickness_change)).load
    assert np.sqrt(np.mean((load - measured) ** 2)) == pytest.approx(error, abs=0.06)


@pytest.mark.parametrize("bar", BARS, ids=lambda bar: f"{bar.model}-{bar.direction}")
def test_the_end_stresses_of_marc(bar):
    """Cauchy stress from the load of the strip and its width at the end; published to 5 digits."""
    lengths = WARP if bar.direction == "warp" else FILL
    model = straight_strip(bar.direction, lengths[0], lengths[0] * (1 + bar.elongation), THICKNESS)
    history = MembraneSolver().run(model, bar_law(bar.model))
    narrow = 2.0 * history.displacement[-1, model.mesh.node_sets["free_edges"], 0].mean()
    assert history.load[-1] / (THICKNESS * (WIDTH + narrow)) == pytest.approx(bar.stress, rel=1e-4)


COARSE = bias(8, across=4, along=12)


@pytest.mark.parametrize(
    ("owner", "model", "at", "refused"),
    [
        (Pulling, COARSE, 0, 1), (Pulling, COARSE, 4, 1), (Pulling, COARSE, 4, 3),
        (Membrane, BUBBLE, 3, 1), (Membrane, BUBBLE, 3, 6), (Membrane, BUBBLE, 0, 7),
    ],
)  # fmt: skip
def test_cut_back_does_not_change_the_result(monkeypatch, owner, model, at, refused):
    """One level is refused until the step to it has been halved often enough."""
    expected = MembraneSolver(TIGHT).run(model, LAW)
    levels = model.elongations if owner is Pulling else model.increments
    original, calls = owner.equilibrium, []

    def stubborn(self, u, level):
        calls.append(level)
        refuses = level == levels[at] and calls.count(level) <= refused
        return None if refuses else original(self, u, level)

    monkeypatch.setattr(owner, "equilibrium", stubborn)
    found = MembraneSolver(TIGHT).run(model, LAW)
    assert calls.count(levels[at]) > refused and len(set(calls)) > len(levels)
    assert found.load == pytest.approx(expected.load, rel=1e-8)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert found.strain_max == pytest.approx(expected.strain_max, abs=1e-9)
