"""The whole beam of a run that meshed a part of it, its bodies, and the picture of its end."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.cylinder import report
from bubblefit.experiments.cylinder.predicted import BendingRun, run_of
from bubblefit.experiments.cylinder.report import bodies_of, whole_beam
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, PlainWall, TubeSection
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.mesh import enclosed_volume, surface_strain
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial import cKDTree

from ...cylinder_cases import ran
from ...drawings import lines

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


def test_a_quarter_makes_the_whole_beam(quarter):
    part, run = quarter
    beam, same = whole_beam(part, run), whole_beam(*made("full"))
    for one, other in ((beam.bent, same.bent), (beam.inflated, same.inflated)):
        a, b = (np.round(m.mesh.points + u, 6) + 0.0 for m, u in ((beam, one), (same, other)))
        np.testing.assert_allclose(np.unique(a, axis=0), np.unique(b, axis=0), atol=1e-5)
    assert len(beam.mesh.quads) == len(same.mesh.quads)
    one, other = (enclosed_volume(b.mesh.points + b.bent, b.mesh.quads) for b in (beam, same))
    assert one == pytest.approx(other)
    wanted = surface_strain(part.mesh, run.inflated)
    for b in (beam, same):
        found = surface_strain(b.mesh, b.inflated)[: len(part.mesh.quads)]
        assert found == pytest.approx(wanted, abs=1e-12)


def test_bodies_touch_the_inflated_beam(quarter):
    beam = whole_beam(*quarter)
    bodies = bodies_of(quarter[0], beam, 30.0)
    at = beam.mesh.points + beam.inflated
    assert bodies.support_radius == 50.0 and bodies.collar_radius == 120.0
    for z, y in bodies.supports:
        gap = np.hypot(at[:, 2] - z, at[:, 1] - y).min() - 50.0
        assert gap == pytest.approx(0.0, abs=1e-6)
    inside = np.abs(at[:, 2]) <= 72.5
    reach = np.hypot(at[inside, 0], at[inside, 1] - bodies.collar_height - 30.0).max()
    assert reach == pytest.approx(120.0)


# The picture shows the run's own places, strains and bodies


def places(model, moved, name, axes):
    """Of the nodes of a set and their mirror image in the first of two axes, (k, 2) mm."""
    at = (model.mesh.points + moved)[model.mesh.node_sets[name]][:, axes]
    return np.concatenate([at, at * [-1.0, 1.0]])


def same(points, others) -> bool:
    return max(cKDTree(a).query(b)[0].max() for a, b in ((points, others), (others, points))) < 0.01


def test_the_dashed_outline_is_the_inflated_tube_from_the_side(quarter, picture):
    model, run = quarter
    both = ("top_line", "bottom_line")
    expected = np.vstack([places(model, run.inflated, name, [2, 1]) for name in both])
    for chart in picture.charts[:2]:
        (outline,) = lines(chart, "inflated")
        assert same(outline.T, expected)
        np.testing.assert_array_equal(outline[:, 0], outline[:, -1])


def test_the_cut_is_the_ring_of_mid_span_inflated_and_at_the_end(quarter, picture):
    model, run = quarter
    ((before,), (now,)) = (lines(picture.charts[2], name) for name in ("inflated", "bent"))
    for ring, moved in ((before, run.inflated), (now, run.bent)):
        assert same(ring.T, places(model, moved, "mid_span", [0, 1]))
        np.testing.assert_array_equal(ring[:, 0], ring[:, -1])
    assert now[1].max() < before[1].max() - 200.0  # went down with the collar


def test_the_colours_are_strains_along_the_axis_at_the_end(quarter, picture):
    model, run = quarter
    strain = surface_strain(model.mesh, run.bent)[:, 0]
    at = (model.mesh.points + run.bent)[:, [2, 1]]
    for chart in picture.charts[:2]:
        (faces,) = (s for s in chart.series if s.look == "faces")
        # The half that is seen is the quarter and its image beyond mid-span.
        wanted = np.sort(np.tile(strain, 2))
        np.testing.assert_allclose(np.sort(faces.values), wanted, rtol=1e-5, atol=1e-9)
        corners = np.column_stack([faces.x, faces.y])
        assert same(corners, np.concatenate([at, at * [-1.0, 1.0]]))
    assert picture.charts[0].scale == "log strain along the axis"
    assert picture.charts[0].title == "150 mm, 140 kPa"


def test_straps_of_a_beam_hang_on_its_bent_axis():
    wall = PlainWall(400.0, 300.0, 60.0, wrinkles=False)
    model = BeamModel(TubeSection(170.0, 0.1, wall), 3000.0, [100.0], 1000.0, roller_below=300.0)
    history = MembraneSolver().run(model, HypoelasticLaw.linear(1.0, 1.0, 1.0))
    run = BendingRun(*([0.0, 100.0],) * 4, history.displacement[0], history.displacement[-1], [])
    bodies = bodies_of(model, whole_beam(model, run), 100.0)
    assert bodies.collars == (-500.0, 500.0) and -100.0 < bodies.collar_height < -75.0
    assert bodies.supports == ((-1500.0, -300.0), (1500.0, -300.0))
