"""Cards on a bubble: numbers, lines, table and files of a made-up history."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import bubblefit as bf
import meshio
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.bubble import objective as places
from bubblefit.experiments.bubble import prepared as preparation
from bubblefit.experiments.bubble import report
from bubblefit.experiments.bubble.objective import (
    OFFSETS,
    FieldObjective,
    FieldTarget,
    folded,
    mirrored,
)
from bubblefit.experiments.bubble.prepared import (
    INWARD,
    _same_steps_and_mesh,
    _sample,
    resampled,
)
from bubblefit.experiments.bubble.report import left_at_nodes, write_series
from bubblefit.experiments.bubble.section import Sheet
from bubblefit.experiments.bubble.sheet import (
    LOOSE,
    TAUT,
    WRINKLED,
    at_nodes,
    inflated_sheets,
    sheet_strain,
    states,
)
from bubblefit.experiments.bubble.test import quantities, responses
from bubblefit.experiments.kinds import CardRun, Fabric, Output, Place, Weighting
from bubblefit.inference.comparison import Blocks
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, disk_mesh, elliptic_disk_mesh
from bubblefit.meshes.reading import Facet, FacetReading, SmoothReading
from bubblefit.project.project import read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.best import limit_of_meshes
from bubblefit.runs.fit import fit
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.bubble import Wall, analyse, prepare
from bubblefit.solvers.membrane.newton import Asked
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...commands import in_process, result_in
from ...complaints import complaint
from ...drawings import caught
from ...inference.cases import MODEL as CASE
from ...inference.cases import reference, targets
from ...projects import small

PART = "bubble"
BETA = np.zeros(12)
BETA[[11, 7, 3]] = 500.0, 200.0, 40.0
MODEL = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.8, (0.022, 0.3), (0.022, 0.3))
#: In mm: a paraboloid of 10 and 30 mm, sheared aside by 1 mm at the end.
ROUND = 1 - (MODEL.mesh.points[:, :2] ** 2).sum(axis=1) / 100.0**2


def history() -> History:
    u = np.zeros((2, len(ROUND), 3))
    u[:, :, 2] = np.outer([10.0, 30.0], ROUND)
    u[1, :, 0] = ROUND
    strain = np.array([0.11, 0.22, 0.04]), np.array([0.0, 0.0, -0.33])
    return History(np.array([0.022, 0.3]), u, strain[1], strain[0])


@pytest.fixture
def drawn(monkeypatch):
    return caught(monkeypatch, report, "cut_charts")


def simulated(folder: Path, sheet: object = Sheet(), **outcomes: Any) -> Any:
    test: Any = SimpleNamespace(name="b", pressures=MODEL.pressures, sheet=sheet)
    cards: Any = dict.fromkeys(outcomes, SimpleNamespace(law=HypoelasticLaw(BETA, 0.25)))
    runs = {(name, PART): CardRun(MODEL, outcome) for name, outcome in outcomes.items()}
    return report.simulate(test, cards, runs, Output(folder))


def test_one_card(tmp_path, drawn):
    said = simulated(tmp_path, soft=history())
    own = {
        "pressure_kPa": pytest.approx([22.0, 300.0]),
        "apex_mm": pytest.approx([10.0, 30.0]),
        "strain_reached": {"warp": 0.11, "fill": 0.22, "shear": 0.33},
    }
    assert said.numbers == {**own, "cards": {"soft": own}}
    assert said.lines == ["    22.0 kPa   apex   10.000 mm", "   300.0 kPa   apex   30.000 mm"]
    table = pd.read_csv(tmp_path / "displacement.csv")
    assert list(table.columns) == [
        "pressure_kPa", "node", "x_mm", "y_mm", "dx_mm", "dy_mm", "dz_mm"
    ]  # fmt: skip
    count = len(ROUND)
    assert table["pressure_kPa"].tolist() == pytest.approx([22.0] * count + [300.0] * count)
    assert table["node"].tolist() == [*range(count)] * 2
    points = np.tile(MODEL.mesh.points[:, :2], (2, 1))
    assert table[["x_mm", "y_mm"]].to_numpy() == pytest.approx(points, abs=1e-6)
    moved = history().displacement.reshape(-1, 3)
    assert table[["dx_mm", "dy_mm", "dz_mm"]].to_numpy() == pytest.approx(moved, abs=1e-6)
    ((path, name, pressures, points, shown),) = drawn
    assert name == "soft" and path == tmp_path / "profiles.png"
    assert tuple(pressures) == MODEL.pressures
    np.testing.assert_array_equal(points, MODEL.mesh.points)
    np.testing.assert_array_equal(shown, history().displacement)
    assert (tmp_path / "bubble.pvd").exists()


def test_several_cards_one_of_which_fails(tmp_path, drawn):
    sheet = "any but a flat one"
    said = simulated(
        tmp_path, sheet, broken=SolverFailure("no equilibrium", "membrane"), soft=history()
    )
    assert list(said.numbers) == ["cards"]
    assert said.numbers["cards"]["broken"] == {"failed": "no equilibrium"}
    assert len(said.lines) == 5 and said.lines[0] == "broken: failed: no equilibrium"
    assert said.lines[1] == "soft:" and said.lines[4].startswith("note: ")
    assert {path.name for path in tmp_path.iterdir()} == {
        "displacement-2.csv", "bubble-2.pvd", "bubble-2-vtu",
    }  # fmt: skip
    assert drawn[0][0] == tmp_path / "profiles-2.png"


def test_what_a_study_looks_at():
    assert quantities(MODEL, history()) == {
        "apex at 22 kPa, mm": pytest.approx(10.0),
        "apex at 300 kPa, mm": pytest.approx(30.0),
        "largest in-plane displacement at 300 kPa, mm": pytest.approx(1.0),
    }
    assert responses(MODEL, history()) == {
        "22 kPa": pytest.approx(10.0), "300 kPa": pytest.approx(np.hypot(30.0, 1.0))
    }  # fmt: skip


PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))


def points(registration: Any = None, recorded: Any = None) -> Any:
    return SimpleNamespace(
        files=("a.csv",), options="how", format="x", recorded=recorded, registration=registration
    )


def made(match_by: str = "surfaces", degree: int = 2) -> Any:
    return SimpleNamespace(
        place=PLACE, pressures=(0.1,), outline="rim", match_by=match_by, match_degree=degree
    )


def raising(error: InputError) -> Any:
    def call(*_: Any, **__: Any) -> None:
        raise error

    return call


def test_files_are_read_as_the_section_says(monkeypatch):
    told: list[Any] = []
    monkeypatch.setattr(preparation, "read_fields", lambda *a, **named: told.append((a, named)))
    preparation._measured(made(), points())
    preparation._measured(made(), points(recorded=SimpleNamespace(frames=[3])))
    files, how = (("a.csv",), (0.1,)), {"options": "how", "format": "x"}
    assert told == [(files, {**how, "frames": None}), (files, {**how, "frames": [3]})]
    monkeypatch.setattr(preparation, "register_fields", lambda *what: what)
    assert preparation._measured(made(), points("asked")) == (None, "rim", "asked")


def test_what_cannot_be_read_or_registered_names_its_key(monkeypatch):
    monkeypatch.setattr(preparation, "read_fields", raising(InputError(None, "files", "odd")))
    said = complaint(preparation._measured, made(), points())
    assert said == "p.toml: bubble[0].data.points.files: odd"
    # A file at fault is named itself.
    monkeypatch.setattr(preparation, "read_fields", raising(InputError("a.csv", "line 3", "odd")))
    assert complaint(preparation._measured, made(), points()) == "a.csv: line 3: odd"
    monkeypatch.setattr(preparation, "read_fields", lambda *_, **__: ())
    for field, key in (("", ""), ("centre", ".centre")):
        error = InputError(None, field, "far off")
        monkeypatch.setattr(preparation, "register_fields", raising(error))
        said = complaint(preparation._measured, made(), points("asked"))
        assert said == f"p.toml: bubble[0].data.points.registration{key}: far off"


def field(count: int) -> DisplacementField:
    at = np.random.default_rng(1).uniform(-50, 50, (count, 2))
    return DisplacementField(0.1, at, np.ones((count, 3)))


def test_surfaces_that_are_only_reported_can_be_left_out():
    enough, few = (field(20), field(9)), (field(20), field(8))
    for by in ("surfaces", "points"):
        found = preparation._surfaces(made(by), enough, computed=False)
        assert [surface.degree for surface in found] == [2, 2]
    assert preparation._surfaces(made("points"), few, computed=False) == ()
    said = complaint(preparation._surfaces, made(), few, computed=False)
    assert "match.degree" in said and "9 coefficients" in said and "there are 8" in said


def test_a_computed_quarter_is_mirrored_for_its_surfaces(monkeypatch):
    seen: list[int] = []
    monkeypatch.setattr(preparation, "mirrored", lambda f: seen.append(len(f.points)) or f)
    preparation._surfaces(made(), (field(12),), computed=False)
    assert seen == []
    preparation._surfaces(made(), (field(12),), computed=True)
    assert seen == [12]


def test_data_of_this_model_are_told_from_others():
    def same(steps, elements):
        test: Any = SimpleNamespace(
            elements=48, increments=(0.1, 0.2),
            model=lambda elements: SimpleNamespace(mesh=disk_mesh(100.0, elements)),
        )  # fmt: skip
        data: Any = SimpleNamespace(elements=elements, increments=steps)
        return _same_steps_and_mesh(test, data)

    assert same((0.1, 0.2), 48) and same((0.1 * (1 + 1e-10), 0.2), 48)
    assert not same((0.1, 0.2, 0.3), 48) and not same((0.1,), 48)
    assert not same((0.1 * (1 + 1e-8), 0.2), 48) and not same((1e-9, 0.2), 48)
    assert not same((0.1, 0.2), 108)


def direct_e(model: np.ndarray, data: list[FieldTarget]) -> float:
    """Eqs 4.5 to 4.8 as they are printed."""
    total = 0.0
    for frame, target in zip(model, data, strict=True):
        measured = target.displacement
        for axis in range(3):
            difference = target.at(frame)[:, axis] - measured[:, axis]
            rms = np.sqrt(np.sum(difference**2) / len(measured))
            total += rms / np.max(np.abs(measured[:, axis]))
    return total


def test_e_against_a_direct_evaluation():
    data = targets()
    other = MembraneSolver().run(CASE, HypoelasticLaw.linear(400.0, 300.0, 15.0))
    objective = FieldObjective(data)
    blocks = Blocks(objective.sizes)
    e = blocks.value(objective.residual(other))
    assert e == pytest.approx(direct_e(other.displacement, data))
    assert blocks.value(objective.residual(reference())) == 0.0
    assert blocks.norms(objective.residual(other)).shape == (21,)
    doubled = FieldObjective(data, weight=2.0)
    assert blocks.value(doubled.residual(other)) == pytest.approx(2 * e)
    millimetres = (other.displacement - reference().displacement).transpose(0, 2, 1).ravel()
    assert doubled.residual(other) * doubled.scale == pytest.approx(millimetres)


def test_e_between_the_nodes_and_with_an_offset():
    random = np.random.default_rng(1)
    data = []
    for k, p in enumerate(CASE.pressures):
        rows = 10 + k
        sample = sp.random(rows, len(CASE.mesh.points), 0.1, "csr", random_state=k)
        data.append(FieldTarget(p, random.standard_normal((rows, 3)), sample))
    objective, shift = FieldObjective(data), np.array([0.1, -0.2, 0.3])
    u = reference().displacement
    total = 0.0
    for frame, target in zip(u, data, strict=True):
        gap = target.sample @ frame + shift - target.displacement
        total += (np.sqrt((gap**2).mean(axis=0)) / np.abs(target.displacement).max(axis=0)).sum()
    nuisance = dict(zip(OFFSETS, shift, strict=True))
    e = Blocks(objective.sizes).value(objective.residual(reference(), nuisance))
    assert e == pytest.approx(total)


def test_millimetres_are_not_normalised():
    objective = FieldObjective(targets(), "mm")
    moved = reference().displacement + np.array([0.0, 0.0, 0.5])
    e = Blocks(objective.sizes).value(objective.residual(replace(reference(), displacement=moved)))
    assert e == pytest.approx(7 * 0.5)
    assert objective.mean_absolute(moved) == pytest.approx(0.5)


def test_data_without_displacement_are_refused():
    fields = reference().displacement.copy()
    fields[2, :, 1] = 0.0
    with pytest.raises(InputError, match="97 kPa: dy is zero"):
        FieldObjective(targets(fields))


OWN, OTHER = disk_mesh(100.0, 48, "quarter"), disk_mesh(100.0, 192, "quarter")


def test_the_same_places_from_other_nodes():
    some = sp.csr_matrix(np.eye(len(OWN.points))[[0, 5, 9]])
    targets = tuple(
        FieldTarget(p, np.zeros((n, 3)), sample, places=np.arange(n))
        for p, n, sample in ((0.1, len(OWN.points), None), (0.2, 3, some), (0.3, 3, some))
    )
    every, one, two = resampled(targets, OWN, OTHER)
    assert one.sample is two.sample is not every.sample
    assert [t.pressure for t in (every, one, two)] == [0.1, 0.2, 0.3]
    assert one.places is targets[1].places and targets[0].sample is None
    for moved, target in ((every, targets[0]), (one, targets[1])):
        here, there = moved.at(OTHER.points)[:, :2], target.at(OWN.points)[:, :2]
        np.testing.assert_allclose(here, there, atol=1.01e-2)
    inside = np.hypot(*OWN.points[:, :2].T) < 90.0
    np.testing.assert_allclose(every.at(OTHER.points)[inside], OWN.points[inside], atol=1e-9)


def test_places_beyond_the_polygon_are_looked_for_farther_and_farther_in():
    asked: list[np.ndarray] = []

    def matrix(within):
        def look(at):
            asked.append(at.copy())
            return "matrix", at[:, 0] < within

        asked.clear()
        found = _sample(SimpleNamespace(matrix=look), places)
        assert found == "matrix"
        return [at[1, 0] for at in asked]

    places = np.array([[50.0, 0.0], [100.0, 0.0]])
    assert matrix(101.0) == [100.0] and places[1, 0] == 100.0
    assert matrix(99.95) == pytest.approx([100.0, 99.99, 99.9])
    assert matrix(99.5) == pytest.approx([100.0, 99.99, 99.9, 99.0])
    assert all(at[0, 0] == 50.0 for at in asked)
    # Where the polygon has few edges (the sag of four in a quarter is 2 % of the radius).
    assert matrix(97.0) == pytest.approx([100.0, 99.99, 99.9, 99.0, 95.0])
    assert matrix(91.0)[-1] == pytest.approx(100 * INWARD[-1])
    with pytest.raises(InputError, match="1 places of the data lie outside"):
        matrix(90.0)


@pytest.mark.parametrize("factor", [2.0, 1.6])
def test_quads_and_increments_are_divided(tmp_path, factor):
    project = read_project(small(tmp_path))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    assert prepared.finer(setup.make_solver, Weighting(), factor)[0].model.mesh is not None
    (own,) = prepared.comparisons(setup.make_solver, Weighting())
    found = prepared._refined(own, factor)
    assert found.name == own.name and found.objective is not own.objective
    quads = len(found.model.mesh.quads) / len(own.model.mesh.quads)
    assert quads == (4.0 if factor == 2.0 else pytest.approx(factor**2, rel=0.35))
    assert len(found.model.increments) == 2 * len(own.model.increments)
    assert found.model.increments[1::2] == pytest.approx(own.model.increments)
    assert found.model.pressures == own.model.pressures
    # The objective of the fit is as it was.
    assert own.objective.targets[0].sample is None
    assert found.objective.targets[0].sample.shape[1] == len(found.model.mesh.points)
    # Data of this very model are asked of no other.
    (same,) = prepared.finer(setup.make_solver, Weighting(), factor)
    assert len(same.model.mesh.quads) == len(own.model.mesh.quads)


LAW = HypoelasticLaw(BETA, 0.25)
MESH = disk_mesh(100.0, 48)
QUARTER = BubbleModel(MESH, 0.8, (0.05, 0.1), (0.02, 0.05, 0.1))


def stretched(warp: float, fill: float, shear: float = 0.0) -> Any:
    """(nodes, 3) displacement of a flat sheet that is pulled evenly."""
    x, y = MESH.points[:, 0], MESH.points[:, 1]
    return np.column_stack([(warp - 1) * x + shear * y, (fill - 1) * y, 0 * x])


def history_of(path: Any, reported: Any = (1, 2)) -> History:
    path = np.asarray(path)
    own = path[list(reported)]
    return History(np.array([0.05, 0.1]), own, np.zeros(3), np.zeros(3), path=path)


def test_an_even_stretch_in_closed_form():
    ends = [(1.01, 1.0), (1.02, 1.01), (1.05, 0.99)]
    told = list(inflated_sheets(QUARTER, history_of([stretched(*end) for end in ends]), LAW))
    assert [sheet.pressure for sheet in told] == [0.05, 0.1]
    d = 1 - 0.25**2 * 200 / 500
    for sheet, (warp, fill) in zip(told, ends[1:], strict=True):
        strain = np.array([np.log(warp), np.log(fill), 0.0])
        np.testing.assert_allclose(sheet.strain, np.tile(strain, (len(MESH.quads), 1)), atol=1e-12)
        e1, e2 = strain[:2]
        stress = [(500 * e1 + 0.25 * 200 * e2) / d, (200 * e2 + 0.25 * 200 * e1) / d, 0.0]
        np.testing.assert_allclose(sheet.stress, np.tile(stress, (len(MESH.quads), 1)), atol=1e-9)
        np.testing.assert_array_equal(sheet.displacement, stretched(warp, fill))


def test_without_the_increments_the_frames_are_taken():
    whole = history_of([stretched(by, 1.0) for by in (1.01, 1.02, 1.05)])
    bare = replace(whole, path=None)
    one, two = inflated_sheets(QUARTER, bare, LAW)
    assert one.strain[0, 0] == pytest.approx(np.log(1.02))
    assert two.stress[0, 0] == pytest.approx(500 * np.log(1.05) / (1 - 0.25**2 * 0.4))


def test_a_slack_sheet_is_first_unfolded():
    slack = replace(QUARTER, slack=(0.01, 0.0))
    strain = sheet_strain(slack, stretched(1.0201, 1.0))
    np.testing.assert_allclose(strain[:, 0], np.log(1.0201 / 1.01), atol=1e-12)


def test_stresses_are_those_of_the_membrane():
    off = []
    for quads in (48, 192):
        model = replace(QUARTER, mesh=disk_mesh(100.0, quads))
        membrane = prepare(model, LAW, 1e-9, Wall())
        found, _ = analyse(membrane, model, Asked())
        *_, last = inflated_sheets(model, found, LAW)
        own = membrane.stress_old.mean(axis=1)
        off.append(np.abs(last.stress - own).max() / np.abs(own).max())
        assert (last.state == TAUT).all() and np.abs(own[:, :2]).min() > 1.0
    assert off[0] < 0.02 and off[1] < 0.6 * off[0]


def test_states_by_the_principal_stresses():
    stress = np.array(
        [[2.0, 1.0, 0.0], [2.0, 1.0, 1.5], [2.0, -0.1, 0.0], [0.0, 3.0, 0.0], [-1.0, -2.0, 0.0],
         [0.0, 0.0, 0.0], [1.0, 1.0, 0.99]]
    )  # fmt: skip
    assert states(stress).tolist() == [TAUT, WRINKLED, WRINKLED, WRINKLED, LOOSE, LOOSE, TAUT]
    assert (TAUT, WRINKLED, LOOSE) == (0, 1, 2)


def test_values_at_places_are_carried_to_the_nodes():
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


def test_what_is_left_is_measured_less_modelled():
    moved = np.stack([stretched(1.01, 1.0), stretched(1.02, 1.0)])
    read = moved[1] + [0.3, -0.2, 0.1]
    objective = FieldObjective([FieldTarget(0.1, read, frame=1)], "mm")
    comparison = SimpleNamespace(objective=objective, model=QUARTER)
    fitted: Any = SimpleNamespace(
        comparisons=[comparison], nuisance={"offset_x": 0.1},
        histories=[History(np.array([0.05, 0.1]), moved, np.zeros(3), np.zeros(3))],
    )  # fmt: skip
    none, left = left_at_nodes(fitted)
    assert none is None
    np.testing.assert_allclose(left, np.tile([0.2, -0.2, 0.1], (len(MESH.points), 1)), atol=1e-12)


def test_the_series_is_read_back(tmp_path):
    path = [stretched(1.01, 1.0), stretched(1.02, 0.99), stretched(1.05, 0.98)]
    left = np.full((len(MESH.points), 3), 0.25)
    left[0] = np.nan
    told = list(inflated_sheets(QUARTER, history_of(path), LAW))
    collection = write_series(QUARTER, history_of(path), LAW, tmp_path / "bubble.pvd", [None, left])
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


OUTLINE = Outline(120.0, 80.0, 30.0)
KILO = [40, 120, 250]
LAW_ELLIPTIC_FIT = HypoelasticLaw.linear(700.0, 300.0, 15.0)
PROJECT = """\
[fabric]
name = "computed"
thickness = 0.81
[units]
modulus = "MPa"
[law]
form = "constant"
strain_range = [0.13, 0.13, 0.13]
[law.bounds]
E1 = [100.0, 2000.0]
E2 = [50.0, 1500.0]
G12 = [2.0, 100.0]
[[bubble]]
name = "oval"
ellipse = { major = 120, minor = 80, angle = 30 }
pressures = [40, 120, 250]
elements = 112
[bubble.data.points]
files = ["0.csv", "1.csv", "2.csv"]
columns = { z = "z" }
[bubble.data.points.registration]
[fit]
starts = 1
seed = 3
jobs = 1
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A test on the mesh of the fit, seen by a camera whose x is 20 degrees from the warp."""
    place = tmp_path_factory.mktemp("oval")
    mesh = elliptic_disk_mesh(OUTLINE, 112)
    pressures = [1e-3 * p for p in KILO]
    model = BubbleModel(mesh, 0.81, pressures, default_increments(pressures))
    turn = Rotation.from_euler("z", 20.0, degrees=True).as_matrix().T
    line = np.linspace(-1, 1, 25)
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = OUTLINE.places(points[np.hypot(*points.T) < 0.98])
    sample, inside = SmoothReading.of(mesh).matrix(points)
    places = np.column_stack([points[inside], np.zeros(inside.sum())]) @ turn + [2.0, -3.0, 600.0]
    for k, moved in enumerate(MembraneSolver().run(model, LAW_ELLIPTIC_FIT).displacement):
        table = np.hstack([places, (sample @ moved) @ turn])
        np.savetxt(place / f"{k}.csv", table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    (place / "project.toml").write_text(PROJECT)
    return place


def test_the_moduli_come_back(folder):
    done = in_process("bubble", folder / "project.toml", "--out", folder / "out", cwd=folder)
    result = result_in(folder / "out")
    law = bf.read_card(folder / "out" / "material.toml").law
    # The turn of the rim is told to a few tenths of a degree; G12 feels it.
    for name, modulus, within in (("E1", 700.0, 0.01), ("E2", 300.0, 0.01), ("G12", 15.0, 0.06)):
        assert float(law.modulus(name, 0.02)) == pytest.approx(modulus, rel=within), name
    assert result["registration"]["warp_degrees"] == pytest.approx(20.0, abs=0.6)
    assert result["registration"]["warp"]["clear"] is None
    assert "found by the turn of the elliptic rim" in (folder / "out" / "report.html").read_text()
    assert "warp" in done.output


PROJECT_FILTER = """
[fabric]
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.2, 1.5]
E2 = [0.2, 1.5]
G12 = [0.02, 0.3]
[[bubble]]
radius = 100.0
pressures = [30, 120]
elements = 108
SYMMETRY
[bubble.data.points]
files = ["a.csv", "b.csv"]
FILTER
[fit]
starts = 1
jobs = 1
"""
FILTER = "[bubble.data.points.filter]\nfacet = 40.0\nsmoothing = 3\nstep = 10.0\n"
TRUE = {"E1": 800.0, "E2": 500.0, "G12": 80.0}


def project_in(folder: Path, filtered: str, symmetry: str = "") -> Path:
    path = folder / "project.toml"
    path.write_text(PROJECT_FILTER.replace("FILTER", filtered).replace("SYMMETRY", symmetry))
    return path


def seen(folder: Path) -> None:
    """What a camera of such facets sees of the true bubble, at points 12 mm apart."""
    for name in ("a", "b"):
        (folder / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    model = read_project(project_in(folder, "")).tests["bubble"].model()
    law = HypoelasticLaw.linear(TRUE["E1"], TRUE["E2"], TRUE["G12"])
    moved = MembraneSolver().run(model, law).displacement
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-84.0, 85.0, 12.0)] * 2))
    points = np.column_stack([x, y])[np.hypot(x, y) < 85.0]
    facet = Facet(40.0, window=3, step=10.0)
    matrix, inside = FacetReading(SmoothReading.of(model.mesh), facet).matrix(points)
    assert inside.all()
    for name, frame in zip(("a", "b"), moved, strict=True):
        table = np.column_stack([points, matrix @ frame])
        np.savetxt(folder / f"{name}.csv", table, "%.12g", ",", header="x,y,dx,dy,dz", comments="")


def test_a_fit_through_the_same_filter_is_exact(tmp_path):
    seen(tmp_path)
    through = fit(read_project(project_in(tmp_path, FILTER)))
    plain = fit(read_project(project_in(tmp_path, "")))
    for name, true in TRUE.items():
        assert float(through.law.modulus(name, 0.0)) == pytest.approx(true, rel=1e-4), name
    off = {name: float(plain.law.modulus(name, 0.0)) / true - 1 for name, true in TRUE.items()}
    assert min(abs(off["E1"]), abs(off["E2"])) > 0.02, off
    assert through.objective < 1e-5 < 1e-2 < plain.objective
    # What the error of the mesh is found by is seen through the filter, too.
    limit = limit_of_meshes(through.setup, through.problem, through.best)
    assert limit is not None and np.abs(limit.step).max() < 0.2


@pytest.mark.parametrize(
    ("filtered", "symmetry", "said"),
    [
        (FILTER, 'symmetry = "quarter"', "data.points.filter: a facet reaches over the edge"),
        (FILTER, '[bubble.match]\nby = "surfaces"', "data.points.filter: surfaces are matched"),
        (FILTER.replace("3", "2"), "", "data.points.filter.smoothing: expected 1, 3, 5"),
        (FILTER.replace("step = 10.0", ""), "", "data.points.filter.step: this key is missing"),
    ],
)
def test_what_is_no_filter(tmp_path, filtered, symmetry, said):
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_text("x,y,dx,dy,dz\n0,0,0,0,1\n")
    with pytest.raises(InputError, match=said):
        read_project(project_in(tmp_path, filtered, symmetry))


POINTS = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [5.0, 6.0]])
MOVED = np.array([[0, 0, 9.0], [0.1, 0, 8.0], [0, 0.2, 7.0], [0.3, 0.4, 6.0]])


def inflated(points: np.ndarray) -> np.ndarray:
    """Displacement of a doubly symmetric bubble, another along x than along y."""
    x, y = points.T
    height = 1.0 - 0.6 * x**2 - 0.8 * y**2
    return np.stack([0.3 * x * height, -0.2 * y * height**2, height], axis=1)


def test_a_field_is_turned_as_it_is_folded():
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (40, 2))
    assert {tuple(s) for s in np.sign(points)} == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    field = folded(DisplacementField(0.1, points, inflated(points)))
    assert (field.points == np.abs(points)).all()
    assert field.displacement == pytest.approx(inflated(np.abs(points)), abs=1e-15)


def test_a_quarter_mirrored_is_the_whole_and_folds_back():
    points = np.random.default_rng(2).uniform(0.0, 1.0, (10, 2))
    points[0], points[1] = (0.0, 0.5), (0.4, 0.0)  # on the axes once, not twice
    whole = mirrored(DisplacementField(0.1, points, inflated(points)))
    assert len(whole.points) == 4 * 8 + 2 * 2
    assert whole.displacement == pytest.approx(inflated(whole.points), abs=1e-15)
    again = folded(whole)
    assert again.displacement == pytest.approx(inflated(again.points), abs=1e-15)


def test_each_point_keeps_its_height_and_sigma():
    z, sigma = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.1, 0.2, 0.3, 0.4])
    whole = mirrored(DisplacementField(0.1, POINTS, MOVED, z=z, sigma=sigma))
    assert len(whole.points) == 1 + 2 + 2 + 4
    assert whole.z is not None and whole.sigma is not None
    for point, height, error in zip(whole.points, whole.z, whole.sigma, strict=True):
        (which,) = np.flatnonzero((POINTS == np.abs(point)).all(axis=1))
        assert (height, error) == (z[which], sigma[which])
    back = folded(whole)
    np.testing.assert_array_equal(back.z, whole.z)
    assert (back.points >= 0).all() and (back.displacement >= 0).all()


def test_a_field_without_height_has_none_when_mirrored():
    assert mirrored(DisplacementField(0.1, POINTS, MOVED)).z is None


def test_a_whole_field_is_not_mirrored_again():
    whole = DisplacementField(0.1, POINTS * (-1, 1), MOVED * (-1, 1, 1))
    assert mirrored(whole) is whole


def test_a_point_beside_the_axis_by_rounding_is_on_it():
    points = POINTS.copy()
    points[2, 0] = -1e-12
    assert len(mirrored(DisplacementField(0.1, points, MOVED)).points) == 1 + 2 + 2 + 4


def test_computed_fields_at_the_nodes_of_a_model():
    mesh, other = disk_mesh(1.0, 48), disk_mesh(1.0, 192, "quarter")

    def field(points):
        round_ = 1 - (points[:, :2] ** 2).sum(axis=1)
        return np.column_stack([points[:, 0] * round_, -points[:, 1] * round_, round_])

    noisy = field(mesh.points) + np.random.default_rng(1).normal(0, 0.1, mesh.points.shape)
    same = DisplacementField(0.1, mesh.points[:, :2] + 1e-10, noisy)
    between = DisplacementField(0.2, other.points[:, :2], field(other.points))
    first, second = places.at_nodes([same, between], mesh)
    assert (first.pressure, second.pressure) == (0.1, 0.2) and first.displacement is noisy
    np.testing.assert_allclose(second.displacement, field(mesh.points), atol=0.01)
    np.testing.assert_array_equal(second.displacement[mesh.node_sets["rim"]], 0.0)
