"""solvers/membrane/strip.py: strips, their gauge, closed forms, stability, increments left out."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.forms.polynomial import LoadRatio
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
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.strip import Pulling, SolvedIncrements

from ...builders.laws import TABLE_3_2
from ...materials.cases import integral_of_modulus
from .cases import MODELS, TRILINEAR_LAW

RATIO_LAW = HypoelasticLaw([12.0, 240.0, 120.0, 600.0, -150.0], 0.24, form=LoadRatio())
TIGHT = 1e-11


def test_strip_of_a_ratio_law_has_the_moduli_of_its_ratio():
    """In the middle of a strip the fill carries nothing: constants at 1:0, but for their nu."""
    gain = RATIO_LAW.coupling[1:]
    at = RATIO_LAW.beta[[3, 1]] + gain * (np.array([1.0, 0.0]) - np.sqrt(0.5))
    constant = HypoelasticLaw.linear(at[0], at[1], 12.0, 0.24)
    own, known = (
        MembraneSolver(TIGHT).run(MODELS["warp"], law).load for law in (RATIO_LAW, constant)
    )
    np.testing.assert_allclose(own, known, rtol=1e-9)


LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2))
# Thesis Table 3.1 and section 3.3, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
STRAIGHT = pytest.mark.parametrize("direction", ["warp", "fill"])


def straight_strip_of(direction, increments=100):
    lengths = WARP if direction == "warp" else FILL
    return straight_strip(direction, *lengths, THICKNESS, increments=increments)


def bias_strip_of(increments=100, final=BIAS[1], **counts):
    return bias_strip(BIAS[0], final, THICKNESS, increments=increments, **counts)


@STRAIGHT
@BOTH
@pytest.mark.parametrize("law", [LAW, TRILINEAR_LAW], ids=["cubic", "trilinear"])
@pytest.mark.parametrize(
    ("increments", "distort"), [(1, 0.0), (2, 0.0), (9, 0.0), (100, 0.0), (100, 0.25)]
)
def test_homogeneous_strip_has_its_closed_form(
    direction, thickness_change, law, increments, distort
):
    """Load, width and length by the integral of the modulus, in any number of increments.

    In the fill test E1 is held at its value at zero strain, because the warp gets shorter. At the
    whole elongation another equilibrium is near that of the fill strip in one increment: the least
    eigenvalue of its tangent is 0.2 N/mm there, and 2.7 N/mm at 0.98 of the elongation.
    """
    model, law = (
        straight_strip_of(direction, increments),
        replace(law, thickness_change=thickness_change),
    )
    elongations = tuple(0.98 * np.array(model.elongations))
    model = replace(model, elongations=elongations, unloaded=True)  # solved at every increment
    if distort:
        points = model.mesh.points.copy()
        x, y = points[:, 0], points[:, 1]
        inside = (x > 0) & (x < 12.5) & (y > 0) & (y < y.max())
        random = np.random.default_rng(5)
        points[inside, :2] += distort * random.uniform(-2.5, 2.5, (int(inside.sum()), 2))
        model = replace(model, mesh=Mesh(points, model.mesh.quads, model.mesh.node_sets))
    strain = np.log1p(np.array(model.elongations) / model.gauge_length)
    modulus = "E1" if direction == "warp" else "E2"
    stress = np.array([integral_of_modulus(law, modulus, 0.0, end) for end in strain])
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


def test_patch_of_turned_yarns_has_its_closed_form():
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


def test_gauge_has_the_measured_length_in_all_increments():
    model = replace(bias_strip_of(), unloaded=True)  # solved at every increment
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


def test_bias_strip_at_zero_and_ninety_degrees_is_a_straight_strip():
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


def test_bias_strip_converges_with_its_mesh():
    """Moduli are held at the end of their range: strains at the grips' corners have no limit."""
    law = replace(LAW, strain_range=[0.153, 0.232, 0.7])
    loads = np.array(
        [
            MembraneSolver().run(bias_strip_of(8, across=10 * k, along=30 * k), law).load
            for k in (1, 2, 3)
        ]
    )
    off = np.abs(loads[:2] / loads[2] - 1.0)
    assert off.max() < 1e-2
    assert off[:, -1].max() < 1e-4
    assert off[1].max() < 0.5 * off[0].max()
    assert LAW.E1(0.34) < 0 < LAW.E1(0.32)
    with pytest.raises(SolverFailure, match="mm of gauge elongation"):
        MembraneSolver().run(bias_strip_of(20, across=20, along=60), LAW)


