"""experiments/bubble/sheet.py: [bubble.sheet], its data, its states, its fits."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import sheet as shapes
from bubblefit.experiments.bubble.findings import NOT_BELIEVED
from bubblefit.experiments.bubble.section import SheetSettings
from bubblefit.experiments.bubble.sheet import (
    _degree,
    _on_disk,
    fit_disk_polynomial,
    measured_sheet,
    sheet_nuisance,
    with_sheet,
)
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.fit import fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup
from ...support.paths import load_script
from ...support.refusals import complaint, raised

PRESSURES = (0.02, 0.09, 0.19)
EDGE = Outline.circle(100.0)


@pytest.mark.parametrize("outline", [EDGE, Outline(120.0, 80.0, 30.0)], ids=["circle", "ellipse"])
def test_surface_rim_and_modes_follow_the_measurement(outline):
    def bumpy(x, y):
        return 612.0 + 3.0 * (1 - x**2 - y**2) - 2.0 * x * y + x**3

    def moved(x, y, p):
        return 20.0 * p * np.column_stack([0.5 * x, -0.2 * y * x, 11.0 - 10 * (x**2 + y**2)])

    mesh = elliptic_disk_mesh(outline, 112)
    flat = BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))
    random = np.random.default_rng(3)
    r, turn = np.sqrt(random.random(900)), 2 * np.pi * random.random(900)
    places = outline.places(np.column_stack([r * np.cos(turn), r * np.sin(turn)]))
    x, y = places.T / 100
    fields = [DisplacementField(p, places, moved(x, y, p), z=bumpy(x, y)) for p in PRESSURES]
    sheet = SheetSettings(measured=True, degree=6, modes=6, moving_rim=True)
    model = with_sheet(flat, sheet, outline, measured_sheet(sheet, outline, fields))
    rim = mesh.node_sets["rim"]
    x, y = mesh.points[:, :2].T / 100
    heights = bumpy(x, y) - bumpy(x, y)[rim].mean()
    np.testing.assert_allclose(model.mesh.points[:, 2], heights, atol=1e-8)
    expected = [moved(x[rim], y[rim], p) for p in flat.increments]
    np.testing.assert_allclose(model.rim_motion, expected, atol=1e-8)
    assert list(model.modes) == ["z0_1", "z0_x", "z0_y", "z0_xx", "z0_xy", "z0_yy"]
    for name, mode in model.modes.items():
        np.testing.assert_allclose(mode[rim], 0.0, atol=1e-12)
        assert np.abs(mode).max() > 0.1, name
    # Points of another outline do not reach the edge.
    with pytest.raises(InputError, match="points go out to"):
        measured_sheet(sheet, Outline(200.0, 160.0, 30.0), fields)
    metres = [replace(f, points=f.points / 1e3) for f in fields]
    assert 'length_unit = "m"' in complaint(measured_sheet, sheet, outline, metres)


UNEVEN_SHEET = load_script("benchmarks/bench_sheet.py")


def uneven_project(folder: Path, sheet: str, **what: float) -> Path:
    UNEVEN_SHEET.write_test(folder, UNEVEN_SHEET.Uneven(**what), PRESSURES, 112)
    path = folder / "project.toml"
    path.write_text(UNEVEN_SHEET.project_text(PRESSURES, 112, sheet))
    return path


def field_of(heights, count: int = 900) -> DisplacementField:
    random = np.random.default_rng(3)
    r, turn = 100.0 * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    places = np.column_stack([r * np.cos(turn), r * np.sin(turn)])
    x, y = places.T / 100
    moved = np.column_stack([0.5 * x, -0.2 * y * x, 10 * (1 - x**2 - y**2) + 1.0])
    z = None if heights is None else heights(x, y)
    return DisplacementField(0.05, places, moved, z=z)


def test_missing_or_too_few_heights_are_refused():
    field, heights = field_of(None), field_of(lambda x, y: x, count=60)
    for one, problem in ((field, "no height z"), (heights, "60 points are too few for degree 8")):
        raised(InputError, problem, measured_sheet, SheetSettings(measured=True), EDGE, [one])


def loaded_reference_project(folder: Path, pressures: Sequence[float]) -> Path:
    mesh = disk_mesh(100.0, 112)
    model = BubbleModel(mesh, UNEVEN_SHEET.THICKNESS, pressures, default_increments(pressures))
    moved = MembraneSolver().run(model, UNEVEN_SHEET.law()).displacement
    places = mesh.points[:, :2] + moved[0, :, :2]
    for k, field in enumerate(moved):
        table = np.hstack([places, field - moved[0]])
        file = folder / f"t_{k:02d}.csv"
        np.savetxt(file, table, "%.7f", ",", header="x,y,dx,dy,dz", comments="")
    text = UNEVEN_SHEET.project_text(pressures, 112, f"from_pressure = {1e3 * pressures[0]:g}\n")
    path = folder / "project.toml"
    path.write_text(text.replace('columns = { z = "z" }\n', ""))
    return path


def test_priors_are_a_block_of_their_own(tmp_path):
    path = uneven_project(tmp_path, "modes = 3\nprior = 2.0\nslack = true\nslack_prior = 0.1")
    problem = fit_setup(path).problem()
    y = problem.unknowns.at(UNEVEN_SHEET.law().beta[[2, 3, 6, 7, 10, 11]])
    assert problem.unknowns.nuisance.names == ("z0_1", "z0_x", "z0_y", "slack_warp", "slack_fill")
    y[-5:] = 1.0, -2.0, 0.5, 0.05, 0.1
    point = problem.evaluate(y, True, warm=False)
    # 0.5 mm against sqrt(points / 20) of it.
    weight = 0.5 * np.sqrt(20 / len(disk_mesh(100.0, 112).points))
    expected = weight * np.array([0.5, -1.0, 0.25, 0.5, 1.0])
    np.testing.assert_allclose(point.residual[-5:], expected)
    assert problem.blocks.norms(point.residual)[-1] == pytest.approx(np.linalg.norm(expected))
    assert problem.scale.shape == point.residual.shape
    for j, step in ((6, 0.01), (7, 0.01), (9, 1e-3)):
        move = step * np.eye(len(y))[j]
        ahead, behind = (problem.evaluate(y + m, False, warm=False).residual for m in (move, -move))
        column = (ahead - behind) / (2 * step)
        assert np.abs(point.jacobian[:, j] - column).max() < 1e-3 * np.abs(column).max(), j


def test_reference_picture_at_a_fifth_of_the_pressure_gives_the_moduli(tmp_path):
    """G12 is 15 % and E1 0.6 % off where places at rest are estimated by the pressures alone."""
    result = fit(read_project(loaded_reference_project(tmp_path, (0.05, 0.12, 0.24))))
    off = UNEVEN_SHEET.errors(result.law, result.best.reached)
    assert max(off.values()) < 0.002, off
    assert float(result.law.modulus("G12", 0.05)) == pytest.approx(
        float(UNEVEN_SHEET.law().modulus("G12", 0.05)), rel=0.02
    )
    assert result.result["sheet"]["from_pressure_kPa"] == pytest.approx(50.0)


def test_uneven_slack_sheet_gives_the_moduli(tmp_path):
    """Height 4 mm, slack 0.05 %, a rim that moves by 2 mm, little noise on few points."""
    sheet = 'surface = "measured"\nrim = "measured"\nslack = true\nmisfit = 0.01'
    path = uneven_project(tmp_path, sheet, noise=0.002, slack=0.0005)
    # From other starts the sheet folds on the way, and every such analysis takes seconds.
    path.write_text(path.read_text().replace("seed = 3", "seed = 4"))
    result = fit(read_project(path))
    off = UNEVEN_SHEET.errors(result.law, result.best.reached)
    assert max(off.values()) < 0.005, off
    said = result.result["sheet"]
    assert said["used"] == ["measured surface", "slack", "measured rim"]
    assert said["slack_percent"] == pytest.approx([0.05, 0.05], abs=0.01)
    assert said["rim_motion_mm"] == pytest.approx(2.0, abs=0.3)
    assert np.ptp([*said["surface_mm"].values()]) == pytest.approx(4.4, abs=0.1)
    assert NOT_BELIEVED not in result.result["warnings"]
    page = result.report(tmp_path / "out").read_text()
    assert "reference_surface.png" in page and "rim as measured" in page
    table = pd.read_csv(tmp_path / "out" / "reference_surface.csv")
    truth = UNEVEN_SHEET.model(UNEVEN_SHEET.Uneven(), PRESSURES, 112).mesh
    z = truth.points[:, 2] - truth.points[truth.node_sets["rim"], 2].mean()
    np.testing.assert_allclose(table["z0_mm"], z, atol=0.03)


RADIUS = 80.0
POINTS = RADIUS * np.random.default_rng(2).uniform(-0.7, 0.7, (60, 2))


def disk_surface(points: np.ndarray) -> np.ndarray:
    x, y = points.T / RADIUS
    return np.column_stack([3 + x - 2 * x * y, 0.5 * y**3 - x**2 * y])


def test_disk_polynomial_is_recovered():
    found = fit_disk_polynomial(POINTS, disk_surface(POINTS), RADIUS, 3)
    there = np.array([[0.0, 0.0], [80.0, 0.0], [-40.0, 60.0]])
    np.testing.assert_allclose(found.values_at(there), disk_surface(there), atol=1e-12)
    assert (found.radius, found.degree, found.coefficients.shape) == (RADIUS, 3, (10, 2))
    assert found.rms == pytest.approx([0.0, 0.0], abs=1e-12)
    # Of a lower degree the first is met, the second is not.
    low = fit_disk_polynomial(POINTS, disk_surface(POINTS), RADIUS, 2)
    left = disk_surface(POINTS) - low.values_at(POINTS)
    assert low.rms == pytest.approx(np.sqrt(np.mean(left**2, axis=0)))
    assert low.rms[0] < 1e-12 and low.rms[1] > 0.01
    mean = fit_disk_polynomial(np.eye(2), np.array([[1.0], [4.0]]), 1.0, 0)
    assert mean.values_at(np.zeros((1, 2))).tolist() == [[2.5]] and mean.rms.tolist() == [1.5]
    assert fit_disk_polynomial(POINTS[:20], disk_surface(POINTS[:20]), RADIUS, 3).degree == 3
    for points in (POINTS[:19], POINTS * [1.0, 0.0]):
        assert "degree: " in complaint(fit_disk_polynomial, points, disk_surface(points), RADIUS, 3)


@pytest.mark.parametrize(
    ("stress", "state"),
    [
        ([2.0, 1.0, 0.0], 0), ([2.0, 1.0, 1.5], 1), ([2.0, -0.1, 0.0], 1), ([0.0, 3.0, 0.0], 1),
        ([-1.0, -2.0, 0.0], 2), ([0.0, 0.0, 0.0], 2), ([1.0, 1.0, 0.99], 0),
    ],
)  # fmt: skip
def test_states_follow_from_principal_stresses(stress, state):
    """Taut, wrinkled, loose, in a sheet of 3 MPa at most."""
    assert shapes.states(np.array([stress, [3.0, 3.0, 0.0]]))[0] == state


def test_values_at_places_are_interpolated_at_nodes():
    places = np.mgrid[-50.0:51.0:5.0, -50.0:51.0:5.0].reshape(2, -1).T
    places = places[np.hypot(*(places - [20.0, 0.0]).T) > 16.0]
    values = np.column_stack([places[:, 0], 2 * places[:, 1], places.sum(axis=1)])
    nodes = np.array([[1.0, 2.0], [-33.3, 12.1], [20.0, 0.0], [90.0, 0.0]])
    found = shapes.interpolated_at_nodes(nodes, places, values)
    np.testing.assert_allclose(found[:2], [[1.0, 4.0, 3.0], [-33.3, 24.2, -21.2]])
    assert np.isnan(found[2:]).all()
    np.testing.assert_array_equal(shapes.interpolated_at_nodes(places, places, values), values)
    for few in (places[places[:, 1] == 50.0], places[:2]):
        assert np.isnan(shapes.interpolated_at_nodes(nodes, few, np.zeros((len(few), 3)))).all()


def measured_surface(reach: float, height: float = 0.0, nan: bool = False) -> DisplacementField:
    turn = np.linspace(0, 2 * np.pi, 200)
    r = 100.0 * reach * np.sqrt(np.linspace(0, 1, 200))
    points = np.column_stack([r * np.cos(9 * turn), r * np.sin(9 * turn)])
    z = 600.0 + height * points[:, 0] / (200.0 * reach)
    if nan:
        z[100:] = np.nan
    return DisplacementField(0.1, points, np.zeros((200, 3)), z=z)


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (measured_surface(0.85), ""),
        (measured_surface(0.849), "sheet.surface: points go out to 85 %"),
        (measured_surface(0.9, nan=True), "sheet.surface: points go out to 63 %"),
        (measured_surface(0.9, 49.0), ""),
        (measured_surface(0.9, 52.0), "sheet.surface: heights"),
    ],
)
def test_heights_of_a_reference_picture_are_fitted(field, words):
    asked = Outline.circle(100.0), [field]
    surface, rim = SheetSettings(measured=True, degree=2), SheetSettings(moving_rim=True, degree=2)
    if words:
        assert complaint(measured_sheet, surface, *asked).startswith(words)
    else:
        assert measured_sheet(surface, *asked).surface is not None
    # The motion of the rim asks for no height.
    if field.points.max() < 84.95:
        assert "sheet.rim: points go out to 85 %" in complaint(measured_sheet, rim, *asked)
    else:
        assert _on_disk(field, asked[0], "rim").sum() == 200
    far = replace(field, points=field.points + 300.0)
    assert "sheet.rim: points go out to 0 %" in complaint(measured_sheet, rim, asked[0], [far])


def test_priors_of_a_sheet_weigh_as_twenty_points():
    model: Any = SimpleNamespace(modes={"z0_1": None, "z0_x": None}, strains={})
    scale = np.array([1.0, 4.0, 100.0])
    found = sheet_nuisance(SheetSettings(modes=2, prior=2.0, slack=True, misfit=0.1), model, scale)
    weight = pytest.approx(0.1 * np.sqrt(20) / 4)
    told = [(n.name, n.lower, n.upper, n.unit, n.scale, n.prior, n.weight) for n in found]
    assert told == [
        ("z0_1", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("z0_x", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("slack_warp", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
        ("slack_fill", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
    ]
    model.strains = {"metric_warp_1": None}
    found += sheet_nuisance(SheetSettings(metric=1, metric_prior=0.2, misfit=0.1), model, scale)[
        -1:
    ]
    assert (found[-1].upper, found[-1].scale, found[-1].weight) == (
        pytest.approx(1.2),
        0.01,
        weight,
    )
    assert [n.model_parameter for n in found] == [n.name for n in found]


def test_unknown_tensions_are_bounded_by_six_deviations_and_by_zero():
    model: Any = SimpleNamespace(modes={}, strains={})
    settings = SheetSettings(tension=(0.3, 2.0), tension_prior=0.1)
    warp, fill = sheet_nuisance(settings, model, np.ones(3))
    assert (warp.name, fill.name) == ("tension_warp", "tension_fill")
    assert (warp.lower, warp.start, warp.upper) == pytest.approx((0.0, 0.3, 0.9))
    assert (fill.lower, fill.start, fill.upper) == pytest.approx((1.4, 2.0, 2.6))
    assert warp.prior == fill.prior == 0.1 and warp.unit == "N/mm"


@pytest.mark.parametrize(
    ("degree", "moving_rim", "count", "expected"),
    [(None, False, 5000, 8), (None, True, 5000, 10), (None, True, 250, 9), (None, True, 113, 8),
     (None, True, 5, 8), (6, True, 5000, 6)],
)  # fmt: skip
def test_degree_of_a_measured_rim_is_larger_where_points_allow(degree, moving_rim, count, expected):
    settings = SheetSettings(degree=degree, moving_rim=moving_rim)
    assert _degree(settings, count) == expected
