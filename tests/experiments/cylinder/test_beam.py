"""The whole beam of a run that meshed a part of it, and where the bodies are."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import BendingRun, run_of
from bubblefit.experiments.cylinder.report import Beam, bodies_of, draw_beam, whole_beam
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, inflated_cylinder
from bubblefit.meshes.mesh import enclosed_volume, surface_strain
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from ...cylinder_cases import ran
from ...drawings import data

WAY = np.linspace(0.0, 240.0, 61)


def model(symmetry: str = "quarter") -> CylinderModel:
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


def run(m: CylinderModel) -> BendingRun:
    ended = run_of(ran(m, MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)))
    assert ended is not None
    return ended


def test_a_quarter_makes_the_whole_beam():
    whole, quarter = run(model("full")), run(model())
    beam, same = whole_beam(model(), quarter), whole_beam(model("full"), whole)
    for one, other in ((beam.bent, same.bent), (beam.inflated, same.inflated)):
        a, b = (np.round(m.mesh.points + u, 6) + 0.0 for m, u in ((beam, one), (same, other)))
        np.testing.assert_allclose(np.unique(a, axis=0), np.unique(b, axis=0), atol=1e-5)
    assert len(beam.mesh.quads) == len(same.mesh.quads)
    at = beam.mesh.points + beam.bent
    assert enclosed_volume(at, beam.mesh.quads) == pytest.approx(
        enclosed_volume(same.mesh.points + same.bent, same.mesh.quads)
    )
    for b in (beam, same):
        strain = surface_strain(b.mesh, b.inflated)
        assert strain[: len(model().mesh.quads)] == pytest.approx(
            surface_strain(model().mesh, quarter.inflated), abs=1e-12
        )


def test_bodies_touch_the_inflated_beam():
    m = model()
    beam = whole_beam(m, run(m))
    bodies = bodies_of(m, beam, 30.0)
    at = beam.mesh.points + beam.inflated
    assert bodies.support_radius == 50.0 and bodies.collar_radius == 120.0
    for z, y in bodies.supports:
        gap = np.hypot(at[:, 2] - z, at[:, 1] - y).min() - 50.0
        assert gap == pytest.approx(0.0, abs=1e-6)
    inside = np.abs(at[:, 2]) <= 72.5
    reach = np.hypot(at[inside, 0], at[inside, 1] - bodies.collar_height - 30.0).max()
    assert reach == pytest.approx(120.0)


@pytest.mark.parametrize(
    ("points", "height", "top"),
    [
        # In a collar of 100 mm in radius a point 60 mm aside is touched 80 mm above the middle.
        ([[0.0, 20.0, 0.0], [60.0, 30.0, 0.0]], 10.0, -50.0),
        # As long as the collar, and no longer; as wide as its inside, less nothing.
        ([[0.0, 90.0, 20.1], [0.0, 95.0, -20.1], [0.0, 20.0, 20.0]], 10.0, -80.0),
        ([[-99.0, 20.0, 0.0], [100.0, 500.0, 0.0]], 10.0, 20.0 - np.sqrt(199.0)),
        # On a support of 50 mm in radius 30 mm beside its middle, on either side.
        ([[0.0, 20.0, 0.0], [0.0, -5.0, 170.0]], -45.0, -80.0),
        ([[0.0, 20.0, 0.0], [0.0, -5.0, -230.0]], -45.0, -80.0),
        ([[0.0, 20.0, 0.0], [0.0, -99.0, 250.0]], 10.0, -80.0),
    ],
)
def test_bodies_touch_where_the_beam_is_nearest(points: Any, height: float, top: float):
    """Beside a node that stands on a support 60 mm high."""
    rest = np.array([*points, [0.0, 60.0, 200.0]])
    made: Any = SimpleNamespace(
        supports=SimpleNamespace(diameter=100.0, span=400.0),
        collar=SimpleNamespace(inner_diameter=200.0, length=40.0),
    )
    mesh: Any = SimpleNamespace(points=rest - [0.0, 7.0, 0.0])
    moved = np.tile([0.0, 7.0, 0.0], (len(rest), 1))
    found = bodies_of(made, Beam(mesh, moved, moved), 12.0)
    assert found.supports == ((-200.0, pytest.approx(height)), (200.0, pytest.approx(height)))
    assert (found.support_radius, found.collar_radius, found.collar_length) == (50.0, 100.0, 40.0)
    assert found.collar_height == pytest.approx(top - 12.0)


CARD = MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)
Drawn = tuple[CylinderModel, BendingRun, Figure]


@pytest.fixture(scope="module")
def beam() -> Drawn:
    """A quarter of a tube, its run by the formula, and the picture of its end, not written."""
    model = inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=WAY[1:].tolist())
    run = run_of(ran(model, CARD))
    assert run is not None
    drawn: list[Figure] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bubblefit.reports.beam.save", lambda figure, path: drawn.append(figure))
        draw_beam(model, run, Path("beam.png"), "150 mm, 140 kPa")
    return model, run, drawn[0]


def places(model: CylinderModel, moved: np.ndarray, name: str, axes: list[int]) -> set[tuple]:
    """Of the nodes of a set and their mirror image in the first of two axes, 1e-6 mm."""
    at = (model.mesh.points + moved)[model.mesh.node_sets[name]][:, axes]
    return rounded(np.concatenate([at, at * [-1.0, 1.0]]))


def in_turn(model: CylinderModel, moved: np.ndarray, name: str, along: int) -> np.ndarray:
    """The nodes of a set in the order that they have along an axis at rest, (k, 3) mm."""
    nodes = model.mesh.node_sets[name]
    return (model.mesh.points + moved)[nodes[np.argsort(model.mesh.points[nodes, along])]]


def rounded(points: np.ndarray) -> set[tuple]:
    return {tuple(p) for p in (np.round(points, 6) + 0.0).tolist()}


def length(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=1), axis=0).sum())


def test_the_dashed_outline_is_the_inflated_tube_from_the_side(beam: Drawn):
    model, run, figure = beam
    lines = ("top_line", "bottom_line")
    expected = set().union(*(places(model, run.inflated, name, [2, 1]) for name in lines))
    ways = [in_turn(model, run.inflated, name, along=2)[:, [2, 1]].T for name in lines]
    ends = np.linalg.norm(ways[0][:, -1] - ways[1][:, -1])
    around = 2 * (sum(length(way) for way in ways) + ends)
    for axes in figure.axes[:2]:
        (outline,) = data(axes)
        assert rounded(outline.T) == expected
        # Once there along the top, down, and back along the bottom: no way is crossed.
        np.testing.assert_array_equal(outline[:, 0], outline[:, -1])
        assert length(outline) == pytest.approx(around)


def test_the_cut_is_the_ring_of_mid_span_inflated_and_at_the_end(beam: Drawn):
    model, run, figure = beam
    before, now = data(figure.axes[2])
    for ring, moved in ((before, run.inflated), (now, run.bent)):
        assert rounded(ring.T) == places(model, moved, "mid_span", [0, 1])
        np.testing.assert_array_equal(ring[:, 0], ring[:, -1])
        # In turn around the ring: twice the length of the half that was meshed.
        half = in_turn(model, moved, "mid_span", along=1)[:, :2].T
        assert length(ring) == pytest.approx(2 * length(half))
    assert now[1].max() < before[1].max() - 200.0  # went down with the collar


def test_the_colours_are_strains_along_the_axis_at_the_end(beam: Drawn):
    model, run, figure = beam
    strain = surface_strain(model.mesh, run.bent)[:, 0]
    at = model.mesh.points + run.bent
    for axes in figure.axes[:2]:
        (faces,) = (c for c in axes.collections if isinstance(c, PolyCollection))
        # The half that is seen is the quarter and its image beyond mid-span.
        np.testing.assert_allclose(np.sort(faces.get_array()), np.sort(np.tile(strain, 2)))
        corners = np.concatenate([path.vertices for path in faces.get_paths()])
        image = at[:, [2, 1]] * [-1.0, 1.0]
        assert rounded(corners) == rounded(np.concatenate([at[:, [2, 1]], image]))
    assert figure.axes[3].get_ylabel() == "log strain along the axis"
    assert figure.axes[0].get_title("left") == "150 mm, 140 kPa"


def test_supports_and_collar_stand_where_the_test_has_them(beam: Drawn):
    model, run, figure = beam
    inflated = model.mesh.points + run.inflated
    whole, _, cut, _ = figure.axes
    circles = [p for p in whole.patches if isinstance(p, Circle)]
    half = 0.5 * model.supports.span
    assert [c.center[0] for c in circles] == [-half, half]
    assert [c.radius for c in circles] == [0.5 * model.supports.diameter] * 2
    # Below the inflated tube, within what a chord of its quads leaves open.
    lowest = inflated[model.mesh.node_sets["bottom_line"], 1].min()
    for circle in circles:
        assert circle.center[1] + circle.radius == pytest.approx(lowest, abs=1.0)
    inside = next(p for p in whole.patches if isinstance(p, Rectangle))
    assert inside.get_width() == model.collar.length
    (ring,) = (p for p in cut.patches if isinstance(p, Circle))
    inner = 0.5 * model.collar.inner_diameter
    # It touched the crown and then went down by the deflection of the last frame.
    crown = inflated[model.mesh.node_sets["top_line"], 1].max()
    assert ring.center[1] + inner == pytest.approx(crown - run.deflection[-1], abs=1.0)
