"""What is told of a sheet as it was: every number, word, table and picture of a made-up fit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.bubble import findings as sheet_report
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget, with_places
from bubblefit.experiments.bubble.section import Sheet
from bubblefit.experiments.kinds import Output
from bubblefit.inference.comparison import Nuisance
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, disk_mesh
from bubblefit.notes import NoteKind
from bubblefit.solvers.base import History

from ...drawings import caught

PRESSURES = (0.02, 0.2)
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
    model = BubbleModel(MESH, 0.8, PRESSURES, PRESSURES)
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
    model_at = [FieldTarget(p, moved[k] + [0.3, 0.0, -0.4]) for k, p in enumerate(PRESSURES)]
    targets = with_places(model_at, MESH.points[:, :2])
    objective = FieldObjective(targets, "mm", constant=sheet.constant)
    comparison = SimpleNamespace(model=model, nuisance=nuisance, objective=objective)
    history = History(np.array(PRESSURES), moved, np.zeros(3), np.zeros(3))
    test = SimpleNamespace(
        name="b", sheet=sheet, pressures=PRESSURES, outline=Outline.circle(100.0)
    )
    surface = SimpleNamespace(surface=SURFACE if sheet.measured else None)
    fit = SimpleNamespace(comparisons=[comparison], nuisance=values, histories=[history])
    return SimpleNamespace(test=test, sheet=surface, known=None), fit


def numbers(sheet: Sheet) -> dict[str, Any]:
    return sheet_report.sheet_numbers(*fitted(sheet))


def test_every_number() -> None:
    found = numbers(ALL)
    heights = Z0 + 2.0 + 0.03 * MESH.points[:, 0]
    assert found == {
        "used": [
            "measured surface", "modes", "slack", "measured rim", "constant field",
            "loaded reference frame",
        ],
        "surface_mm": pytest.approx({"least": heights.min(), "largest": heights.max()}),
        "measured_rms_mm": 0.0456,
        "modes_mm": {"z0_1": 2.0, "z0_x": 3.0},
        "slack_percent": pytest.approx([0.05, -0.1]),
        "rim_motion_mm": pytest.approx(1.3),
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
        (Sheet(), "flat and taut, its rim fixed"),
        (
            ALL,
            "measured surface (followed to 0.046 mm RMS); 2 modes of the surface; z0 from -3.50 to "
            "6.50 mm; slack 0.050 % in warp, -0.100 % in fill; rim as measured, up to 1.30 mm; "
            "constant field taken out: dx 0.30 mm RMS, dz 0.40 mm RMS; displacements counted from "
            "20 kPa",
        ),
        (Sheet(measured=True), "measured surface (followed to 0.046 mm RMS); z0 from -2.50 to "
         "1.50 mm"),
        (Sheet(modes=2), "2 modes of the surface; z0 from -1.00 to 5.00 mm"),
        (Sheet(since=1), "displacements counted from 200 kPa"),
    ],
)  # fmt: skip
def test_the_line_for_the_terminal(sheet: Sheet, words: str) -> None:
    assert sheet_report.sheet_lines(numbers(sheet)) == [f"sheet: {words}"]


@pytest.mark.parametrize(
    ("sheet", "warned"),
    [
        (Sheet(), 1), (Sheet(slack=True), 1), (Sheet(moving_rim=True), 1),
        (Sheet(measured=True), 0), (Sheet(modes=1), 0), (Sheet(constant=(0,)), 0),
        (Sheet(since=0), 0),
    ],
)  # fmt: skip
def test_a_sheet_of_which_nothing_is_known(sheet: Sheet, warned: int) -> None:
    test = SimpleNamespace(known=None, test=SimpleNamespace(sheet=sheet))
    assert [(n.kind, str(n)) for n in sheet_report.sheet_warnings(test)] == [
        (NoteKind.FLAT_SHEET, sheet_report.NOT_BELIEVED)
    ] * warned
    test.known = "a law"
    assert sheet_report.sheet_warnings(test) == []


def test_pictures_and_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = caught(monkeypatch, sheet_report, "disk_charts")
    assert sheet_report.sheet_exhibit(*fitted(Sheet(slack=True)), Output(tmp_path)) == ([], [])
    assert not drawn and not list(tmp_path.iterdir())
    figures, files = sheet_report.sheet_exhibit(*fitted(ALL), Output(tmp_path, "b-"))
    same = "measured less modelled, as far as it is the same at all pressures"
    assert figures == [
        (
            "b-reference_surface.png",
            "b: surface of the sheet in the reference picture (measured surface and modes)",
        ),
        ("b-constant_field.png", f"Taken out of the fit: {same}"),
    ]
    surface = "surface of the sheet in the reference picture"
    assert files == [
        ("b-reference_surface.csv", f"{surface}, node by node"),
        ("b-constant_field.csv", f"{same}, point by point"),
    ]
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
