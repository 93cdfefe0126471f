"""[bubble.sheet]: what it takes, what it makes of the data, and what a fit says of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.bubble import findings as sheet_report
from bubblefit.experiments.bubble import report
from bubblefit.experiments.bubble.findings import FLAT_SHEET, NOT_BELIEVED
from bubblefit.experiments.bubble.objective import (
    FieldObjective,
    FieldTarget,
    counted_from,
    with_places,
)
from bubblefit.experiments.bubble.section import Sheet
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial, measured_sheet, with_sheet
from bubblefit.experiments.kinds import Output
from bubblefit.inference.comparison import Nuisance
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.fit import fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...drawings import caught
from ...scripts import script

PRESSURES = (0.02, 0.09, 0.19)
EDGE = Outline.circle(100.0)


def test_modes_and_a_measured_rim_of_an_ellipse():
    outline = Outline(120.0, 80.0, 30.0)
    mesh = elliptic_disk_mesh(outline, 112)
    flat = BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))
    places = outline.places(np.random.default_rng(3).uniform(-0.7, 0.7, (400, 2)))
    far = outline.edge(120)[:, :2] * 0.99
    places = np.concatenate([places, far])
    tilt = 2.0 + 0.02 * places[:, 0]
    fields = [
        DisplacementField(p, places, np.outer(tilt, [0.0, 0.0, p]), z=0.1 * tilt) for p in PRESSURES
    ]
    sheet = Sheet(measured=True, degree=4, modes=6, moving_rim=True)
    model = with_sheet(flat, sheet, outline, measured_sheet(sheet, outline, fields))
    rim = mesh.node_sets["rim"]
    expected = PRESSURES[-1] * (2.0 + 0.02 * mesh.points[rim, 0])
    np.testing.assert_allclose(model.rim_motion[-1, :, 2], expected, atol=1e-9)
    np.testing.assert_allclose(model.mesh.points[:, 2], 0.002 * mesh.points[:, 0], atol=1e-9)
    for name, mode in model.modes.items():
        np.testing.assert_allclose(mode[rim], 0.0, atol=1e-12)
        assert np.abs(mode).max() > 0.1, name
    # Beyond the ellipse, within its circle: points of another outline do not reach the edge.
    with pytest.raises(InputError, match="points go out to"):
        measured_sheet(sheet, Outline(200.0, 160.0, 30.0), fields)


UNEVEN = script("benchmarks/uneven_test.py")


def project(folder: Path, sheet: str, **what: float) -> Path:
    """The project of a computed uneven test, and its files."""
    UNEVEN.write_test(folder, UNEVEN.Uneven(**what), PRESSURES, 112)
    path = folder / "project.toml"
    path.write_text(UNEVEN.project_text(PRESSURES, 112, sheet))
    return path


def prepared(path: Path):
    one = read_project(path)
    return prepare_fit(one, one.chosen(None, fitted=True))


@pytest.mark.parametrize(
    ("sheet", "field"),
    [
        ("prior = 2.0", "sheet.prior"),
        ("from_pressure = 90.0\n[bubble.nuisance]\ndisplacement_offset = true",
         "nuisance.displacement_offset"),
        ("modes = 46", "sheet.modes"),
    ],
)  # fmt: skip
def test_what_does_not_go_together(tmp_path, sheet, field):
    with pytest.raises(InputError) as error:
        read_project(project(tmp_path, sheet))
    assert field in str(error.value)


def field_of(heights, count: int = 900, reach: float = 1.0) -> DisplacementField:
    random = np.random.default_rng(3)
    r, turn = 100.0 * reach * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    places = np.column_stack([r * np.cos(turn), r * np.sin(turn)])
    x, y = places.T / 100
    moved = np.column_stack([0.5 * x, -0.2 * y * x, 10 * (1 - x**2 - y**2) + 1.0])
    z = None if heights is None else heights(x, y)
    return DisplacementField(0.05, places, moved, z=z)


def test_the_surface_and_the_rim_follow_the_measurement():
    def bumpy(x, y):
        return 612.0 + 3.0 * (1 - x**2 - y**2) - 2.0 * x * y + x**3

    field = field_of(bumpy)
    mesh = disk_mesh(100.0, 64)
    flat = BubbleModel(mesh, 0.81, (0.05, 0.1), default_increments((0.05, 0.1)))
    sheet = Sheet(measured=True, degree=6, moving_rim=True, modes=6)
    fields = [field, replace(field, pressure=0.1, displacement=2 * field.displacement)]
    model = with_sheet(flat, sheet, EDGE, measured_sheet(sheet, EDGE, fields))
    x, y = mesh.points[:, :2].T / 100
    expected = bumpy(x, y)
    rim = mesh.node_sets["rim"]
    np.testing.assert_allclose(model.mesh.points[:, 2], expected - expected[rim].mean(), atol=1e-8)
    at_rim = np.column_stack([0.5 * x[rim], -0.2 * y[rim] * x[rim], np.ones(len(rim))])
    share = np.array(flat.increments) / 0.05
    np.testing.assert_allclose(model.rim_motion, share[:, None, None] * at_rim, atol=1e-8)
    assert list(model.modes) == ["z0_1", "z0_x", "z0_y", "z0_xx", "z0_xy", "z0_yy"]


@pytest.mark.parametrize(
    ("field", "problem"),
    [
        (field_of(None), "hold no height z"),
        (field_of(lambda x, y: x, reach=0.7), "go out to 70 % of the radius"),
        (field_of(lambda x, y: 40 * x), "differ by 78.6 mm"),
        (field_of(lambda x, y: x, count=60), "60 points are too few for degree 8"),
    ],
    ids=["no z", "reach", "height", "few"],
)
def test_surfaces_that_are_not_known(field, problem):
    with pytest.raises(InputError, match=problem):
        measured_sheet(Sheet(measured=True), EDGE, [field])


def test_noise_of_the_surface_is_told():
    field = field_of(None)
    noise = 0.05 * np.random.default_rng(1).standard_normal((900, 1))
    found = fit_disk_polynomial(field.points, noise, 100.0, 4)
    assert found.rms[0] == pytest.approx(0.05, rel=0.1)
    with pytest.raises(InputError, match="do not determine"):
        fit_disk_polynomial(np.repeat(field.points[:3], 300, axis=0), noise, 100.0, 4)


def targets() -> tuple[list[FieldTarget], np.ndarray, np.ndarray]:
    """Three pressures at the nodes of a mesh, each with a node left out, and a model's frames."""
    random = np.random.default_rng(5)
    nodes = disk_mesh(100.0, 16).points[:, :2]
    frames = random.standard_normal((3, len(nodes), 3))
    some = []
    for k, p in enumerate(PRESSURES):
        keep = np.delete(np.arange(len(nodes)), k)
        import scipy.sparse as sp

        sample = sp.csr_matrix(np.eye(len(nodes))[keep])
        some.append(FieldTarget(p, random.standard_normal((len(keep), 3)), sample))
    return with_places(some, nodes), nodes, frames


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
    seen = [t.places for t in some]
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
    assert [t.pressure for t in relative] == [PRESSURES[0], PRESSURES[2]]
    for number, (target, k) in enumerate(zip(relative, (0, 2), strict=True)):
        # Each frame misses a node of its own.
        assert len(target.displacement) == len(nodes) - 2
        np.testing.assert_allclose(target.displacement, target.at(fields[k] - fields[1]))
        np.testing.assert_allclose(target.of(frames, number), target.at(frames[k] - frames[1]))
    objective = FieldObjective(relative, "mm")
    shift = np.ones_like(frames)
    once, again = (objective.residual(history(f), {}) for f in (frames, frames + shift))
    np.testing.assert_allclose(again, once, atol=1e-12)
    with pytest.raises(InputError, match="share 1 of"):
        only = replace(some[1], displacement=some[1].displacement[-1:], sample=some[1].sample[-1:],
                       places=some[1].places[-1:])  # fmt: skip
        counted_from([some[0], only], 1)


