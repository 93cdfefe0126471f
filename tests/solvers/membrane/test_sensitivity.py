"""solvers/membrane/sensitivity.py: derivatives of bubbles, sheets, strips, closed membranes."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.forms.ratio import SplineCrimp, SplineRatio
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import SLACK, TENSION, BubbleModel, SheetCord, default_increments
from bubblefit.meshes.cylinder_model import ForceTable, axial_table
from bubblefit.meshes.disk import disk_mesh, disk_modes, metric_modes
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.runs.verification.thin_walls import ISOTROPIC
from bubblefit.runs.verification.thin_walls import sphere_model as sphere
from bubblefit.solvers.base import DifferentiatingSolver, parameters_of
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial import cKDTree

from ...builders.fortran import BETA, LAWS
from ...builders.laws import TABLE_3_2
from ...support.refusals import complaint
from .cases import MODELS, TRILINEAR_LAW

PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
MODEL = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
)
LAW = HypoelasticLaw(BETA, 0.24, [0.13, 0.13, 0.13])
#: Without tension, at which moduli that are held below zero strain have a kink of their slope.
PARAMETERS = tuple(name for name in parameters_of(LAW, MODEL) if name not in TENSION)
OFFSET = "pressure_offset"
TIGHT = 1e-10


def extrapolated_differences(model, law, name, step, tolerance=TIGHT):
    """Return extrapolated central differences of load and displacement by a parameter."""

    def run(by):
        if name == "nu12":
            moved = model, replace(law, nu12=law.nu12 + by)
        elif name in model.parameters:
            moved = model.with_parameters({name: by}), law
        else:
            entry = np.arange(len(law.beta)) == int(name.removeprefix("beta_"))
            moved = model, law.with_beta(law.beta + by * entry)
        history = MembraneSolver(tolerance).run(*moved)
        return history.load, history.displacement

    def central(by):
        return [(a - b) / (2 * by) for a, b in zip(run(by), run(-by), strict=True)]

    return [(4 * a - b) / 3 for a, b in zip(central(step / 2), central(step), strict=True)]


#: Nine increments: points pass breaks and knots inside of them.
TRILINEAR = LAWS["tri-linear"]
KNOTS = [[0.0, 0.01, 0.03, 0.06, 0.13], [0.0, 0.04, 0.08, 0.13], [0.0, 0.05, 0.13]]
SPLINE = HypoelasticLaw(
    np.array([20.0, 10.0, 12.0, 140.0, 110.0, 130.0, 190.0, 800, 650, 450, 420, 600]), 0.24,
    [0.13, 0.13, 0.13], form=Spline.at(KNOTS),
)  # fmt: skip


@pytest.mark.parametrize(
    ("law", "names", "move"),
    [
        (LAW, PARAMETERS, 0.01),
        (replace(LAW, thickness_change="incompressible"), PARAMETERS, 0.01),
        # Strains beyond a short range: held moduli still depend on the coefficients.
        (replace(LAW, strain_range=[0.02, 0.03, 0.02]), ["beta_4", "beta_9", "beta_1"], 1e-4),
        (TRILINEAR, [n for i, n in enumerate(PARAMETERS) if i % 4 or i > 11], 1e-4),
        (replace(SPLINE, thickness_change="incompressible"), parameters_of(SPLINE), 1e-3),
    ],
    ids=["cubic", "incompressible", "held", "trilinear", "spline"],
)
def test_derivatives_of_a_bubble_by_each_parameter(law, names, move):
    history, slopes = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, law, names)
    assert slopes.shape == (*history.displacement.shape, len(names))
    for name, slope in zip(names, np.moveaxis(slopes, -1, 0), strict=True):
        # The field bends with the angle of the yarns: a shorter step is as near as others are.
        way = 0.1 * move if name == "turn" else move
        _, expected = extrapolated_differences(MODEL, law, name, way / np.abs(slope).max())
        assert np.abs(slope - expected).max() < 1e-5 * np.abs(expected).max(), name
        if move == 0.01:  # the first frame, too, is right to 1e-5 of its own largest
            first = np.abs(slope[0] - expected[0]).max()
            assert first < 2e-5 * np.abs(expected[0]).max(), name


CORDS = [
    SheetCord([[-80.0, 10.0], [60.0, 55.0]], ForceTable([0.0, 0.01, 1.0], [0.0, 200.0, 9e4])),
    SheetCord([[0.0, -100.0], [0.0, 100.0]], axial_table(2e4), prestrain=1e-3, tension_only=False),
]


@pytest.mark.parametrize(
    ("thickness_change", "cords"), [("constant", ()), ("incompressible", ()), ("constant", CORDS)]
)
def test_derivatives_of_a_sheet_by_all_its_parameters(thickness_change, cords):
    """A whole disk that is neither flat nor taut, with a rim that moves."""
    law, mesh = replace(LAW, thickness_change=thickness_change), disk_mesh(100.0, 64)
    modes = disk_modes(mesh.points / 100.0, 10)
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    points = mesh.points + np.outer(3.0 * modes["z0_1"] - 4.0 * modes["z0_xy"], [0, 0, 1])
    points[:, 2] += 0.01 * x - 1e-4 * y**2
    pressures = 1e-3 * np.array([22.0, 97.0, 186.0])
    steps = default_increments(pressures)
    rim = mesh.points[mesh.node_sets["rim"]]
    strains = metric_modes(mesh.points[:, :2] / 100.0, 3)
    model = BubbleModel(
        replace(mesh, points=points), 0.81, pressures, steps, modes=modes, slack=(0.002, -0.001),
        tension=(1.5, 0.5), strains=strains,
        strain=2e-3 * strains["metric_fill_x"] + 4e-3 * strains["metric_shear_1"],
        rim_motion=np.array([p / 0.186 * (0.01 * rim + (0.3, 0.0, 1.0)) for p in steps]),
        cords=cords,
    )  # fmt: skip
    names = [*SLACK, *TENSION, *modes, *strains, OFFSET, "beta_11", "nu12", "thickness"]
    slopes = MembraneSolver(TIGHT).run_with_sensitivity(model, law, names)[1]
    for j, name in enumerate(names):
        if name in ("z0_x", "z0_xx", "z0_xxy", "z0_yyy", "metric_warp_x", "metric_shear_y"):
            continue
        # A short step: where shear turns its sign, G12 has a kink.
        _, expected = extrapolated_differences(
            model, law, name, 1e-5 / np.abs(slopes[..., j]).max()
        )
        for frame in range(3):
            off = np.abs(slopes[frame, ..., j] - expected[frame]).max()
            assert off < 2e-5 * np.abs(expected[frame]).max(), (name, frame)


def test_derivatives_do_not_depend_on_the_method(monkeypatch):
    solver = MembraneSolver(TIGHT)
    assert isinstance(solver, DifferentiatingSolver)
    history, together = solver.run_with_sensitivity(MODEL, LAW, PARAMETERS)
    for name in ("beta_5", "nu12", OFFSET):
        alone = solver.run_with_sensitivity(MODEL, LAW, [name])[1]
        near = together[..., PARAMETERS.index(name)]
        assert alone[..., 0] == pytest.approx(near, rel=1e-9, abs=1e-9 * np.abs(alone).max())
    room = 1e-8 * np.abs(together).max()
    _, warm = solver.run_with_sensitivity(MODEL, LAW, PARAMETERS, guess=history.path)
    assert warm == pytest.approx(together, rel=1e-6, abs=room)
    plain = MembraneSolver(TIGHT).run(MODEL, LAW)
    assert history.displacement == pytest.approx(plain.displacement, abs=1e-9)
    for name in plain.reactions:
        assert history.reactions[name] == pytest.approx(plain.reactions[name], rel=1e-6, abs=1e-4)
    assert (history.path_slope[MODEL.reported] == together).all()
    assert (together[:, MODEL.mesh.node_sets["rim"]] == 0).all()
    monkeypatch.setattr(factorisation, "LARGEST_BAND", 0)
    sparse = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, LAW, PARAMETERS)[1]
    assert sparse == pytest.approx(together, rel=1e-5, abs=room)


def test_derivatives_of_a_spline_through_a_cubic_are_those_of_the_cubic():
    assert "beta_12" in complaint(MembraneSolver().run_with_sensitivity, MODEL, SPLINE, ["beta_12"])
    values = [LAW.modulus(n, KNOTS[1]) for n in ("G12", "E2", "E1")]
    form = Spline.at([KNOTS[1]] * 3)
    spline = HypoelasticLaw(np.ravel(values), 0.24, LAW.strain_range, form=form)
    a, by_values = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, spline)
    b, by_coefficients = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, LAW)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-8)
    expected = by_values @ np.kron(np.eye(3), np.vander(KNOTS[1], 4))  # d values / d coefficients
    assert expected == pytest.approx(by_coefficients, abs=1e-7 * np.abs(by_coefficients).max())


RATIO_LAW = HypoelasticLaw([12.0, 240.0, 120.0, 600.0, -150.0], 0.24, form=LoadRatio())
LEVELS = (0.03, 0.1, 0.2)
SHEET_TIGHT = 1e-11
STRAIN_RATIO_LAW = HypoelasticLaw(
    [12.0, 14.0, 240.0, 160.0, 600.0, 400.0, 120.0, -150.0], 0.24, [0.1, 0.1, 0.3],
    form=SplineRatio.at([[0.0, 0.1], [0.0, 0.1], [0.0, 0.3]]),
)  # fmt: skip
CRIMP_LAW = HypoelasticLaw(
    [*STRAIN_RATIO_LAW.beta[:-2], 0.6, 1.5, 8.0], 0.24, [0.1, 0.1, 0.3],
    form=SplineCrimp(STRAIN_RATIO_LAW.form.knots),
)  # fmt: skip


@pytest.mark.parametrize(
    ("part", "law"),
    [(part, law) for part in MODELS for law in (RATIO_LAW, CRIMP_LAW)]
    + [(part, STRAIN_RATIO_LAW) for part in ("bubble", "bias")],
)
def test_derivatives_of_ratio_laws_through_the_history(part, law):
    model, size = MODELS[part], law.form.size
    names = [*(f"beta_{i}" for i in range(size)), "nu12"]
    history, slope = MembraneSolver(SHEET_TIGHT).run_with_sensitivity(model, law, names)
    for j, name in enumerate(names):
        step = 1e-5 if name == "nu12" else 3e-4  # a longer one reaches over kinks of the ratio
        change = step * (np.arange(size + 1) == j)
        ahead, behind = (
            MembraneSolver(SHEET_TIGHT).run(model, replace(
                law, beta=law.beta + sign * change[:-1], nu12=0.24 + sign * change[-1]))
            for sign in (1, -1)
        )  # fmt: skip
        moved = (ahead.displacement - behind.displacement) / (2 * step)
        room = 1e-6 * np.abs(moved).max() + 1e-13 / step
        np.testing.assert_allclose(slope[..., j], moved, atol=room)
        if history.load_slope is not None:
            pulled = (ahead.load - behind.load) / (2 * step)
            room = 1e-6 * np.abs(pulled).max() + 1e-11 / step
            np.testing.assert_allclose(history.load_slope[:, j], pulled, atol=room)


def test_turned_yarns_turn_the_field_and_have_exact_derivatives():
    whole = BubbleModel(disk_mesh(100.0, 48), 0.81, LEVELS)
    x, y, _ = whole.mesh.points.T
    raised = whole.mesh.points.copy()
    raised[:, 2] = 3e-4 * (1e4 - x**2 - y**2) * (1 + 0.005 * x)
    curved = replace(whole, mesh=replace(whole.mesh, points=raised), slack=(0.001, 0.0))
    solver, law, turn = MembraneSolver(SHEET_TIGHT), HypoelasticLaw.linear(600.0, 300.0, 14.0), 0.15
    model = curved.with_parameters({"turn": turn})
    for name, step in {"turn": 1e-4, "slack_warp": 1e-5}.items():
        _, slope = solver.run_with_sensitivity(model, law, [name])
        ahead, behind = (
            solver.run(model.with_parameters({name: sign * step}), law).displacement
            for sign in (1, -1)
        )
        moved = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(slope[..., 0], moved, atol=1e-6 * np.abs(moved).max())
    # A quarter turn of a flat disk carries the field along.
    here = solver.run(whole, law).displacement[-1]
    there = solver.run(whole.with_parameters({"turn": np.pi / 2}), law).displacement[-1]
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    nearest = cKDTree(whole.mesh.points).query(whole.mesh.points @ turned.T)[1]
    np.testing.assert_allclose(there[nearest], here @ turned.T, atol=1e-6)


UNIAXIAL_LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2))
UNIAXIAL_PARAMETERS = parameters_of(UNIAXIAL_LAW)
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


def check_derivatives(model, law, names, move=0.05):
    history, slope = MembraneSolver(1e-12).run_with_sensitivity(model, law, names)
    assert history.load_slope is not None
    assert history.load_slope.shape == (len(model.elongations), len(names))
    for j, name in enumerate(names):
        largest = np.abs(history.load_slope[:, j]).max()
        load, displacement = extrapolated_differences(model, law, name, move / largest, 1e-12)
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
        check_derivatives(straight_strip_of(direction, 10), TRILINEAR_LAW, [*own[1:], "nu12"])
        own += ["nu12", "beta_11"] if direction == "fill" else ["nu12"]
    law = replace(UNIAXIAL_LAW, thickness_change=thickness_change)
    check_derivatives(straight_strip_of(direction, 10), law, [*own, "thickness"])


@pytest.mark.parametrize(
    ("law", "names", "move"),
    [
        (UNIAXIAL_LAW, UNIAXIAL_PARAMETERS[:13], 0.05),
        (
            replace(UNIAXIAL_LAW, thickness_change="incompressible"),
            UNIAXIAL_PARAMETERS[1:13:4],
            0.05,
        ),
        # In eight increments most points pass a break inside of one.
        (
            TRILINEAR_LAW,
            [n for i, n in enumerate(UNIAXIAL_PARAMETERS[:13]) if i % 4 or i > 11],
            0.001,
        ),
    ],
    ids=["cubic", "incompressible", "trilinear"],
)
def test_derivatives_of_the_bias_strip(law, names, move):
    check_derivatives(bias_strip_of(8, across=4, along=12), law, names, move)


def test_slopes_by_all_moduli_equal_those_by_pressure():
    slope = MembraneSolver(1e-11).run_with_sensitivity(sphere(2, [0.01]), ISOTROPIC)[1][-1]
    up, down = (
        MembraneSolver(1e-11).run(sphere(2, [p]), ISOTROPIC).displacement[-1]
        for p in (0.01001, 0.00999)
    )
    by_pressure = (up - down) / 2e-3
    assert slope @ ISOTROPIC.beta == pytest.approx(
        -by_pressure, abs=2e-3 * np.abs(by_pressure).max()
    )