@pytest.mark.parametrize(
    ("model", "share"), [(straight_strip_of("warp", 7), 1.0), (bias_strip_of(7), 0.8)]
)
def test_gauge_and_equilibrium_solved_together_or_in_turn_agree(monkeypatch, model, share):
    """Both ways lead to one equilibrium; together takes fewer assemblies."""
    together = MembraneSolver(TIGHT).run(model, LAW)
    monkeypatch.setattr(Pulling, "_together", lambda *given: None)
    in_turn = MembraneSolver(TIGHT).run(model, LAW)
    assert together.load == pytest.approx(in_turn.load, rel=1e-9)
    assert together.displacement == pytest.approx(in_turn.displacement, abs=1e-8)
    assert together.iterations < share * in_turn.iterations


BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), THICKNESS, 1e-3 * np.array([22.0, 59, 97, 132, 186, 251, 300])
)
COARSE = bias_strip_of(8, across=4, along=12)


@pytest.mark.parametrize(
    ("owner", "model", "at", "refused"),
    [
        (Pulling, COARSE, 0, 1), (Pulling, COARSE, 4, 1), (Pulling, COARSE, 4, 3),
        (Membrane, BUBBLE, 3, 1), (Membrane, BUBBLE, 3, 6), (Membrane, BUBBLE, 0, 7),
    ],
)  # fmt: skip
def test_cut_back_increments_do_not_change_the_result(monkeypatch, owner, model, at, refused):
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


@pytest.mark.parametrize("shear", [4.0, 8.0])
def test_yarns_slide_where_half_their_stress_exceeds_the_shear_modulus(shear):
    """Sliding by gamma along the load takes G gamma^2/2 and gives back s gamma^2/4."""
    law = HypoelasticLaw.linear(500.0, 200.0, shear)
    model = straight_strip("warp", 20.0, 21.6, 0.81, increments=40, across=20)
    plain = MembraneSolver().run(model, law)
    differentiated, _ = MembraneSolver().run_with_sensitivity(model, law)
    assert plain.unstable == differentiated.unstable
    assert plain.unstable[0].endswith(" mm of elongation")
    narrow = np.exp(-0.24 * np.log1p(np.array(model.elongations) / 20.0))
    stress = plain.load / (model.load_factor * 12.5 * narrow * 0.81)
    assert 2 * shear < stress[len(stress) - len(plain.unstable)] < 2.5 * shear


LEVELS = np.linspace(0.0, 1.0, 101)[1:]
#: Moduli that depend on the strain, MPa.
LOADED_LAW = HypoelasticLaw(
    np.array([900.0, -150.0, 12.0, 14.0, 0.0, -400.0, 300.0, 120.0, 0.0, 2000.0, -900.0, 500.0])
)


def solved(response, slope, levels=LEVELS, **accuracy):
    """Return the increments that are solved where the response follows a function of the level."""
    increments = SolvedIncrements(levels, **accuracy)
    while not increments.are_complete:
        level = levels[increments.current]
        increments.accept(response(level), slope(level))
    return increments


def reading_error(increments, response, slope):
    exact = response(increments.levels)
    at = increments.solved
    reading = increments.read(exact[at], slope(increments.levels[at]))
    return np.abs(reading - exact).max() / np.abs(exact).max()