def loaded(folder: Path, pressures: Sequence[float], more: str = "") -> Path:
    """A project of a flat sheet whose reference picture was taken at the first of the pressures."""
    mesh = disk_mesh(100.0, 112)
    model = BubbleModel(mesh, UNEVEN.THICKNESS, pressures, default_increments(pressures))
    moved = MembraneSolver().run(model, UNEVEN.law()).displacement
    places = mesh.points[:, :2] + moved[0, :, :2]
    for k, field in enumerate(moved):
        table = np.hstack([places, field - moved[0]])
        np.savetxt(
            folder / f"t_{k:02d}.csv", table, "%.7f", ",", header="x,y,dx,dy,dz", comments=""
        )
    text = UNEVEN.project_text(pressures, 112, f"from_pressure = {1e3 * pressures[0]:g}\n{more}")
    path = folder / "project.toml"
    path.write_text(text.replace('columns = { z = "z" }\n', ""))
    return path


def test_places_of_a_loaded_picture_are_brought_back_to_rest(tmp_path):
    """All but a tenth of the 0.25 mm by which they have moved at 5 kPa."""
    setup = prepared(loaded(tmp_path, (0.005, 0.03, 0.19)))
    (test,) = setup.tests
    nodes = disk_mesh(100.0, 112).points[:, :2]
    before = np.abs(test.fields[-1].points - nodes).max()
    for field in test.matched:
        assert np.abs(field.points - nodes).max() < 0.1 * before
    assert before == pytest.approx(0.25, abs=0.01)


