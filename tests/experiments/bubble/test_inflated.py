"""The inflated sheet pressure by pressure: strains, stresses, wrinkles, residuals, for ParaView."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from bubblefit.experiments.bubble.forward import (
    SLACK,
    TAUT,
    WRINKLED,
    at_nodes,
    inflated_sheets,
    sheet_strain,
    states,
    write_series,
)
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.experiments.bubble.report import left_at_nodes
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.bubble import Wall, analyse, prepare
from bubblefit.solvers.membrane.newton import Asked

BETA = np.zeros(12)
BETA[[11, 7, 3]] = 500.0, 200.0, 40.0
LAW = HypoelasticLaw(BETA, 0.25)
MESH = disk_mesh(100.0, 48)
MODEL = BubbleModel(MESH, 0.8, (0.05, 0.1), (0.02, 0.05, 0.1))


def stretched(warp: float, fill: float, shear: float = 0.0) -> Any:
    """(nodes, 3) displacement of a flat sheet that is pulled evenly."""
    x, y = MESH.points[:, 0], MESH.points[:, 1]
    return np.column_stack([(warp - 1) * x + shear * y, (fill - 1) * y, 0 * x])


def history(path: Any, reported: Any = (1, 2)) -> History:
    path = np.asarray(path)
    own = path[list(reported)]
    return History(np.array([0.05, 0.1]), own, np.zeros(3), np.zeros(3), path=path)


def test_an_even_stretch_in_closed_form() -> None:
    """Constant moduli: stress = stiffness times log strain, whatever the increments."""
    ends = [(1.01, 1.0), (1.02, 1.01), (1.05, 0.99)]
    told = list(inflated_sheets(MODEL, history([stretched(*end) for end in ends]), LAW))
    assert [sheet.pressure for sheet in told] == [0.05, 0.1]
    d = 1 - 0.25**2 * 200 / 500
    for sheet, (warp, fill) in zip(told, ends[1:], strict=True):
        strain = np.array([np.log(warp), np.log(fill), 0.0])
        np.testing.assert_allclose(sheet.strain, np.tile(strain, (len(MESH.quads), 1)), atol=1e-12)
        e1, e2 = strain[:2]
        stress = [(500 * e1 + 0.25 * 200 * e2) / d, (200 * e2 + 0.25 * 200 * e1) / d, 0.0]
        np.testing.assert_allclose(sheet.stress, np.tile(stress, (len(MESH.quads), 1)), atol=1e-9)
        np.testing.assert_array_equal(sheet.displacement, stretched(warp, fill))


def test_without_the_increments_the_frames_are_taken() -> None:
    whole = history([stretched(by, 1.0) for by in (1.01, 1.02, 1.05)])
    bare = replace(whole, path=None)
    one, two = inflated_sheets(MODEL, bare, LAW)
    assert one.strain[0, 0] == pytest.approx(np.log(1.02))
    assert two.stress[0, 0] == pytest.approx(500 * np.log(1.05) / (1 - 0.25**2 * 0.4))


def test_a_slack_sheet_is_first_unfolded() -> None:
    """Strain counts from where the sheet is without stress, one per cent longer than it lies."""
    slack = replace(MODEL, slack=(0.01, 0.0))
    strain = sheet_strain(slack, stretched(1.0201, 1.0))
    np.testing.assert_allclose(strain[:, 0], np.log(1.0201 / 1.01), atol=1e-12)


def test_stresses_are_those_of_the_membrane() -> None:
    """In the middle of quads, beside the mean of the Gauss points: the finer the nearer."""
    off = []
    for quads in (48, 192):
        model = replace(MODEL, mesh=disk_mesh(100.0, quads))
        membrane = prepare(model, LAW, 1e-9, Wall())
        found, _ = analyse(membrane, model, Asked())
        *_, last = inflated_sheets(model, found, LAW)
        own = membrane.stress_old.mean(axis=1)
        off.append(np.abs(last.stress - own).max() / np.abs(own).max())
        assert (last.state == TAUT).all() and np.abs(own[:, :2]).min() > 1.0
    assert off[0] < 0.02 and off[1] < 0.6 * off[0]


def test_states_by_the_principal_stresses() -> None:
    stress = np.array(
        [[2.0, 1.0, 0.0], [2.0, 1.0, 1.5], [2.0, -0.1, 0.0], [0.0, 3.0, 0.0], [-1.0, -2.0, 0.0],
         [0.0, 0.0, 0.0], [1.0, 1.0, 0.99]]
    )  # fmt: skip
    assert states(stress).tolist() == [TAUT, WRINKLED, WRINKLED, WRINKLED, SLACK, SLACK, TAUT]
    assert (TAUT, WRINKLED, SLACK) == (0, 1, 2)


def test_values_at_places_are_carried_to_the_nodes() -> None:
    """Linear between places; none beyond them and in a hole; as they are where nodes match."""
    x, y = np.meshgrid(np.arange(-50.0, 51.0, 5.0), np.arange(-50.0, 51.0, 5.0))
    places = np.column_stack([x.ravel(), y.ravel()])
    places = places[np.hypot(*(places - [20.0, 0.0]).T) > 16.0]
    values = np.column_stack([places[:, 0], 2 * places[:, 1], places.sum(axis=1)])
    nodes = np.array([[1.0, 2.0], [-33.3, 12.1], [20.0, 0.0], [90.0, 0.0]])
    found = at_nodes(nodes, places, values)
    np.testing.assert_allclose(found[:2], [[1.0, 4.0, 3.0], [-33.3, 24.2, -21.2]])
    assert np.isnan(found[2:]).all()
    np.testing.assert_array_equal(at_nodes(places, places, values), values)
    line = places[places[:, 1] == 50.0]
    assert np.isnan(at_nodes(nodes, line, np.zeros((len(line), 3)))).all()
    assert np.isnan(at_nodes(nodes, places[:2], values[:2])).all()


def test_what_is_left_is_measured_less_modelled() -> None:
    """In the frame that a target is of; offsets of the fit taken in."""
    moved = np.stack([stretched(1.01, 1.0), stretched(1.02, 1.0)])
    read = moved[1] + [0.3, -0.2, 0.1]
    objective = FieldObjective([FieldTarget(0.1, read, frame=1)], "mm")
    comparison = SimpleNamespace(objective=objective, model=MODEL)
    fitted: Any = SimpleNamespace(
        comparisons=[comparison], nuisance={"offset_x": 0.1},
        histories=[History(np.array([0.05, 0.1]), moved, np.zeros(3), np.zeros(3))],
    )  # fmt: skip
    none, left = left_at_nodes(fitted)
    assert none is None
    np.testing.assert_allclose(left, np.tile([0.2, -0.2, 0.1], (len(MESH.points), 1)), atol=1e-12)


def test_the_series_is_read_back(tmp_path: Path) -> None:
    """By meshio, from the files that the collection names, at its times (kPa)."""
    path = [stretched(1.01, 1.0), stretched(1.02, 0.99), stretched(1.05, 0.98)]
    left = np.full((len(MESH.points), 3), 0.25)
    left[0] = np.nan
    told = list(inflated_sheets(MODEL, history(path), LAW))
    collection = write_series(MODEL, history(path), LAW, tmp_path / "bubble.pvd", [None, left])
    rows = ElementTree.parse(collection).getroot().findall("./Collection/DataSet")
    assert [float(row.attrib["timestep"]) for row in rows] == [50.0, 100.0]
    assert [row.attrib["file"] for row in rows] == [
        "bubble-vtu/000-50kPa.vtu", "bubble-vtu/001-100kPa.vtu"
    ]  # fmt: skip
    for row, sheet, residual in zip(rows, told, (None, left), strict=True):
        grid = meshio.read(tmp_path / row.attrib["file"])
        np.testing.assert_allclose(grid.points, MESH.points + sheet.displacement)
        np.testing.assert_allclose(grid.point_data["displacement"], sheet.displacement)
        cells = {name: data[0] for name, data in grid.cell_data.items()}
        assert set(cells) == {"log_strain_1_2_12", "stress_1_2_12_MPa", "wrinkling"}
        np.testing.assert_allclose(cells["log_strain_1_2_12"], sheet.strain)
        np.testing.assert_allclose(cells["stress_1_2_12_MPa"], sheet.stress)
        np.testing.assert_array_equal(cells["wrinkling"], sheet.state)
        assert ("residual_mm" in grid.point_data) == (residual is not None)
        if residual is not None:
            np.testing.assert_array_equal(grid.point_data["residual_mm"], residual)
