"""[bubble.sheet]: what it takes, what it makes of the data, and what a fit says of it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import findings as sheet_report
from bubblefit.experiments.bubble.findings import NOT_BELIEVED
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.section import SheetSettings
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial, measured_sheet, with_sheet
from bubblefit.experiments.bubble.targets import FieldTarget, counted_from, with_place_numbers
from bubblefit.experiments.data_files import Output
from bubblefit.experiments.fitted import FittedTest
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.nuisance import Nuisance
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, elliptic_disk_mesh, metric_modes
from bubblefit.meshes.outline import Outline
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.reports.kinds import bubble as report
from bubblefit.runs.fit import fit
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup, known_bubble
from ...support.paths import load_script
from ...support.refusals import complaint, raised

PRESSURES = (0.02, 0.09, 0.19)
EDGE = Outline.circle(100.0)


@pytest.mark.parametrize("outline", [EDGE, Outline(120.0, 80.0, 30.0)], ids=["circle", "ellipse"])
def test_the_surface_the_rim_and_modes_follow_the_measurement(outline):
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


UNEVEN = load_script("benchmarks/bench_sheet.py")


def project(folder: Path, sheet: str, **what: float) -> Path:
    UNEVEN.write_test(folder, UNEVEN.Uneven(**what), PRESSURES, 112)
    path = folder / "project.toml"
    path.write_text(UNEVEN.project_text(PRESSURES, 112, sheet))
    return path


def field_of(heights, count: int = 900) -> DisplacementField:
    random = np.random.default_rng(3)
    r, turn = 100.0 * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    places = np.column_stack([r * np.cos(turn), r * np.sin(turn)])
    x, y = places.T / 100
    moved = np.column_stack([0.5 * x, -0.2 * y * x, 10 * (1 - x**2 - y**2) + 1.0])
    z = None if heights is None else heights(x, y)
    return DisplacementField(0.05, places, moved, z=z)


def test_heights_that_are_not_there_or_too_few():
    field, heights = field_of(None), field_of(lambda x, y: x, count=60)
    for one, problem in ((field, "no height z"), (heights, "60 points are too few for degree 8")):
        raised(InputError, problem, measured_sheet, SheetSettings(measured=True), EDGE, [one])


def targets() -> tuple[list[FieldTarget], np.ndarray, np.ndarray]:
    random = np.random.default_rng(5)
    nodes = disk_mesh(100.0, 16).points[:, :2]
    frames = random.standard_normal((3, len(nodes), 3))
    some = []
    for k, p in enumerate(PRESSURES):
        keep = np.delete(np.arange(len(nodes)), k)
        sample = sp.csr_matrix(np.eye(len(nodes))[keep])
        some.append(FieldTarget(p, random.standard_normal((len(keep), 3)), sample))
    return with_place_numbers(some, nodes), nodes, frames


def history(frames: np.ndarray) -> History:
    return History(np.array(PRESSURES), frames, np.zeros(3), np.zeros(3))


@pytest.mark.parametrize("normalise", ["mm", "e"])
def test_a_field_that_is_constant_in_pressure_is_taken_out(normalise):
    some, nodes, frames = targets()
    plain = FieldObjective(some, normalise, constant=(0, 2))
    field = np.random.default_rng(6).standard_normal((len(nodes), 3)) * [1, 0, 1]
    moved = [replace(t, displacement=t.displacement + t.at(field)) for t in some]
    other = FieldObjective(moved, normalise, constant=(0, 2))
    other.scales = plain.scales
    residual = plain.residual(history(frames), {})
    np.testing.assert_allclose(other.residual(history(frames), {}), residual, atol=1e-12)
    # Along y nothing is taken out.
    whole = FieldObjective(some, normalise).residual(history(frames), {})
    middle = np.concatenate([np.repeat([False, True, False], n) for n in plain.sizes[::3]])
    np.testing.assert_allclose(residual[middle], whole[middle])
    assert np.abs(residual - whole)[~middle].min() > 1e-6
    taken = other.constant_field(frames) - plain.constant_field(frames)
    seen = [t.place_numbers for t in some]
    np.testing.assert_allclose(taken[np.concatenate(seen)],
                               np.concatenate([t.at(field) for t in some]), atol=1e-12)  # fmt: skip
    slope = np.random.default_rng(8).standard_normal((*frames.shape, 2))
    ahead, behind = (plain.residual(history(frames + s * slope[..., 1]), {}) for s in (0.5, -0.5))
    np.testing.assert_allclose(plain.jacobian(None, slope)[:, 1], ahead - behind, atol=1e-12)


def test_displacements_counted_from_a_loaded_frame():
    some, nodes, frames = targets()
    fields = np.random.default_rng(9).standard_normal(frames.shape)
    some = [replace(t, displacement=t.at(u)) for t, u in zip(some, fields, strict=True)]
    relative = counted_from(some, 1)
    assert [(t.pressure, t.since) for t in relative] == [(PRESSURES[0], 1), (PRESSURES[2], 1)]
    for number, (target, k) in enumerate(zip(relative, (0, 2), strict=True)):
        # Each frame misses a node of its own.
        assert len(target.displacement) == len(nodes) - 2
        np.testing.assert_allclose(target.displacement, target.at(fields[k] - fields[1]))
        np.testing.assert_allclose(target.of(frames, number), target.at(frames[k] - frames[1]))
    objective = FieldObjective(relative, "mm")
    once, again = (objective.residual(history(f), {}) for f in (frames, frames + 1.0))
    np.testing.assert_allclose(again, once, atol=1e-12)

    def origin(count):
        which = np.arange(1, count + 1)
        return replace(some[1].subset(which), sample=some[1].sample[which])

    # A frame shares half of its places at least.
    count = len(some[0].displacement)
    half = -(-count // 2)
    (found,) = counted_from([some[0], origin(half)], 1)
    assert len(found.displacement) == half
    assert f"share {half - 1} of {count}" in complaint(counted_from, [some[0], origin(half - 1)], 1)


def loaded(folder: Path, pressures: Sequence[float]) -> Path:
    mesh = disk_mesh(100.0, 112)
    model = BubbleModel(mesh, UNEVEN.THICKNESS, pressures, default_increments(pressures))
    moved = MembraneSolver().run(model, UNEVEN.law()).displacement
    places = mesh.points[:, :2] + moved[0, :, :2]
    for k, field in enumerate(moved):
        table = np.hstack([places, field - moved[0]])
        file = folder / f"t_{k:02d}.csv"
        np.savetxt(file, table, "%.7f", ",", header="x,y,dx,dy,dz", comments="")
    text = UNEVEN.project_text(pressures, 112, f"from_pressure = {1e3 * pressures[0]:g}\n")
    path = folder / "project.toml"
    path.write_text(text.replace('columns = { z = "z" }\n', ""))
    return path


def test_priors_are_a_block_of_their_own(tmp_path):
    path = project(tmp_path, "modes = 3\nprior = 2.0\nslack = true\nslack_prior = 0.1")
    problem = fit_setup(path).problem()
    y = problem.unknowns.at(UNEVEN.law().beta[[2, 3, 6, 7, 10, 11]])
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


def test_a_loaded_reference_picture_gives_the_moduli_back(tmp_path):
    """Taken at 5 kPa, when the apex is 9 mm high; 0.8 % with places taken for those at rest."""
    result = fit(read_project(loaded(tmp_path, (0.005, 0.03, 0.09, 0.19))))
    off = UNEVEN.errors(result.law, result.best.reached)
    assert max(off.values()) < 0.002, off
    assert result.result["sheet"]["from_pressure_kPa"] == pytest.approx(5.0)


def test_a_sheet_as_it_was_gives_the_moduli_back(tmp_path):
    """Height 4 mm, slack 0.05 %, a rim that moves by 2 mm, little noise on few points."""
    sheet = 'surface = "measured"\nrim = "measured"\nslack = true\nmisfit = 0.01'
    path = project(tmp_path, sheet, noise=0.002, slack=0.0005)
    # From other starts the sheet folds on the way, and every such analysis takes seconds.
    path.write_text(path.read_text().replace("seed = 3", "seed = 4"))
    result = fit(read_project(path))
    off = UNEVEN.errors(result.law, result.best.reached)
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
    truth = UNEVEN.model(UNEVEN.Uneven(), PRESSURES, 112).mesh
    z = truth.points[:, 2] - truth.points[truth.node_sets["rim"], 2].mean()
    np.testing.assert_allclose(table["z0_mm"], z, atol=0.03)


TWO = (0.02, 0.2)
MESH = disk_mesh(100.0, 16)
#: mm, the surface in the reference picture; that of the two modes is 1 and x in radii.
Z0 = 0.02 * MESH.points[:, 0] - 0.5
MODES = {"z0_1": np.ones(len(Z0)), "z0_x": MESH.points[:, 0] / 100}
METRIC = {"metric_warp_1": 0.1, "metric_fill_1": 0.2, "metric_shear_1": 0.3}
SURFACE = SimpleNamespace(rms=np.array([0.0456]))
ALL = SheetSettings(
    measured=True, modes=2, slack=True, moving_rim=True, constant=(0, 2), since=0, metric=1
)  # of a project never all at once


def fitted(sheet: SheetSettings) -> tuple[Any, Any]:
    model = BubbleModel(MESH, 0.8, TWO, TWO)
    nuisance, values = [], {}
    if sheet.measured:
        points = np.column_stack([MESH.points[:, :2], Z0])
        model = replace(model, mesh=replace(MESH, points=points))
    if sheet.modes:
        model = replace(model, modes=MODES)
        nuisance += [Nuisance(name, -9.0, 9.0, "mm", name, 1.0) for name in MODES]
        values |= {"z0_1": 2.0, "z0_x": 3.0}
    if sheet.slack:
        names = ("slack_warp", "slack_fill")
        nuisance += [Nuisance(name, -1.0, 1.0, "%", name, 0.01) for name in names]
        values |= {"slack_warp": 0.05, "slack_fill": -0.1}
    if sheet.metric:
        strains = metric_modes(MESH.points[:, :2], 100.0, 1)
        nuisance += [Nuisance(name, -1.0, 1.0, "%", name, 0.01) for name in strains]
        model, values = replace(model, strains=strains), values | METRIC
    if sheet.moving_rim:
        motion = np.zeros((2, len(MESH.node_sets["rim"]), 3))
        motion[1, 3] = 0.3, 0.4, 1.2
        model = replace(model, rim_motion=motion)
    moved = np.zeros((2, len(Z0), 3))
    at_nodes = [FieldTarget(p, moved[k] + [0.3, 0.0, -0.4]) for k, p in enumerate(TWO)]
    targets = with_place_numbers(at_nodes, MESH.points[:, :2])
    objective = FieldObjective(targets, "mm", constant=sheet.constant)
    comparison = Comparison("b", model, MembraneSolver(), objective, tuple(nuisance))
    history = History(np.array(TWO), moved, np.zeros(3), np.zeros(3))
    test = SimpleNamespace(name="b", sheet=sheet, pressures=TWO, outline=Outline.circle(100.0))
    surface = SimpleNamespace(surface=SURFACE if sheet.measured else None)
    fit = SimpleNamespace(comparisons=[comparison], nuisance=values, histories=[history])
    return SimpleNamespace(test=test, sheet=surface, known=None), fit


def test_every_number():
    found = sheet_report.sheet_numbers(*fitted(ALL))
    heights = Z0 + 2.0 + 0.03 * MESH.points[:, 0]
    assert found == {
        "used": [
            "measured surface", "modes", "slack", "metric", "measured rim", "constant field",
            "loaded reference frame",
        ],
        "surface_mm": pytest.approx({"least": heights.min(), "largest": heights.max()}),
        "measured_rms_mm": 0.0456, "modes_mm": {"z0_1": 2.0, "z0_x": 3.0},
        "metric_percent": METRIC,
        "slack_percent": pytest.approx([0.05, -0.1]), "rim_motion_mm": pytest.approx(1.3),
        "constant_field_rms_mm": pytest.approx({"dx": 0.3, "dz": 0.4}),
        "from_pressure_kPa": pytest.approx(20.0),
    }  # fmt: skip
    (line,) = sheet_report.sheet_lines(found)
    for words in ("0.046 mm", "2 modes", "-3.50 to 6.50 mm", "0.050 % in warp, -0.100 % in fill",
                  "3 unknowns: 0.100 % in warp, 0.200 % in fill, 0.300 % in shear", "1.30 mm",
                  "dx 0.30 mm RMS, dz 0.40 mm RMS", "20 kPa"):  # fmt: skip
        assert words in line
    nothing = sheet_report.sheet_numbers(*fitted(SheetSettings()))
    assert nothing.pop("surface_mm") == {"least": 0.0, "largest": 0.0}
    assert nothing.keys() < found.keys() and not any(nothing.values())


@pytest.mark.parametrize(
    ("sheet", "known", "warned"),
    [
        (SheetSettings(), None, 1), (SheetSettings(slack=True), None, 1),
        (SheetSettings(moving_rim=True), None, 1), (SheetSettings(measured=True), None, 0),
        (SheetSettings(modes=1), None, 0), (SheetSettings(since=0), None, 0),
        (SheetSettings(constant=(0,)), None, 0), (SheetSettings(), "a law", 0),
    ],
)  # fmt: skip
def test_a_sheet_of_which_nothing_is_known(sheet, known, warned):
    own = SimpleNamespace(sheet=sheet, match_by="points")
    test = SimpleNamespace(known=known, test=own, by_this_model=False)
    assert [n.kind for n in sheet_report.warnings_of(test)] == [sheet_report.FLAT_SHEET] * warned


#: kPa and mm, as unknowns of a fit.
PRESSURE, SHIFT = 2.0, [0.1, -0.2, 0.3]


def test_offsets_are_what_was_fitted_in_the_units_said(tmp_path):
    on = [
        (f"{name} = false", f"{name} = true") for name in ("displacement_offset", "pressure_offset")
    ]
    setup = fit_setup(known_bubble(tmp_path, *on))
    (prepared,), problem = setup.tests, setup.problem()
    law = prepared.known
    y = problem.unknowns.at(law.beta)
    y[problem.unknowns.size :] = [*SHIFT, PRESSURE]
    point = problem.evaluate(y, False, warm=False)
    # As many kPa are added to every pressure of the model, which is in MPa.
    (history,) = point.histories
    model = prepared.test.model().with_parameters({"pressure_offset": 1e-3 * PRESSURE})
    moved = MembraneSolver().run(model, law)
    np.testing.assert_allclose(history.displacement, moved.displacement, atol=1e-7)
    nuisance = problem.unknowns.nuisance_values("bubble", y)
    reached = np.array([0.1, 0.2, 0.3])
    own = setup.comparisons_of(prepared)
    fitted = FittedTest(own, (history,), nuisance, law, [law], reached, reached, None)
    findings = report.findings(prepared, fitted)
    said = findings.numbers["nuisance"]
    assert said["pressure_offset_kPa"] == pytest.approx(PRESSURE)
    assert said["displacement_offset_mm"] == pytest.approx(SHIFT)
    assert "offset_y -0.200 mm" in findings.lines[-1] and "2.000 kPa" in findings.lines[-1]
    # The law is the known solution, over the strain that was reached.
    assert findings.numbers["moduli_error"] == {"E1": 0.0, "E2": 0.0, "G12": 0.0}
    ranges = {"E1": [0.0, 0.1], "E2": [0.0, 0.2], "G12": [0.0, 0.3]}
    assert findings.numbers["moduli_error_range"] == ranges
    facts = dict(report.show(prepared, fitted, findings, Output(tmp_path / "out")).facts)
    assert facts["pressure offset, kPa"] == "2.000"
    assert facts["displacement offset, mm"] == "0.100, -0.200, 0.300"
    # At the known moduli every difference is the offsets': mean |dx| + |dy| + |dz|.
    off = moved.displacement + SHIFT - np.array([f.displacement for f in prepared.fields])
    assert findings.numbers["mean_abs_mm"] == pytest.approx(np.abs(off).sum(axis=2).mean())


RADIUS = 80.0
POINTS = RADIUS * np.random.default_rng(2).uniform(-0.7, 0.7, (60, 2))


def disk_surface(points: np.ndarray) -> np.ndarray:
    x, y = points.T / RADIUS
    return np.column_stack([3 + x - 2 * x * y, 0.5 * y**3 - x**2 * y])


def test_disk_polynomial_is_recovered():
    found = fit_disk_polynomial(POINTS, disk_surface(POINTS), RADIUS, 3)
    there = np.array([[0.0, 0.0], [80.0, 0.0], [-40.0, 60.0]])
    np.testing.assert_allclose(found.at(there), disk_surface(there), atol=1e-12)
    assert (found.radius, found.degree, found.coefficients.shape) == (RADIUS, 3, (10, 2))
    assert found.rms == pytest.approx([0.0, 0.0], abs=1e-12)
    # Of a lower degree the first is met, the second is not.
    low = fit_disk_polynomial(POINTS, disk_surface(POINTS), RADIUS, 2)
    left = disk_surface(POINTS) - low.at(POINTS)
    assert low.rms == pytest.approx(np.sqrt(np.mean(left**2, axis=0)))
    assert low.rms[0] < 1e-12 and low.rms[1] > 0.01
    mean = fit_disk_polynomial(np.eye(2), np.array([[1.0], [4.0]]), 1.0, 0)
    assert mean.at(np.zeros((1, 2))).tolist() == [[2.5]] and mean.rms.tolist() == [1.5]
    assert fit_disk_polynomial(POINTS[:20], disk_surface(POINTS[:20]), RADIUS, 3).degree == 3
    for points in (POINTS[:19], POINTS * [1.0, 0.0]):
        assert "degree: " in complaint(fit_disk_polynomial, points, disk_surface(points), RADIUS, 3)
