"""Charts of bubble tests: profiles, heights, recorded pressures, and fields over the disk.

Charts of the sphere that image correlation measures to check its cameras are here, too.
"""

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from .charts import Array, Chart, Charts, dots, faces, line

#: Title, measured points (n, 3) mm, their distances (n,) mm from the sphere fitted to them,
#: positive outside of it, and which points it was fitted to, (n,) bool.
Sphere = tuple[str, Array, Array, NDArray[np.bool_]]

#: Largest number of pressures in one chart: of more, as many are drawn, evenly spread.
MAX_PRESSURES = 8
#: Largest number of points drawn in one map.
MAX_POINTS = 6000
AXES = (("Cut along the warp", "x, mm"), ("Cut along the fill", "y, mm"))

#: Least number of points on an axis from which they are taken as the profile along it.
MIN_ON_AXIS = 5

#: Profile of the bubble: deformed positions along an axis, and rises dz, (k,) mm each.
Cut = tuple[Array, Array]


def node_cut(points: Array, displacement: Array, axis: int) -> Cut:
    """Return the profile of a mesh along the x or the y axis.

    It goes through the nodes on the axis if there are enough of them; on other meshes
    displacements are interpolated linearly between the nodes beside the axis.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array, mm
        Nodes at rest.
    displacement : (n, 3) array, mm
        Displacement of the nodes.
    axis : {0, 1}
        0 for the x axis (warp), 1 for the y axis (fill).
    """
    xy = points[:, :2]
    is_on_axis = _on_axis(xy, axis)
    if is_on_axis.sum() >= MIN_ON_AXIS:
        return _cut_of(xy[is_on_axis, axis], displacement[is_on_axis], axis)
    along = np.linspace(xy[:, axis].min(), xy[:, axis].max(), 81)
    places = np.zeros((len(along), 2))
    places[:, axis] = along
    interpolated = scipy.interpolate.LinearNDInterpolator(xy, displacement)(places)
    is_within_mesh = np.isfinite(interpolated).all(axis=1)
    return _cut_of(along[is_within_mesh], interpolated[is_within_mesh], axis)


def point_cut(points: Array, displacement: Array, axis: int) -> Cut:
    """Return the profile of measured points along the x or the y axis.

    It is of the points on the axis if there are enough of them, else of those within half the
    usual distance of neighbouring points.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array, mm
        Points at rest.
    displacement : (n, 3) array, mm
        Displacement of the points.
    axis : {0, 1}
        0 for the x axis (warp), 1 for the y axis (fill).
    """
    xy = points[:, :2]
    is_on_axis = _on_axis(xy, axis)
    if is_on_axis.sum() < MIN_ON_AXIS and len(xy) > 1:
        spacing = np.median(scipy.spatial.cKDTree(xy).query(xy, k=2)[0][:, 1])
        # Half of it, and a little more, so that points at exactly half of it are taken.
        is_on_axis = np.abs(xy[:, 1 - axis]) <= 0.51 * spacing
    return _cut_of(xy[is_on_axis, axis], displacement[is_on_axis], axis)


def _on_axis(xy: Array, axis: int) -> NDArray[np.bool_]:
    """Return which points lie on the axis, (n,) bool.

    Parameters
    ----------
    xy : (n, 2) array, mm
    axis : {0, 1}
        0 for the x axis, 1 for the y axis.
    """
    size = np.abs(xy).max(initial=0.0)
    return np.abs(xy[:, 1 - axis]) <= 1e-6 * size


def _cut_of(along: Array, displacement: Array, axis: int) -> Cut:
    """Return deformed positions and rises dz, (n,) mm each, in the order of places at rest.

    Parameters
    ----------
    along : (n,) array, mm
        Positions at rest along the axis.
    displacement : (n, 3) array, mm
    axis : int
        0 for the x axis, 1 for the y axis.
    """
    order = np.argsort(along)
    return (along + displacement[:, axis])[order], displacement[order, 2]


def drawn_indices(count: int) -> list[int]:
    """Return the indices of the pressures that are drawn out of `count`: all, or evenly spread."""
    return np.unique(
        np.linspace(0, count - 1, min(count, MAX_PRESSURES)).round().astype(int)
    ).tolist()


def ranks(count: int) -> list[float]:
    """Return the places of `count` rising pressures along the colour scale (`Series.rank`)."""
    return np.linspace(0.1, 1.0, count).tolist()


def in_kilopascal(pressure: float) -> str:
    """Return a pressure, given in MPa, as text in kPa."""
    return f"{1e3 * pressure:.4g} kPa"


def words_on_omitted(count: int) -> str:
    """Return the sentence that not every pressure is drawn; "" where all are."""
    return f" Of {count} pressures {MAX_PRESSURES} are drawn." if count > MAX_PRESSURES else ""


