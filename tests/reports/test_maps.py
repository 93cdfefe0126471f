"""Maps and surfaces over the sheet: packed values, shared colours, files for ParaView."""

from dataclasses import replace
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from bubblefit.meshes.mesh import Mesh
from bubblefit.reports import charts as declared
from bubblefit.reports import maps
from bubblefit.reports.charts import dots, scale_ends
from bubblefit.reports.maps import pack, write_vtu
from bubblefit.reports.vega import figure
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

FINITE = st.floats(-1e6, 1e6)


@given(arrays(float, st.integers(1, 40), elements=FINITE | st.just(np.nan)))
def test_packed_numbers_are_unpacked_to_their_step(values):
    packed = pack(values)
    back = packed.values
    np.testing.assert_array_equal(np.isnan(back), np.isnan(values))
    np.testing.assert_allclose(back, values, atol=0.5001 * packed.step, rtol=1e-9)
    for shape in ((len(values) - 1,), (len(values) + 1,), (len(values), 2)):
        with pytest.raises(ValueError, match="expected"):
            _ = replace(packed, shape=shape).values


def maps_at(places, one, two):
    rows = [("d", "mm", [one], [two], [two - one])]
    return maps.maps_of("m", "p", ["1"], [places], rows, ("x", "y"), "Words.", "")


def test_maps_of_a_row_share_their_colours():
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    found = maps_at(places, np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]))
    for own, ends in zip(found.panels, ((0, 4), (0, 4), (-2, 2)), strict=True):
        assert maps.row_ends(found, own, 0) == pytest.approx(ends)
    # Of rounding alone no map is red or blue: the ends are a millionth of the largest value.
    even = np.array([0.0, 20.0, 40.0])
    found = maps_at(places, even, even + np.array([0.0, 1e-11, -3e-11]))
    low, high = maps.row_ends(found, found.panels[2], 0)
    assert (low, high) == pytest.approx((-4e-5, 4e-5), rel=1e-3)
    rows = [("d", "mm", [even], [even], [0 * even])]
    known = maps.maps_of("m", "p", ["1"], [places], rows, ("x", "y"), "", "", "known")
    names = ["d, known", "d, modelled", "d, modelled − known: below 4e-05 mm"]
    assert [p.name for p in known.panels] == names
    found = maps_at(places, np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0]))
    chart = maps.map_chart(found, found.panels[2], 0)
    (spots,) = chart.series
    np.testing.assert_allclose(np.transpose([spots.x, spots.y]), places, atol=1e-4)
    assert spots.values == pytest.approx([0, 1, 2], abs=1e-4)
    assert scale_ends(chart) == pytest.approx((-2, 2)) and chart.scale == "mm" and chart.equal
    every = np.arange(5 * declared.MAX_POINTS)
    many = dots("a", every, every)
    assert len(many.x) == declared.MAX_POINTS and many.x[1] == 5.0
    places = np.random.default_rng(1).random((3 * maps.MAX_PLACES, 2))
    found = maps_at(places, places[:, 0], places[:, 0])
    assert found.counts == [maps.MAX_PLACES] and found.caption.endswith("one in 3 is shown.")


def test_surface_is_drawn_from_front_and_above():
    points = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for height, places, nearness in ((0.0, [[1, 0], [0, 0], [0, 1]], [0, -1, 0]),
                                     (90.0, [[1, 0], [0, 1], [0, 0]], [0, 0, 1])):  # fmt: skip
        flat, near = maps.project(points, 0.0, height)
        np.testing.assert_allclose(flat, places, atol=1e-12)
        np.testing.assert_allclose(near, nearness, atol=1e-12)
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1], [2, 1, 1]]], float)
    quads = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    shade = maps.Panel("s", "mm", pack([[1.0, np.nan]]))
    own = maps.Solid("n", ["1"], "p", pack(corners), pack(quads), [shade], "c")
    svg = figure(maps.solid_view(own))
    assert svg.count('fill="#999"') == 1 and svg.count('stroke="#440154"') == 1


def test_surface_shows_its_first_quantity_at_the_last_load():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]] * 2, float)
    shades = [
        maps.Panel("stress", "N/mm", pack([[1.0], [5.0]])),
        maps.Panel("strain", "%", pack([[7.0], [9.0]])),
    ]
    surface = maps.Solid("n", ["1", "2"], "p", pack(corners), pack([[0, 1, 2, 3]]), shades, "c")
    spec = maps.solid_view(surface)
    (legend,) = spec["legends"]
    assert legend["title"] == "stress, N/mm"
    assert {s["name"]: s.get("value") for s in spec["signals"]}["ends"] == pytest.approx([1.0, 5.0])
    assert "5.0" in str(spec["data"]) and "9.0" not in str(spec["data"])


@pytest.mark.parametrize(
    ("size", "moved", "axes", "places"),
    [
        ((4, 2, 0), (0.5, 0.25, 0.0), ("x, mm", "y, mm"), [0.5, 0.25]),
        ((4, 2, 1), (0.5, 0.25, 0.1), ("x, mm", "y, mm"), [0.5, 0.25]),
        ((1, 2, 8), (0.5, 0.25, 0.1), ("z, mm", "y, mm"), [0.1, 0.25]),
    ],
)
def test_deformed_mesh_is_seen_along_its_thinnest_side(size, moved, axes, places):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 1]], float) * size
    mesh = SimpleNamespace(points=points, quads=np.array([[0, 1, 2, 3]]))
    history = SimpleNamespace(
        load=np.ones(2), mesh=mesh, displacement=np.stack([0 * points, 0 * points + moved]),
        stress=lambda: np.array([[[1.0, 2, 3]], [[4.0, 5, 6]]]),
    )  # fmt: skip
    (chart,) = maps.history_charts("n", history, "stress", 1, -1).charts
    (body,) = chart.series
    assert (chart.x_label, chart.y_label) == axes and body.values == [5.0]
    assert [min(body.x), min(body.y)] == pytest.approx(places)


def test_vtu_file_holds_the_deformed_mesh(tmp_path):
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    mesh = Mesh(points, np.array([[0, 1, 2, 3]]), {"rim": np.arange(4)})
    u = np.arange(12.0).reshape(4, 3)
    path = write_vtu(
        mesh, u, tmp_path / "b.vtu", {"height": u[:, 2]}, {"thickness": np.array([0.81])}
    )
    back = meshio.read(path)
    assert back.points == pytest.approx(mesh.points + u)
    assert back.point_data["displacement"] == pytest.approx(u)
    assert back.point_data["height"] == pytest.approx(u[:, 2])
    assert back.cell_data["thickness"][0] == pytest.approx([0.81])
    with pytest.raises(ValueError, match="height: 3 rows for 4 nodes"):
        write_vtu(mesh, u, path, {"height": np.zeros(3)})
