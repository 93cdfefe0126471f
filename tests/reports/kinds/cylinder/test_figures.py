"""Figures of bent cylinders: a line is the prediction, its band goes to the other end."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.cylinder.measures import BendingRun, run_of
from bubblefit.experiments.data_files import Output
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, PlainWall, TubeCrossSection
from bubblefit.meshes.closed_surfaces import enclosed_volume
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.mesh import surface_strain
from bubblefit.reports.bending_charts import bending_charts
from bubblefit.reports.kinds.cylinder import figures
from bubblefit.reports.kinds.cylinder import figures as report
from bubblefit.reports.kinds.cylinder.figures import bodies_of, whole_beam
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial import cKDTree

from ....builders.bending_results import LOAD, WAY
from ....builders.bent_cylinders import ran
from ....support.charts import caught, lines


# Figures
def test_file_names_differ_whatever_the_names_of_tests():
    found = figures.file_names(["150 mm, 90 kPa", "150 mm; 90 kPa", "150 MM 90 kpa", "???", "-x."])
    assert list(found.values()) == [
        "150-mm-90-kPa", "150-mm-90-kPa-2", "150-MM-90-kpa-3", "4", "x"
    ]  # fmt: skip


@pytest.fixture
def drawn(monkeypatch) -> dict[str, list[Any]]:
    calls: dict[str, list[Any]] = {"draw_beam": [], "write_beam": []}
    for name, found in calls.items():
        monkeypatch.setattr(figures, name, lambda *what, own=found: own.append(what))
    return {**calls, "saved": caught(monkeypatch, figures, "bending_charts", "gas_charts")}


def test_line_is_prediction_and_band_reaches_the_other_end(banded, tmp_path, drawn, monkeypatch):
    shown = dict(figures.draw_figures(banded, Output(tmp_path)))
    soft, hard = drawn["saved"][0][1][0].lines
    np.testing.assert_array_equal([soft.deflection, soft.load], [WAY, LOAD])
    assert hard.other_limit is None
    np.testing.assert_array_equal(soft.other_limit, [WAY, 1.5 * LOAD])
    assert "figures/150-90-load.png" not in shown  # a chart on the page
    ((*_, path, title),) = drawn["draw_beam"]
    assert (path.name, title) == ("150-90-beam.png", "150/90, soft, 80 mm")
    names = [name for name, _ in figures.write_beams(banded, Output(tmp_path))]
    beams = ("soft", "soft-rigid-wall", "hard")
    assert names == [f"beams/150-90-{name}.vtu" for name in beams]
    monkeypatch.setattr(figures, "bending_charts", bending_charts)
    (charts,) = figures.load_charts(banded)
    assert charts.caption == "Load over deflection; line: slack, dashed: rigid wall"
    (chart,) = charts.charts
    curves = {s.name: s for s in chart.series if s.look == "line"}
    assert list(curves) == ["mean", "soft", "soft, other end", "hard"]
    assert curves["soft, other end"].y == pytest.approx(1.5 * LOAD)
    assert curves["soft, other end"].dashes == 1 and curves["soft"].y == pytest.approx(LOAD)


CARD = MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)


def made(symmetry: str):
    way = np.linspace(0.0, 240.0, 61)[1:].tolist()
    model = inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)
    return model, run_of(ran(model, CARD))


@pytest.fixture(scope="module")
def quarter():
    return made("quarter")


@pytest.fixture(scope="module")
def picture(quarter):
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "save", lambda _, charts: drawn.append(charts))
        report.draw_beam(*quarter, Path("beam.png"), "150 mm, 140 kPa")
    return drawn[0]


def test_quarter_is_mirrored_to_the_whole_beam(quarter):
    part, run = quarter
    beam, same = whole_beam(part, run), whole_beam(*made("full"))
    for k in (1, 2):
        a, b = (np.round(m[0].points + m[k], 6) + 0.0 for m in (beam, same))
        np.testing.assert_allclose(np.unique(a, axis=0), np.unique(b, axis=0), atol=1e-5)
    assert len(beam[0].quads) == len(same[0].quads)
    one, other = (enclosed_volume(m.points + bent, m.quads) for m, _, bent in (beam, same))
    assert one == pytest.approx(other)
    wanted = surface_strain(part.mesh, run.inflated)
    for mesh, inflated, _ in (beam, same):
        found = surface_strain(mesh, inflated)[: len(part.mesh.quads)]
        assert found == pytest.approx(wanted, abs=1e-12)


def test_bodies_touch_the_inflated_beam(quarter):
    beam = whole_beam(*quarter)
    bodies = bodies_of(quarter[0], beam, 30.0)
    at = beam[0].points + beam[1]
    assert bodies.support_radius == 50.0 and bodies.collar_radius == 120.0
    for z, y in bodies.supports:
        gap = np.hypot(at[:, 2] - z, at[:, 1] - y).min() - 50.0
        assert gap == pytest.approx(0.0, abs=1e-6)
    inside = np.abs(at[:, 2]) <= 72.5
    reach = np.hypot(at[inside, 0], at[inside, 1] - bodies.collar_height - 30.0).max()
    assert reach == pytest.approx(120.0)


# The picture shows the run's own places, strains and bodies
def places(model, moved, name, axes):
    """Return places (k, 2) mm of the nodes of a set, and their mirror image in the first axis."""
    at = (model.mesh.points + moved)[model.mesh.node_sets[name]][:, axes]
    return np.concatenate([at, at * [-1.0, 1.0]])


def same(points, others) -> bool:
    return max(cKDTree(a).query(b)[0].max() for a, b in ((points, others), (others, points))) < 0.01


def test_picture_has_lines_of_inflated_tube_and_ring_at_mid_span(quarter, picture):
    model, run = quarter
    side = [places(model, run.inflated, name, [2, 1]) for name in ("top_line", "bottom_line")]
    rings = [places(model, moved, "mid_span", [0, 1]) for moved in (run.inflated, run.bent)]
    every = [lines(chart, "inflated")[0] for chart in picture.charts] + lines(
        picture.charts[2], "bent"
    )
    for found, wanted in zip(every, [np.vstack(side)] * 2 + rings, strict=True):
        assert same(found.T, wanted)
        np.testing.assert_array_equal(found[:, 0], found[:, -1])
    assert every[3][1].max() < every[2][1].max() - 200.0  # went down with the collar


def test_colours_are_axial_strains_at_the_end(quarter, picture):
    model, run = quarter
    strain = surface_strain(model.mesh, run.bent)[:, 0]
    at = (model.mesh.points + run.bent)[:, [2, 1]]
    for chart in picture.charts[:2]:
        (faces,) = (s for s in chart.series if s.look == "faces")
        # The half that is seen is the quarter and its image beyond mid-span.
        wanted = np.sort(np.tile(100 * strain, 2))
        np.testing.assert_allclose(np.sort(faces.values), wanted, rtol=1e-5, atol=1e-9)
        corners = np.column_stack([faces.x, faces.y])
        assert same(corners, np.concatenate([at, at * [-1.0, 1.0]]))
    assert picture.charts[0].scale == "log strain along the axis, %"
    assert picture.charts[0].title == "150 mm, 140 kPa"


def test_straps_of_a_beam_hang_on_its_bent_axis():
    wall = PlainWall(400.0, 300.0, 60.0, wrinkles=False)
    model = BeamModel(
        TubeCrossSection(170.0, 0.1, wall), 3000.0, [100.0], 1000.0, roller_below=300.0
    )
    history = MembraneSolver().run(model, HypoelasticLaw.linear(1.0, 1.0, 1.0))
    run = BendingRun(*([0.0, 100.0],) * 4, history.displacement[0], history.displacement[-1], [])
    bodies = bodies_of(model, whole_beam(model, run), 100.0)
    assert bodies.collars == (-500.0, 500.0) and -100.0 < bodies.collar_height < -75.0
    assert bodies.supports == ((-1500.0, -300.0), (1500.0, -300.0))
