"""reports/kinds/bubble.py: numbers, tables and pictures of bubbles."""

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
import scipy
from bubblefit.experiments.bubble import sheet as shapes
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.section import SheetSettings
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.experiments.data_files import Output
from bubblefit.experiments.forward import CardRun
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.reports.content import Words
from bubblefit.reports.kinds import bubble as report
from bubblefit.reports.kinds.bubble import left_at_nodes, strain_maps, write_series
from bubblefit.runs.simulation import simulate_cards
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.flat_bubbles import (
    LAW,
    MESH,
    MODEL,
    QUARTER,
    ROUND,
    history,
    history_of,
    stretched,
)
from ...builders.projects import known_bubble_of_form
from ...support.charts import caught, data


def simulated(folder: Path, sheet: object = SheetSettings(), **outcomes: Any) -> Any:
    test: Any = SimpleNamespace(name="b", pressures=MODEL.pressures, sheet=sheet)
    cards: Any = dict.fromkeys(outcomes, SimpleNamespace(law=LAW))
    runs = {(name, "bubble"): CardRun(MODEL, outcome) for name, outcome in outcomes.items()}
    return report.simulate(test, cards, runs, Output(folder))


def test_card_on_a_bubble_gives_numbers_lines_and_table(tmp_path, monkeypatch):
    drawn = caught(monkeypatch, report, "bubbles.cut_charts")
    said, made = simulated(tmp_path, soft=history()), history().displacement
    own = {
        "pressure_kPa": pytest.approx([22.0, 300.0]), "apex_mm": pytest.approx([10.0, 30.0]),
        "strain_reached": {"warp": 0.11, "fill": 0.22, "shear": 0.33},
    }  # fmt: skip
    assert said.numbers == {**own, "cards": {"soft": own}}
    assert said.lines == ["    22.0 kPa   apex   10.000 mm", "   300.0 kPa   apex   30.000 mm"]
    table = pd.read_csv(tmp_path / "displacement.csv")
    names = ["pressure_kPa", "node", "x_mm", "y_mm", "dx_mm", "dy_mm", "dz_mm"]
    assert list(table.columns) == names
    count, points = len(ROUND), np.tile(MODEL.mesh.points[:, :2], (2, 1))
    loads, nodes = np.repeat([22.0, 300.0], count), np.tile(np.arange(count), 2)
    expected = np.column_stack([loads, nodes, points, made.reshape(-1, 3)])
    np.testing.assert_allclose(table.to_numpy(), expected, rtol=1e-6, atol=1e-6)
    ((path, name, pressures, points, shown),) = drawn
    assert (name, path) == ("soft", tmp_path / "profiles.png")
    assert tuple(pressures) == MODEL.pressures
    np.testing.assert_array_equal(points, MODEL.mesh.points)
    np.testing.assert_array_equal(shown, made)
    assert (tmp_path / "bubble.pvd").exists()


@pytest.mark.parametrize(
    ("settings", "note"),
    [
        ({}, None),
        ({"tension": (0.5, 0.0)}, None),
        ({"modes": 3}, "a flat and taut sheet with a fixed rim, whatever [bubble.sheet] says"),
        (
            {"modes": 3, "tension": (0.5, 0.0)},
            "a flat sheet with a fixed rim; of [bubble.sheet] only tension is used",
        ),
    ],
)
def test_simulation_tells_what_it_uses_of_the_sheet(tmp_path, monkeypatch, settings, note):
    caught(monkeypatch, report, "bubbles.cut_charts")
    lines = simulated(tmp_path, SheetSettings(**settings), soft=history()).lines
    assert [line for line in lines if "note" in line] == (
        [f"note: simulated from {note}"] if note else []
    )


def test_residual_is_measured_minus_modelled():
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


FINE = BubbleModel(disk_mesh(100.0, 432), 0.8, (0.1, 0.3))
INFLATED = MembraneSolver().run(FINE, LAW)


def fitted_bubble(share_of_measured, points=None, reference_frame=None):
    """Return a test and its fit, of which the data are the model's, displaced by a share."""
    chosen = slice(points)
    sample = scipy.sparse.eye(len(FINE.mesh.points), format="csr")[chosen]
    targets = [
        FieldTarget(p, (1 + share_of_measured) * u[chosen], sample, reference_frame=reference_frame)
        for p, u in zip(FINE.pressures, INFLATED.displacement, strict=True)
    ]
    comparison = SimpleNamespace(
        objective=FieldObjective(targets, "mm"), model=FINE, model_at=lambda _: FINE
    )
    fitted: Any = SimpleNamespace(comparisons=[comparison], nuisance={}, histories=[INFLATED])
    test = SimpleNamespace(name="b", sheet=SheetSettings(reference_frame=reference_frame))
    return SimpleNamespace(test=test, source="measured"), fitted


def frames_of(panel, maps):
    return panel.values.values.reshape(len(maps.loads), -1)