def cut_charts(
    name: str,
    pressures: Sequence[float] | Array,
    points: Array,
    displacement: Sequence[Array] | Array,
    measured: Sequence[tuple[Array, Array]] = (),
    caption: str = "",
) -> Charts:
    """Return charts of the bubble's profile along both axes (Figs 4.10 and 4.11 of the thesis).

    Parameters
    ----------
    name : str
        Name of the figure.
    pressures : (frames,) array, MPa
        Pressure of each frame; colours follow the order of the frames.
    points : (n, 2) or (n, 3) array, mm
        Nodes at rest, of a full or a quarter mesh.
    displacement : (frames, n, 3) array, mm
        Displacement of the nodes at each pressure.
    measured : sequence of pairs
        For each frame, measured points (k, 2) and their displacements (k, 3), mm, which are drawn
        as dots.
    caption : str
        Caption of the figure, to which the number of pressures left out is added.
    """
    numbers = drawn_indices(len(pressures))
    charts = []
    for axis, (title, label) in enumerate(AXES):
        series = []
        for rank, k in zip(ranks(len(numbers)), numbers, strict=True):
            cut = node_cut(points, displacement[k], axis)
            words = in_kilopascal(pressures[k])
            series.append(line(words, *cut, rank=rank))
            if measured:
                series.append(dots(words, *point_cut(*measured[k], axis), rank=rank))
        source = "modelled and measured " if measured else ""
        alt = f"{title}: rises {source}at {len(numbers)} pressures"
        charts.append(Chart(title, label, "rise dz, mm", series, alt))
    return Charts(name, charts, f"{caption}{words_on_omitted(len(pressures))}")


def height_charts(
    pressures: Sequence[float],
    measured: Sequence[ArrayLike],
    modelled: Sequence[ArrayLike],
    measured_label: str = "measured",
) -> Charts:
    """Return charts of modelled heights, and of their errors, over measured heights.

    Parameters
    ----------
    pressures : (frames,) array_like, MPa
        Pressure of each frame; colours follow the order of the frames.
    measured, modelled : sequence of (k,) array_like, mm
        Heights z at the same places, an array for each frame.
    measured_label : str
        Word for the data, such as "measured" or "computed".
    """
    pairs = [
        (np.asarray(a, dtype=float).ravel(), np.asarray(b, dtype=float).ravel())
        for a, b in zip(measured, modelled, strict=True)
    ]
    all_measured = np.concatenate([z for z, _ in pairs])
    all_modelled = np.concatenate([z for _, z in pairs])
    difference = all_modelled - all_measured
    rms = np.sqrt(np.mean(difference**2))
    spread = np.sum((all_measured - all_measured.mean()) ** 2)
    r_squared = 1.0 - np.sum(difference**2) / spread if spread > 0 else np.nan
    lowest = min(0.0, all_measured.min(), all_modelled.min())
    ends = [lowest, 1.03 * max(all_measured.max(), all_modelled.max())]
    heights = [line("", ends, ends, colour=3)]
    differences = []
    for (z, model), p, rank in zip(pairs, pressures, ranks(len(pressures)), strict=True):
        heights.append(dots(in_kilopascal(p), z, model, rank=rank))
        differences.append(dots(in_kilopascal(p), z, model - z, rank=rank))
    x_label = f"{measured_label} z, mm"
    alt = f"modelled heights, {rms:.2g} mm RMS off"
    charts = [
        Chart(f"R² = {_below_one(r_squared)}", x_label, "modelled z, mm", heights, alt),
        Chart(
            f"RMS {rms:.2g} mm",
            x_label,
            f"modelled − {measured_label}, mm",
            differences,
            alt,
            level=0.0,
        ),
    ]
    return Charts("heights", charts, "")


def _below_one(value: float) -> str:
    """Return a number up to 1 with three decimals, as "1 - ..." where those would hide the rest."""
    return f"{value:.3f}" if not value > 0.999 else f"1 − {1.0 - value:.1e}"


def rise_charts(name: str, y_label: str, curves: Sequence[tuple[Array, Array]]) -> Charts:
    """Return a chart of heights over pressure, for inflations and releases in turn.

    Parameters
    ----------
    name : str
        Name of the figure.
    y_label : str
        Label of the axis of heights, with its unit.
    curves : sequence of pairs
        Pressures, MPa, and heights, mm: first inflation, first release, second inflation, and so
        on. One curve alone has no name in the legend.
    """
    names = [f"{'release' if k % 2 else 'inflation'} {k // 2 + 1}" for k in range(len(curves))]
    series = [
        line(
            label if len(curves) > 1 else "",
            1e3 * pressures,
            heights,
            marks=True,
            colour=k // 2,
            dashes=k % 2,
        )
        for k, (label, (pressures, heights)) in enumerate(zip(names, curves, strict=True))
    ]
    chart = Chart("", "pressure, kPa", y_label, series, from_zero=True)
    return Charts(name, [chart], "")