def test_places_of_another_picture_are_left(tmp_path):
    (test,) = prepared(project(tmp_path, "from_pressure = 20.0")).tests
    for own, read in zip(test.matched, test.fields, strict=True):
        np.testing.assert_array_equal(own.points, read.points)


def test_priors_are_a_block_of_their_own(tmp_path):
    path = project(tmp_path, "modes = 3\nprior = 2.0\nslack = true\nslack_prior = 0.1")
    problem = prepared(path).problem()
    y = problem.unknowns.at(UNEVEN.law().beta[[2, 3, 6, 7, 10, 11]])
    assert problem.unknowns.nuisance_names == ("z0_1", "z0_x", "z0_y", "slack_warp", "slack_fill")
    y[-5:] = 1.0, -2.0, 0.5, 0.05, 0.1
    point = problem.evaluate(y, True, warm=False)
    # 0.5 mm against sqrt(points / 20) of it.
    points = len(disk_mesh(100.0, 112).points)
    weight = 0.5 * np.sqrt(20 / points)
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
    result = fit(read_project(path))
    off = UNEVEN.errors(result.law, result.best.reached)
    assert max(off.values()) < 0.005, off
    said = result.result["sheet"]
    assert said["used"] == ["measured surface", "slack", "measured rim"]
    assert said["slack_percent"] == pytest.approx([0.05, 0.05], abs=0.01)
    assert said["rim_motion_mm"] == pytest.approx(2.0, abs=0.3)
    assert said["surface_mm"]["largest"] - said["surface_mm"]["least"] == pytest.approx(
        4.4, abs=0.1
    )
    assert NOT_BELIEVED not in result.result["warnings"]
    page = result.report(tmp_path / "out").read_text()
    assert "reference_surface.png" in page and "rim as measured" in page
    table = pd.read_csv(tmp_path / "out" / "reference_surface.csv")
    truth = UNEVEN.model(UNEVEN.Uneven(), PRESSURES, 112).mesh
    z = truth.points[:, 2] - truth.points[truth.node_sets["rim"], 2].mean()
    np.testing.assert_allclose(table["z0_mm"], z, atol=0.03)