def test_strain_maps_show_the_strain_of_the_elements_in_percent():
    maps = strain_maps(*fitted_bubble(0.02))
    assert [panel.unit for panel in maps.panels] == ["%"] * 9
    names = [panel.name for panel in maps.panels]
    assert names[3:6] == [
        f"fill strain, {source}" for source in ("measured", "modelled", "modelled − measured")
    ]
    assert "polynomials" in maps.caption and "in the same way" in maps.caption
    known = 100 * replace(INFLATED, model=FINE, law=LAW).strain()
    for k in range(3):
        measured, modelled, difference = (
            frames_of(panel, maps) for panel in maps.panels[3 * k : 3 * k + 3]
        )
        in_elements = modelled[:, FINE.mesh.quads].mean(axis=2)
        np.testing.assert_allclose(in_elements, known[..., k], atol=0.2)
        np.testing.assert_allclose(difference, modelled - measured, atol=1e-3)
    # Displacements larger by 2 % are strains larger by 2 to 4 %.
    first, second = (frames_of(panel, maps) for panel in maps.panels[:2])
    assert 1.02 < np.median(first / second) < 1.045


def test_words_say_why_there_is_no_map_of_strain():
    few = strain_maps(*fitted_bubble(0.0, points=150))
    assert isinstance(few, Words)
    assert few.lines == [
        "b: no maps of measured strain: it takes 192 points at each pressure, and there are 150."
    ]
    loaded = strain_maps(*fitted_bubble(0.0, reference_frame=0))
    assert isinstance(loaded, Words) and "loaded frame" in loaded.lines[0]


def test_profiles_count_model_and_data_from_the_loaded_frame():
    start, end = INFLATED.displacement
    prepared, fitted = fitted_bubble(0.0, reference_frame=0)
    prepared.fields = ()
    sample = scipy.sparse.eye(len(start), format="csr")
    target = FieldTarget(FINE.pressures[1], end - start, sample, frame=1, reference_frame=0)
    fitted.comparisons[0].objective = FieldObjective([target], "mm")
    charts = report.profile_charts(prepared, fitted)
    assert "both counted from the loaded frame" in charts.caption
    for chart in charts.charts:
        modelled, measured = data(chart)
        assert modelled[1].max() == pytest.approx((end - start)[:, 2].max(), abs=1e-3)
        np.testing.assert_allclose(measured, modelled, atol=1e-9)


def test_series_for_paraview_is_read_back(tmp_path):
    path = [stretched(1.01, 1.0), stretched(1.02, 0.99), stretched(1.05, 0.98)]
    left = np.full((len(MESH.points), 3), 0.25)
    left[0] = np.nan
    told = history_of(path)
    collection = write_series(QUARTER, history_of(path), LAW, tmp_path / "bubble.pvd", [None, left])
    rows = ElementTree.parse(collection).getroot().findall("./Collection/DataSet")
    assert [float(row.attrib["timestep"]) for row in rows] == [50.0, 100.0]
    own = zip(told.displacement, told.strain(), told.stress(), (None, left), strict=True)
    for row, (moved, strain, stress, residual) in zip(rows, own, strict=True):
        assert row.attrib["file"].startswith("bubble-vtu/00")
        grid = meshio.read(tmp_path / row.attrib["file"])
        np.testing.assert_allclose(grid.points, MESH.points + moved)
        np.testing.assert_allclose(grid.point_data["displacement"], moved)
        cells = {name: data[0] for name, data in grid.cell_data.items()}
        np.testing.assert_allclose(cells.pop("log_strain_1_2_12"), strain)
        np.testing.assert_allclose(cells.pop("stress_1_2_12_MPa"), stress)
        np.testing.assert_array_equal(cells.pop("wrinkling"), shapes.states(stress))
        assert not cells
        seen = grid.point_data.get("residual_mm")
        assert (seen is None) == (residual is None)
        assert seen is None or np.array_equal(seen, residual, equal_nan=True)


def leaves_of(numbers):
    """Yield every key of nested dictionaries."""
    for key, value in numbers.items():
        yield str(key)
        if isinstance(value, dict):
            yield from leaves_of(value)


def test_simulated_displacements_have_the_mean_error_of_the_fit(tmp_path):
    path = known_bubble_of_form(tmp_path, 'form = "constant"')
    project = bf.read_project(path).with_fit(jobs=1, mesh_error="told")
    fit = bf.fit(project, starts=1)
    ((name, findings),) = fit.findings.items()
    tests = [project.tests[name]]
    simulation = simulate_cards(project, tests, {"fitted": fit.card}, tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "displacement.csv")
    simulated = [
        frame.sort_values("node")[["dx_mm", "dy_mm", "dz_mm"]].to_numpy()
        for _, frame in table.groupby("pressure_kPa")
    ]
    (prepared,) = fit.setup.tests
    (comparison,) = fit.problem.comparisons
    error = comparison.objective.mean_absolute(np.array(simulated))
    assert prepared.known is not None and error > 0
    assert findings.numbers["mean_abs_mm"] == pytest.approx(error, rel=1e-3)
    # A simulation compares with nothing: it has no error that could differ from that of the fit.
    keys = set(leaves_of(simulation.numbers))
    assert not {key for key in keys if "rms" in key or "mean_abs" in key}