@pytest.mark.parametrize("error", [1e-3, 1e-4, 1e-6])
def test_reading_keeps_the_accuracy(error):
    def response(x):
        return np.tanh(4 * x) + 0.2 * np.sin(12 * x)

    def slope(x):
        return 4 / np.cosh(4 * x) ** 2 + 2.4 * np.cos(12 * x)

    increments = solved(response, slope, error=error)
    assert reading_error(increments, response, slope) < error
    assert len(increments.solved) < (60 if error > 1e-5 else 101)


def test_fewer_increments_are_solved_where_the_response_is_smooth():
    increments = solved(lambda x: x + x**3, lambda x: 1 + 3 * x**2)
    assert increments.solved[:3] == [0, 1, 2]
    assert 12 <= len(increments.solved) < 20
    assert increments.solved[-1] == 99


@pytest.mark.parametrize(
    ("rate", "error", "most"), [(1.0, 1e-6, 14), (2.0, 1e-4, 11), (2.0, 1e-6, 27)]
)
def test_steps_grow_to_a_share_of_the_error_that_is_allowed(rate, error, most):
    def response(x):
        return np.sin(rate * x)

    def slope(x):
        return rate * np.cos(rate * x)

    increments = solved(response, slope, smallest_count=4, error=error)
    assert len(increments.solved) <= most
    assert 0.05 * error < reading_error(increments, response, slope) < 0.25 * error


@pytest.mark.parametrize("kink", [0.505, 0.5099, 0.5001, 0.57])
def test_every_increment_is_solved_at_a_kink(kink):
    def response(x):
        return np.minimum(x, kink)

    def slope(x):
        return np.where(x < kink, 1.0, 0.0)

    increments = solved(response, slope)
    first = int(100 * kink) - 1
    assert {first, first + 1} <= {*increments.solved}
    assert len(increments.solved) < 40
    # Of a kink within an increment of 1 % more is not known.
    assert reading_error(increments, response, slope) < 1e-4


def test_a_change_of_stability_is_found_to_the_increment():
    increments = SolvedIncrements(LEVELS)
    while not increments.are_complete:
        level = LEVELS[increments.current]
        increments.accept(level, 1.0, is_stable=not 0.355 < level < 0.725)
    assert increments.unstable.tolist() == list(range(35, 72))
    assert len(increments.solved) < 30


def test_few_increments_are_all_solved():
    increments = solved(np.sqrt, lambda x: 0.5 / np.sqrt(x), LEVELS[::9])
    assert increments.solved == list(range(12))
    values = np.random.default_rng(1).random((12, 3))
    assert increments.read(values) is values


@pytest.fixture(scope="module")
def strip():
    return bias_strip(50.0, 56.0, 0.8, increments=60, across=2, along=4, angle=30.0)


def run(model, law=LOADED_LAW):
    solver = MembraneSolver()
    return solver.run_with_sensitivity(model, law, ["beta_3", "beta_11"])[0]


def test_strip_is_read_as_if_all_increments_were_solved(strip):
    chosen, full = run(strip), run(replace(strip, unloaded=True))
    assert chosen.iterations < 0.5 * full.iterations
    for name in ("load", "load_slope", "path", "path_slope"):
        values, expected = getattr(chosen, name), getattr(full, name)
        assert values.shape == expected.shape
        assert np.abs(values - expected).max() < 2e-5 * np.abs(expected).max()
    for name, reaction in full.reactions.items():
        assert chosen.reactions[name] == pytest.approx(reaction, abs=1e-5 * np.abs(full.load).max())


def test_steps_of_large_strains_follow_the_path():
    law = HypoelasticLaw.linear(500.0, 200.0, 15.0)
    model = bias_strip(20.0, 31.0, 0.8, increments=64, across=2, along=4)
    full = run(replace(model, unloaded=True), law).load
    assert np.abs(run(model, law).load - full).max() < 1e-7 * full.max()


def test_an_unloaded_strip_is_solved_at_every_increment(strip):
    levels = [*strip.elongations, *strip.elongations[-2::-1]]
    history = run(replace(strip, elongations=levels[:70], unloaded=True))
    assert history.iterations >= 2 * 70