@pytest.mark.parametrize(
    ("sheet", "believed", "words"),
    [
        ("", False, "sheet: flat and taut, its rim fixed"),
        ('rim = "measured"', False, "sheet: rim as measured, up to 2"),
        ("slack = true", False, "sheet: slack 0.000 % in warp"),
        ("modes = 3", True, "sheet: 3 modes of the surface; z0 from 0.00 to 0.00 mm"),
        ('constant_field = ["dz"]', True, "sheet: constant field taken out: dz 2."),
        ("from_pressure = 90.0", True, "sheet: displacements counted from 90 kPa"),
    ],
)
def test_a_result_says_what_it_knew_of_the_sheet(tmp_path, sheet, believed, words):
    path = project(tmp_path, sheet)
    path.write_text(path.read_text().replace("max_analyses = 60", "max_analyses = 2"))
    result = fit(read_project(path))
    (line,) = [one for one in result.findings["uneven"].lines if one.startswith("sheet: ")]
    assert line.startswith(words), line
    assert (NOT_BELIEVED in result.result["warnings"]) is not believed


TWO = (0.02, 0.2)
MESH = disk_mesh(100.0, 16)
#: mm, the surface in the reference picture; that of the two modes is 1 and x in radii.
Z0 = 0.02 * MESH.points[:, 0] - 0.5
MODES = {"z0_1": np.ones(len(Z0)), "z0_x": MESH.points[:, 0] / 100}
SURFACE = SimpleNamespace(rms=np.array([0.0456]))
ALL = Sheet(
    measured=True, modes=2, slack=True, moving_rim=True, constant=(0, 2), since=0
)  # of a project never all at once


def fitted(sheet: Sheet) -> tuple[Any, Any]:
    """Preparation and fit of a test with this sheet."""
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
    if sheet.moving_rim:
        motion = np.zeros((2, len(MESH.node_sets["rim"]), 3))
        motion[1, 3] = 0.3, 0.4, 1.2
        model = replace(model, rim_motion=motion)
    moved = np.zeros((2, len(Z0), 3))
    model_at = [FieldTarget(p, moved[k] + [0.3, 0.0, -0.4]) for k, p in enumerate(TWO)]
    targets = with_places(model_at, MESH.points[:, :2])
    objective = FieldObjective(targets, "mm", constant=sheet.constant)
    comparison = SimpleNamespace(model=model, nuisance=nuisance, objective=objective)
    history = History(np.array(TWO), moved, np.zeros(3), np.zeros(3))
    test = SimpleNamespace(name="b", sheet=sheet, pressures=TWO, outline=Outline.circle(100.0))
    surface = SimpleNamespace(surface=SURFACE if sheet.measured else None)
    fit = SimpleNamespace(comparisons=[comparison], nuisance=values, histories=[history])
    return SimpleNamespace(test=test, sheet=surface, known=None), fit


def numbers(sheet: Sheet) -> dict[str, Any]:
    return sheet_report.sheet_numbers(*fitted(sheet))


def test_every_number():
    found = numbers(ALL)
    heights = Z0 + 2.0 + 0.03 * MESH.points[:, 0]
    assert found == {
        "used": [
            "measured surface", "modes", "slack", "measured rim", "constant field",
            "loaded reference frame",
        ],
        "surface_mm": pytest.approx({"least": heights.min(), "largest": heights.max()}),
        "measured_rms_mm": 0.0456, "modes_mm": {"z0_1": 2.0, "z0_x": 3.0},
        "slack_percent": pytest.approx([0.05, -0.1]), "rim_motion_mm": pytest.approx(1.3),
        "constant_field_rms_mm": pytest.approx({"dx": 0.3, "dz": 0.4}),
        "from_pressure_kPa": pytest.approx(20.0),
    }  # fmt: skip
    assert numbers(Sheet()) == {
        "used": [], "surface_mm": {"least": 0.0, "largest": 0.0}, "measured_rms_mm": None,
        "modes_mm": {}, "slack_percent": None, "rim_motion_mm": None,
        "constant_field_rms_mm": None, "from_pressure_kPa": None,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("sheet", "words"),
    [
        (Sheet(), ["flat"]),
        (ALL, ["0.046 mm", "2 modes", "-3.50 to 6.50 mm", "0.050 % in warp, -0.100 % in fill",
               "1.30 mm", "dx 0.30 mm RMS, dz 0.40 mm RMS", "20 kPa"]),
        (Sheet(measured=True), ["0.046 mm", "-2.50 to 1.50 mm"]),
        (Sheet(modes=2), ["-1.00 to 5.00 mm"]), (Sheet(since=1), ["200 kPa"]),
    ],
)  # fmt: skip
def test_the_line_for_the_terminal(sheet, words):
    (line,) = sheet_report.sheet_lines(numbers(sheet))
    assert all(word in line for word in words), line


