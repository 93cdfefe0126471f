"""Derivatives of bubbles, and the stability of the law."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import axial_table
from bubblefit.meshes.bubble_model import SLACK, BubbleModel, SheetCord, default_increments
from bubblefit.meshes.cylinder_model import ForceTable
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.disk_modes import disk_modes, metric_modes
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.base import DifferentiatingSolver, instability, parameters_of
from bubblefit.solvers.membrane import bubble, factorisation
from bubblefit.solvers.membrane.increments import load_labels
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.fortran import BETA, LAWS
from ...inference.cases import MODEL as CASE_MODEL
from ...support.refusals import complaint

PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
MODEL = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
)
LAW = HypoelasticLaw(BETA, 0.24, [0.13, 0.13, 0.13])
PARAMETERS = parameters_of(LAW, MODEL)
OFFSET = "pressure_offset"
TIGHT = 1e-10


def differences(model, law, name, step, tolerance=TIGHT):
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
def test_each_parameter(law, names, move):
    history, slopes = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, law, names)
    assert slopes.shape == (*history.displacement.shape, len(names))
    for name, slope in zip(names, np.moveaxis(slopes, -1, 0), strict=True):
        # The field bends with the angle of the yarns: a shorter step is as near as others are.
        way = 0.1 * move if name == "turn" else move
        _, expected = differences(MODEL, law, name, way / np.abs(slope).max())
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
def test_the_parameters_of_the_sheet_together(thickness_change, cords):
    """A whole disk that is neither flat nor taut, with a rim that moves."""
    law, mesh = replace(LAW, thickness_change=thickness_change), disk_mesh(100.0, 64)
    modes = disk_modes(mesh.points, 100.0, 10)
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    points = mesh.points + np.outer(3.0 * modes["z0_1"] - 4.0 * modes["z0_xy"], [0, 0, 1])
    points[:, 2] += 0.01 * x - 1e-4 * y**2
    pressures = 1e-3 * np.array([22.0, 97.0, 186.0])
    steps = default_increments(pressures)
    rim = mesh.points[mesh.node_sets["rim"]]
    strains = metric_modes(mesh.points[:, :2], 100.0, 3)
    model = BubbleModel(
        replace(mesh, points=points), 0.81, pressures, steps, modes=modes, slack=(0.002, -0.001),
        strains=strains, strain=2e-3 * strains["metric_fill_x"] + 4e-3 * strains["metric_shear_1"],
        rim_motion=np.array([p / 0.186 * (0.01 * rim + (0.3, 0.0, 1.0)) for p in steps]),
        cords=cords,
    )  # fmt: skip
    names = [*SLACK, *modes, *strains, OFFSET, "beta_11"]
    slopes = MembraneSolver(TIGHT).run_with_sensitivity(model, law, names)[1]
    for j, name in enumerate(names):
        if name in ("z0_x", "z0_xx", "z0_xxy", "z0_yyy", "metric_warp_x", "metric_shear_y"):
            continue
        # A short step: where shear turns its sign, G12 has a kink.
        _, expected = differences(model, law, name, 1e-5 / np.abs(slopes[..., j]).max())
        for frame in range(3):
            off = np.abs(slopes[frame, ..., j] - expected[frame]).max()
            assert off < 2e-5 * np.abs(expected[frame]).max(), (name, frame)


def test_derivatives_do_not_depend_on_how_they_are_computed(monkeypatch):
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


def test_a_spline_through_a_cubic_is_that_cubic():
    assert "beta_12" in complaint(MembraneSolver().run_with_sensitivity, MODEL, SPLINE, ["beta_12"])
    values = [LAW.modulus(n, KNOTS[1]) for n in ("G12", "E2", "E1")]
    form = Spline.at([KNOTS[1]] * 3)
    spline = HypoelasticLaw(np.ravel(values), 0.24, LAW.strain_range, form=form)
    a, by_values = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, spline)
    b, by_coefficients = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, LAW)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-8)
    expected = by_values @ np.kron(np.eye(3), np.vander(KNOTS[1], 4))  # d values / d coefficients
    assert expected == pytest.approx(by_coefficients, abs=1e-7 * np.abs(by_coefficients).max())


#: Sewn 4 % too long both ways: pressed together at low pressures, taut from 97 kPa on.
LOOSE = replace(CASE_MODEL, slack=(0.04, 0.04))
EVEN = HypoelasticLaw.linear(500.0, 500.0, 150.0)


def judged(monkeypatch, model, law):
    every = replace(model, pressures=model.increments)
    solver, pairs = MembraneSolver(), []
    membrane = solver._membrane(every, law)
    tangent, count = membrane.tangent, len(membrane.free)
    accept = bubble.IncrementRecord.accept

    def look(self, i, u):
        tangent.factor()
        whole = np.linalg.inv(tangent.solve(np.eye(count)))
        least = float(np.linalg.eigvalsh(0.5 * (whole + whole.T))[0])
        pairs.append((least > 0, tangent.definite()))
        accept(self, i, u)

    with monkeypatch.context() as patch:
        patch.setattr(bubble.IncrementRecord, "accept", look)
        solver._prepared = (every, membrane)
        found = solver.run(every, law)
    pressures = 1e3 * np.array(every.pressures)
    unstable = np.array([not stable for stable, _ in pairs])
    assert found.unstable == load_labels(pressures[unstable], "kPa")
    return pairs


def test_a_bubble_that_is_stable_at_the_last_pressure_and_not_before():
    history = MembraneSolver().run(LOOSE, EVEN)
    differentiated, _ = MembraneSolver().run_with_sensitivity(LOOSE, EVEN)
    assert history.unstable == differentiated.unstable == ("22 kPa", "59 kPa")
    assert history.stable is False
    assert instability(history.unstable) == "unstable equilibrium at 22 kPa, 59 kPa"
    assert MembraneSolver().run(replace(LOOSE, pressures=(0.251, 0.3)), EVEN).unstable == ()
    places = load_labels(np.arange(1.0, 6.0), "mm")
    assert instability(places[:3]).endswith("at 1 mm, 2 mm, 3 mm")
    assert "at 5 of the reported loads, from 1 mm to 5 mm" in instability(places)
    assert instability(()) == instability(None) == ""


@pytest.mark.parametrize("largest", [factorisation.LARGEST_BAND, 0], ids=["band", "sparse"])
def test_the_judgement_is_that_of_the_least_eigenvalue(monkeypatch, largest):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", largest)
    pairs = judged(monkeypatch, LOOSE, EVEN)
    assert pairs == 4 * [(False, False)] + 5 * [(True, True)]


@pytest.mark.parametrize("shear", [4.0, 8.0])
def test_yarns_slide_where_half_the_stress_along_them_is_more_than_the_shear_modulus(shear):
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
