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
from bubblefit.reports.charts import Charts
from scipy.spatial import cKDTree

from ...cylinder_cases import ran
from ...drawings import lines

WAY = np.linspace(0.0, 240.0, 61)
CARD = MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)
Drawn = tuple[CylinderModel, BendingRun, Charts]


@pytest.fixture(scope="module")
def beam() -> Drawn:
    """A quarter of a tube, its run by the formula, and the picture of its end, not written."""
    model = inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=WAY[1:].tolist())
    run = run_of(ran(model, CARD))
    assert run is not None
    drawn: list[Charts] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "bubblefit.experiments.cylinder.report.save", lambda _, charts: drawn.append(charts)
        )
        draw_beam(model, run, Path("beam.png"), "150 mm, 140 kPa")
    return model, run, drawn[0]


def places(model: CylinderModel, moved: np.ndarray, name: str, axes: list[int]) -> np.ndarray:
    """Of the nodes of a set and their mirror image in the first of two axes, (k, 2) mm."""
    at = (model.mesh.points + moved)[model.mesh.node_sets[name]][:, axes]
    return np.concatenate([at, at * [-1.0, 1.0]])


def in_turn(model: CylinderModel, moved: np.ndarray, name: str, along: int) -> np.ndarray:
    """The nodes of a set in the order that they have along an axis at rest, (k, 3) mm."""
    nodes = model.mesh.node_sets[name]
    return (model.mesh.points + moved)[nodes[np.argsort(model.mesh.points[nodes, along])]]


def same(points: np.ndarray, others: np.ndarray) -> bool:
    """Whether two sets of places are the same, to six digits."""
    far = [cKDTree(a).query(b)[0].max() for a, b in ((points, others), (others, points))]
    return max(far) < 0.01


def length(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=1), axis=0).sum())


def test_the_dashed_outline_is_the_inflated_tube_from_the_side(beam: Drawn) -> None:
    model, run, figure = beam
    both = ("top_line", "bottom_line")
    expected = np.vstack([places(model, run.inflated, name, [2, 1]) for name in both])
    ways = [in_turn(model, run.inflated, name, along=2)[:, [2, 1]].T for name in both]
    ends = np.linalg.norm(ways[0][:, -1] - ways[1][:, -1])
    around = 2 * (sum(length(way) for way in ways) + ends)
    for chart in figure.charts[:2]:
        (outline,) = lines(chart, "inflated")
        assert same(outline.T, expected)
        # Once there along the top, down, and back along the bottom: no way is crossed.
        np.testing.assert_array_equal(outline[:, 0], outline[:, -1])
        assert length(outline) == pytest.approx(around, rel=1e-4)


def test_the_cut_is_the_ring_of_mid_span_inflated_and_at_the_end(beam: Drawn) -> None:
    model, run, figure = beam
    ((before,), (now,)) = (lines(figure.charts[2], name) for name in ("inflated", "bent"))
    for ring, moved in ((before, run.inflated), (now, run.bent)):
        assert same(ring.T, places(model, moved, "mid_span", [0, 1]))
        np.testing.assert_array_equal(ring[:, 0], ring[:, -1])
        # In turn around the ring: twice the length of the half that was meshed.
        half = in_turn(model, moved, "mid_span", along=1)[:, :2].T
        assert length(ring) == pytest.approx(2 * length(half), rel=1e-4)
    assert now[1].max() < before[1].max() - 200.0  # went down with the collar


def test_the_colours_are_strains_along_the_axis_at_the_end(beam: Drawn) -> None:
    model, run, figure = beam
    strain = surface_strain(model.mesh, run.bent)[:, 0]
    at = model.mesh.points + run.bent
    for chart in figure.charts[:2]:
        (faces,) = (s for s in chart.series if s.look == "faces")
        # The half that is seen is the quarter and its image beyond mid-span.
        wanted = np.sort(np.tile(strain, 2))
        np.testing.assert_allclose(np.sort(faces.values), wanted, rtol=1e-5, atol=1e-9)
        corners = np.column_stack([faces.x, faces.y])
        image = at[:, [2, 1]] * [-1.0, 1.0]
        assert same(corners, np.concatenate([at[:, [2, 1]], image]))
    assert figure.charts[0].scale == "log strain along the axis"
    assert figure.charts[0].title == "150 mm, 140 kPa"


def test_supports_and_collar_stand_where_the_test_has_them(beam: Drawn) -> None:
    model, run, figure = beam
    inflated = model.mesh.points + run.inflated
    whole, _, cut = figure.charts
    supports = lines(whole, "support")
    half = 0.5 * model.supports.span
    assert [middle(ring)[0] for ring in supports] == pytest.approx([-half, half])
    widths = [np.ptp(ring[0]) for ring in supports]
    assert widths == pytest.approx([model.supports.diameter] * 2)
    # Below the inflated tube, within what a chord of its quads leaves open.
    lowest = inflated[model.mesh.node_sets["bottom_line"], 1].min()
    for ring in supports:
        assert ring[1].max() == pytest.approx(lowest, abs=1.0)
    wall = lines(whole, "collar")[0]
    assert np.ptp(wall[0]) == pytest.approx(model.collar.length)
    (ring,) = lines(cut, "collar")
    inner = 0.5 * model.collar.inner_diameter
    # It touched the crown and then went down by the deflection of the last frame.
    crown = inflated[model.mesh.node_sets["top_line"], 1].max()
    assert middle(ring)[1] + inner == pytest.approx(crown - run.deflection[-1], abs=1.0)


def middle(ring: np.ndarray) -> np.ndarray:
    return 0.5 * (ring.min(axis=1) + ring.max(axis=1))