def clock_charts(times: Array, pressures: Array, heights: Array, used_pressures: Array) -> Charts:
    """Return charts of pressure and apex height over time, and of the height over the pressure.

    Parameters
    ----------
    times : (frames,) array, s
        Time of each frame of the camera by the clock of the pressure log.
    pressures : (frames,) array, MPa
        Pressure of the log at these times, NaN before its begin and after its end.
    heights : (frames,) array, mm
        Height of the apex in each frame.
    used_pressures : (k,) array, MPa
        Pressures of the frames that are used; the frame of the nearest pressure is marked.
    """
    kilopascals = 1e3 * pressures
    in_log = np.isfinite(pressures)
    used_frames = [
        np.argmin(np.where(in_log, np.abs(pressures - p), np.inf)) for p in used_pressures
    ]
    time = "time by the log's clock, s"
    pressure = "pressure, kPa"
    height = "height of the apex, mm"
    heights_over_pressure = [
        dots("all frames", kilopascals, heights),
        dots("taken", kilopascals[used_frames], heights[used_frames], colour=1, hollow=True),
    ]
    charts = [
        Chart("pressure of the log", time, pressure, [line("", times, kilopascals, marks=True)]),
        Chart("height", time, height, [line("", times, heights, marks=True, colour=1)]),
        Chart("", pressure, height, heights_over_pressure),
    ]
    return Charts("clock", charts, "")


def registration_charts(points: Array, maps: Sequence[tuple[str, Array]], edge: Array) -> Charts:
    """Return maps of values over measured points, with the rim and the directions of the yarns.

    They show whether points of a camera were registered well in the coordinates of the test.

    Parameters
    ----------
    points : (n, 2) array, mm
        Points at rest in the coordinates of the test.
    maps : sequence of (str, (n,) array)
        Title that ends in ", " and the unit, and the value of each point.
    edge : (m, 2) array, mm
        The rim as a closed line.
    """
    arrow = 0.5 * np.hypot(*edge.T).min()
    charts = []
    for title, values in maps:
        series = [
            dots("", points[:, 0], points[:, 1], max_points=MAX_POINTS, values=values),
            line("rim", *edge.T, colour=3),
            line("warp", [0.0, arrow], [0.0, 0.0], colour=1, ends=True),
            line("fill", [0.0, 0.0], [0.0, arrow], colour=0, ends=True),
        ]
        name, _, unit = title.rpartition(", ")
        charts.append(Chart(name, "x, mm", "y, mm", series, title, equal=True, scale=unit))
    return Charts("registration", charts, "")


def disk_charts(maps: Sequence[tuple[str, Array, Array]], edge: Array) -> Charts:
    """Return maps of fields over the disk, with colours about zero.

    Parameters
    ----------
    maps : sequence of (str, (n, 2) array, (n,) array)
        Title that ends in ", " and the unit, places, mm, and values there.
    edge : (m, 2) array, mm
        The rim as a closed line.
    """
    charts = []
    for title, places, values in maps:
        largest = max(np.abs(values).max(), 1e-9)
        corners = scipy.spatial.Delaunay(places).simplices  # (triangles, 3) indices of places
        series = [
            faces(places[corners], values[corners].mean(axis=1)),
            line("", *edge.T, colour=3),
        ]
        name, _, unit = title.rpartition(", ")
        charts.append(
            Chart(
                name,
                "x (warp), mm",
                "y (fill), mm",
                series,
                title,
                equal=True,
                scale=unit,
                shades="about zero",
                ends=(-largest, largest),
            )
        )
    return Charts("disk", charts, "")


def sphere_charts(frames: Sequence[Sphere]) -> Charts:
    """Return maps of the distances of measured points from the spheres fitted to them.

    The first six frames are drawn, with one colour scale. Points left out of a fit are crosses.
    """
    drawn_frames = frames[:6]
    charts = []
    largest = (
        max(np.abs(distance[is_used]).max() for _, _, distance, is_used in drawn_frames) or 1.0
    )
    for title, points, distance, is_used in drawn_frames:
        used_points = points[is_used]
        left_out = points[~is_used]
        series = [
            dots(
                "",
                used_points[:, 0],
                used_points[:, 1],
                max_points=MAX_POINTS,
                values=distance[is_used],
            ),
            dots(
                "left out",
                left_out[:, 0],
                left_out[:, 1],
                max_points=MAX_POINTS,
                colour=7,
                shape="cross",
            ),
        ]
        # The axes hold the points that are used; points left out may lie beyond them.
        x, y = ((p.min(), p.max()) for p in used_points[:, :2].T)
        margin = 0.05 * max(x[1] - x[0], y[1] - y[0])
        charts.append(
            Chart(
                title,
                "x, mm",
                "y, mm",
                series,
                title,
                equal=True,
                shades="about zero",
                scale="beyond the sphere, mm",
                ends=(-largest, largest),
                x_range=(x[0] - margin, x[1] + margin),
                y_range=(y[0] - margin, y[1] + margin),
            )
        )
    return Charts("spheres", charts, "")
