"""Exact derivatives of the displacements against central differences of tight analyses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import SLACK, BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.solvers.base import DifferentiatingSolver, parameters_of
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...published_laws import TABLE_4_2

BETA = 1e3 * np.array(TABLE_4_2)
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
MODEL = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
)
LAW = HypoelasticLaw(BETA, 0.24, [0.13, 0.13, 0.13])
PARAMETERS = parameters_of(LAW, MODEL)
OFFSET = "pressure_offset"
TIGHT = 1e-10


def changed(
    law: HypoelasticLaw, model: BubbleModel, name: str, step: float
) -> tuple[BubbleModel, HypoelasticLaw]:
    """Model and law with one parameter moved."""
    if name == "nu12":
        return model, replace(law, nu12=law.nu12 + step)
    if name in model.parameters:
        return model.with_parameters({name: step}), law
    beta = law.beta.copy()
    beta[int(name.removeprefix("beta_"))] += step
    return model, law.with_beta(beta)


def differences(
    law: HypoelasticLaw,
    name: str,
    slope: np.ndarray,
    move: float = 0.01,
    model: BubbleModel = MODEL,
) -> np.ndarray:
    """Central differences, extrapolated, with the step that moves the bubble by `move` mm."""

    def central(step: float) -> np.ndarray:
        ahead, behind = (
            MembraneSolver(TIGHT).run(*changed(law, model, name, by)).displacement
            for by in (step, -step)
        )
        return (ahead - behind) / (2 * step)

    step = move / np.abs(slope).max()
    return (4 * central(step / 2) - central(step)) / 3


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
@pytest.mark.parametrize("name", PARAMETERS)
def test_each_parameter(name: str, thickness_change: str) -> None:
    law = replace(LAW, thickness_change=thickness_change)
    history, slope = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, law, [name])
    assert slope.shape == (*history.displacement.shape, 1)
    expected = differences(law, name, slope)
    assert np.abs(slope[..., 0] - expected).max() < 1e-5 * np.abs(expected).max()
    # Not only the largest: the first frame, too, is right to 1e-5 of its own largest.
    first = np.abs(slope[0, ..., 0] - expected[0]).max()
    assert first < 2e-5 * np.abs(expected[0]).max()


def sheet(thickness_change: str) -> tuple[BubbleModel, HypoelasticLaw]:
    """A whole disk that is neither flat nor taut, with a rim that moves."""
    mesh = disk_mesh(100.0, 64)
    modes = disk_modes(mesh.points, 100.0, 10)
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    points = mesh.points + np.outer(3.0 * modes["z0_1"] - 4.0 * modes["z0_xy"], [0, 0, 1])
    points[:, 2] += 0.01 * x - 1e-4 * y**2
    pressures = 1e-3 * np.array([22.0, 97.0, 186.0])
    steps = default_increments(pressures)
    rim = mesh.points[mesh.node_sets["rim"]]
    motion = np.array([p / 0.186 * (0.01 * rim + (0.3, 0.0, 1.0)) for p in steps])
    model = BubbleModel(
        replace(mesh, points=points), 0.81, pressures, steps,
        modes=modes, slack=(0.002, -0.001), rim_motion=motion,
    )  # fmt: skip
    return model, replace(LAW, thickness_change=thickness_change)


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_the_parameters_of_the_sheet_together(thickness_change: str) -> None:
    """Heights and slack, along the path: the law's own history depends on them, too."""
    model, law = sheet(thickness_change)
    names = [*SLACK, *model.modes, OFFSET, "beta_11"]
    slopes = MembraneSolver(TIGHT).run_with_sensitivity(model, law, names)[1]
    for j, name in enumerate(names):
        if name in ("z0_x", "z0_xx", "z0_xxy", "z0_yyy"):
            continue
        expected = differences(law, name, slopes[..., j], model=model)
        for frame in range(3):
            off = np.abs(slopes[frame, ..., j] - expected[frame]).max()
            assert off < 2e-5 * np.abs(expected[frame]).max(), (name, frame)


def test_where_the_moduli_are_held() -> None:
    """Strains beyond a short range: held moduli still depend on the coefficients.

    A small move, so that next to no point passes from one side of the kink to the other.
    """
    law = HypoelasticLaw(BETA, 0.24, [0.02, 0.03, 0.02])
    for name in ("beta_4", "beta_9", "beta_1"):
        _, slope = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, law, [name])
        expected = differences(law, name, slope, 1e-4)
        assert np.abs(slope[..., 0] - expected).max() < 1e-5 * np.abs(expected).max()


TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
    [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]],
)  # fmt: skip
USED = [name for i, name in enumerate(PARAMETERS) if i % 4 or i > 11]


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
@pytest.mark.parametrize("name", USED)
def test_each_parameter_of_a_trilinear_law(name: str, thickness_change: str) -> None:
    """Nine increments: points pass breaks inside of them. A small move, as for held moduli."""
    law = replace(TRILINEAR, thickness_change=thickness_change)
    _, slope = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, law, [name])
    expected = differences(law, name, slope, 1e-4)
    assert np.abs(slope[..., 0] - expected).max() < 1e-5 * np.abs(expected).max()