@pytest.mark.parametrize(
    ("sheet", "warned"),
    [
        (Sheet(), 1), (Sheet(slack=True), 1), (Sheet(moving_rim=True), 1),
        (Sheet(measured=True), 0), (Sheet(modes=1), 0), (Sheet(constant=(0,)), 0),
        (Sheet(since=0), 0),
    ],
)  # fmt: skip
def test_a_sheet_of_which_nothing_is_known(sheet, warned):
    test = SimpleNamespace(known=None, test=SimpleNamespace(sheet=sheet))
    assert [(n.kind, str(n)) for n in sheet_report.sheet_warnings(test)] == [
        (FLAT_SHEET, sheet_report.NOT_BELIEVED)
    ] * warned
    test.known = "a law"
    assert sheet_report.sheet_warnings(test) == []


def test_pictures_and_files(tmp_path, monkeypatch):
    drawn = caught(monkeypatch, report, "disk_charts")
    assert report.sheet_exhibit(*fitted(Sheet(slack=True)), Output(tmp_path)) == ([], [])
    assert not drawn and not list(tmp_path.iterdir())
    figures, files = report.sheet_exhibit(*fitted(ALL), Output(tmp_path, "b-"))
    names = ["b-reference_surface", "b-constant_field"]
    assert [name for name, _ in figures] == [f"{name}.png" for name in names]
    assert [name for name, _ in files] == [f"{name}.csv" for name in names]
    z0 = Z0 + 2.0 + 0.03 * MESH.points[:, 0]
    table = pd.read_csv(tmp_path / "b-reference_surface.csv")
    assert list(table.columns) == ["x_mm", "y_mm", "z0_mm"]
    expected = np.column_stack([MESH.points[:, :2], z0])
    np.testing.assert_allclose(table.to_numpy(), expected, atol=1e-4)
    table = pd.read_csv(tmp_path / "b-constant_field.csv")
    assert list(table.columns) == ["x_mm", "y_mm", "dx_mm", "dz_mm"]
    order = np.lexsort(table[["y_mm", "x_mm"]].to_numpy().T)
    nodes = MESH.points[np.lexsort(MESH.points[:, [1, 0]].T), :2]
    np.testing.assert_allclose(table[["x_mm", "y_mm"]].to_numpy()[order], nodes, atol=1e-3)
    np.testing.assert_allclose(table[["dx_mm", "dz_mm"]], np.tile([0.3, -0.4], (len(Z0), 1)))
    (path, ((name, points, heights),), edge), (other, constant, _) = drawn
    assert (path, name) == (tmp_path / "b-reference_surface.png", "z0, mm")
    np.testing.assert_array_equal(points, MESH.points[:, :2])
    np.testing.assert_allclose(heights, z0)
    np.testing.assert_array_equal(edge, Outline.circle(100.0).edge())
    assert other == tmp_path / "b-constant_field.png"
    assert [name for name, _, _ in constant] == ["dx, mm", "dz, mm"]
    np.testing.assert_allclose([values[0] for _, _, values in constant], [0.3, -0.4])
