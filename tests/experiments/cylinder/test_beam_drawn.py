"""The picture of a bent beam shows the run's own places, strains and bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import BendingRun, run_of
from bubblefit.experiments.cylinder.report import draw_beam
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, inflated_cylinder
from bubblefit.meshes.mesh import surface_strain
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from ...cylinder_cases import ran
from ...drawings import data

WAY = np.linspace(0.0, 240.0, 61)
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


def test_the_dashed_outline_is_the_inflated_tube_from_the_side(beam: Drawn) -> None:
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


def test_the_cut_is_the_ring_of_mid_span_inflated_and_at_the_end(beam: Drawn) -> None:
    model, run, figure = beam
    before, now = data(figure.axes[2])
    for ring, moved in ((before, run.inflated), (now, run.bent)):
        assert rounded(ring.T) == places(model, moved, "mid_span", [0, 1])
        np.testing.assert_array_equal(ring[:, 0], ring[:, -1])
        # In turn around the ring: twice the length of the half that was meshed.
        half = in_turn(model, moved, "mid_span", along=1)[:, :2].T
        assert length(ring) == pytest.approx(2 * length(half))
    assert now[1].max() < before[1].max() - 200.0  # went down with the collar


def test_the_colours_are_strains_along_the_axis_at_the_end(beam: Drawn) -> None:
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


def test_supports_and_collar_stand_where_the_test_has_them(beam: Drawn) -> None:
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