def test_a_trilinear_law_has_no_derivative_by_what_it_does_not_have() -> None:
    _, slope = MembraneSolver().run_with_sensitivity(MODEL, TRILINEAR, ["beta_0", "beta_3"])
    assert not slope[..., 0].any() and slope[..., 1].any()


def test_a_trilinear_bubble_hardly_depends_on_the_increments() -> None:
    few = MembraneSolver(TIGHT).run(MODEL, TRILINEAR)
    assert len(MODEL.increments) == 9
    levels = np.interp(np.linspace(0, 9, 73)[1:], range(10), [0, *MODEL.increments])
    many = MembraneSolver(TIGHT).run(replace(MODEL, increments=levels), TRILINEAR)
    reached = many.strain_max
    assert (reached > TRILINEAR.form.breaks[:, 1]).all()
    apex = MODEL.mesh.node_sets["apex"][0]
    assert few.displacement[:, apex, 2] == pytest.approx(many.displacement[:, apex, 2], rel=1e-4)


def test_all_at_once_equals_one_by_one() -> None:
    solver = MembraneSolver(TIGHT)
    assert isinstance(solver, DifferentiatingSolver)
    together = solver.run_with_sensitivity(MODEL, LAW, PARAMETERS)[1]
    for j, name in enumerate(PARAMETERS):
        alone = solver.run_with_sensitivity(MODEL, LAW, [name])[1]
        assert alone[..., 0] == pytest.approx(
            together[..., j], rel=1e-9, abs=1e-9 * np.abs(alone).max()
        )


def test_a_warm_start_changes_no_derivative() -> None:
    solver = MembraneSolver(TIGHT)
    history, cold = solver.run_with_sensitivity(MODEL, LAW)
    _, warm = solver.run_with_sensitivity(MODEL, LAW, guess=history.path)
    assert warm == pytest.approx(cold, rel=1e-6, abs=1e-8 * np.abs(cold).max())


def test_the_history_is_that_of_a_plain_run() -> None:
    history, slope = MembraneSolver().run_with_sensitivity(MODEL, LAW)
    plain = MembraneSolver().run(MODEL, LAW)
    assert history.displacement == pytest.approx(plain.displacement, abs=1e-9)
    for name in plain.reactions:
        assert history.reactions[name] == pytest.approx(plain.reactions[name], rel=1e-6, abs=1e-4)
    assert history.path_slope is not None
    assert (history.path_slope[MODEL.reported] == slope).all()
    assert (slope[:, MODEL.mesh.node_sets["rim"]] == 0).all()


def test_fine_meshes_take_the_other_factorisation() -> None:
    """SuperLU and the band give the same derivatives."""
    from bubblefit.solvers.membrane import factorisation

    solver = MembraneSolver(TIGHT)
    band = solver.run_with_sensitivity(MODEL, LAW)[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(factorisation, "LARGEST_BAND", 0)
        sparse = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, LAW)[1]
    assert sparse == pytest.approx(band, rel=1e-5, abs=1e-8 * np.abs(band).max())


def test_an_unknown_parameter_is_named() -> None:
    with pytest.raises(InputError, match="beta_12"):
        MembraneSolver().run_with_sensitivity(MODEL, LAW, ["beta_12"])


KNOTS = [[0.0, 0.01, 0.03, 0.06, 0.13], [0.0, 0.04, 0.08, 0.13], [0.0, 0.05, 0.13]]
SPLINE = HypoelasticLaw(
    np.array([20.0, 10.0, 12.0, 140.0, 110.0, 130.0, 190.0, 800, 650, 450, 420, 600]), 0.24,
    [0.13, 0.13, 0.13], form=Spline.at(KNOTS),
)  # fmt: skip


@pytest.mark.parametrize("name", parameters_of(SPLINE))
def test_each_parameter_of_a_spline(name: str) -> None:
    """Points pass several knots inside of an increment, where slopes are continuous."""
    history, slope = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, SPLINE, [name])
    assert (history.strain_max[:2] > 0.05).all()
    expected = differences(SPLINE, name, slope, 1e-3)
    assert np.abs(slope[..., 0] - expected).max() < 1e-5 * np.abs(expected).max()


def test_every_value_of_a_spline_unless_named() -> None:
    _, slope = MembraneSolver().run_with_sensitivity(MODEL, SPLINE)
    assert slope.shape[-1] == 12
    with pytest.raises(InputError, match="beta_12"):
        MembraneSolver().run_with_sensitivity(MODEL, SPLINE, ["beta_12"])


def test_a_spline_through_a_cubic_is_that_cubic() -> None:
    """Solution and derivatives: those by the values are those by the coefficients."""
    values = [LAW.modulus(n, KNOTS[1]) for n in ("G12", "E2", "E1")]
    form = Spline.at([KNOTS[1]] * 3)
    spline = HypoelasticLaw(np.ravel(values), 0.24, LAW.strain_range, form=form)
    a, by_values = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, spline)
    b, by_coefficients = MembraneSolver(TIGHT).run_with_sensitivity(MODEL, LAW)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-8)
    powers = np.kron(np.eye(3), np.vander(KNOTS[1], 4))  # d values / d coefficients
    expected = by_values @ powers
    assert expected == pytest.approx(by_coefficients, abs=1e-7 * np.abs(by_coefficients).max())
