"""Fields over the sheet at several loads: maps, surfaces that a reader turns, ParaView's files.

Arrays are kept as compressed text (`Packed`). Vega draws maps as coloured dots, and one view of a
surface, which is what a printed page shows; on the screen a script of the page draws and turns it.
"""

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from html import escape
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from ..meshes.mesh import Mesh, meshio_of
from ..solvers.base import History
from ..storage.writing import replacing, write_text
from .charts import Array, Chart, Charts, Series, Shades, dots, ends_of, faces, line, shades_of
from .vega import COLOURS, WIDE, view

#: Number of steps between the least and the largest packed value, and the code of a missing one.
STEPS = 65534
MISSING = 65535


@dataclass(frozen=True)
class Packed:
    """Hold an array as compressed text: value = least + step * k, with integers k to `STEPS`.

    Attributes
    ----------
    shape : tuple of int
        Shape of the array, in C order.
    least, step : float
        Least value, and distance of neighbouring values, in the unit of the array.
    data : str
        The integers k as little-endian unsigned 16-bit numbers, `MISSING` for NaN; compressed
        with zlib, in base64.
    """

    shape: tuple[int, ...]
    least: float
    step: float
    data: str

    @cached_property
    def values(self) -> Array:
        """Return the array, to within half a `step`.

        Raises
        ------
        ValueError
            The text is damaged, or does not have the size of the shape.
        """
        count = prod(self.shape)
        try:
            # One byte more than expected shows longer data, which are not unpacked.
            raw = zlib.decompressobj().decompress(base64.b64decode(self.data), 2 * count + 1)
        except zlib.error as error:
            raise ValueError(f"packed numbers are damaged: {error}") from None
        if len(raw) != 2 * count:
            raise ValueError(f"packed numbers: {len(raw) // 2}, expected {count}")
        steps = np.frombuffer(raw, dtype="<u2").astype(float)
        steps[steps == MISSING] = np.nan
        return np.asarray(self.least + self.step * steps.reshape(self.shape))


def pack(values: ArrayLike) -> Packed:
    """Return an array as compressed text; infinite numbers and NaN become missing values."""
    array = np.asarray(values, dtype=float)
    is_finite = np.isfinite(array)
    finite = array[is_finite]
    low = finite.min() if len(finite) else 0.0
    high = finite.max() if len(finite) else 0.0
    step = (high - low) / STEPS or 1.0
    steps = np.full(array.shape, MISSING, dtype="<u2")
    steps[is_finite] = np.rint((finite - low) / step)
    data = base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode()
    return Packed(array.shape, low, step, data)


#: Colour scales of the three maps of a row: data, model and their difference.
SHADES_OF_ROW: tuple[Shades, ...] = ("from least", "from least", "about zero")
#: Share of the largest value below which a difference counts as one of rounding.
ROUNDING = 1e-6
#: Width of a map, pixels.
MAP_WIDTH = 150.0
#: Largest number of places drawn at one load: of more, every second, third ... is.
MAX_PLACES = 700


@dataclass(frozen=True)
class Panel:
    """Hold the values of one quantity at all loads: one map, or one colouring of a surface.

    Attributes
    ----------
    name : str
        Heading of the map.
    unit : str
        Unit of the values.
    values : Packed
        Of a map, (places,) values at the places of all loads, one load after the other; of a
        surface, (loads, faces) values.
    shades : {"from least", "about zero"}
        Kind of the colour scale.
    row : int
        Index of the row in which the map stands; maps of one row with the same kind of colour
        scale share its ends.
    """

    name: str
    unit: str
    values: Packed
    shades: Shades = "from least"
    row: int = 0


@dataclass(frozen=True)
class Maps:
    """Hold a figure of maps over the same places, with a slider that chooses the load.

    Attributes
    ----------
    name : str
        Name that tells the figure from others.
    loads : sequence of str
        Loads in words, such as "20 kPa".
    slider : str
        Quantity that the slider changes, such as "pressure".
    counts : sequence of int
        Number of places at each load.
    places : Packed
        (sum of counts, 2) coordinates, mm, one load after the other.
    panels : sequence of Panel
        The maps.
    x_label, y_label : str
        Labels of the axes.
    caption, alt : str
        Text below the figure, and its description for those who cannot see it.
    """

    name: str
    loads: Sequence[str]
    slider: str
    counts: Sequence[int]
    places: Packed
    panels: Sequence[Panel]
    x_label: str
    y_label: str
    caption: str
    alt: str = ""
    part: Literal["maps"] = "maps"


@dataclass(frozen=True)
class Solid:
    """Hold a deformed surface that a reader can turn, with a slider that chooses the load.

    Attributes
    ----------
    name : str
        Name that tells the figure from others.
    loads : sequence of str
        Loads in words, such as "20 kPa".
    slider : str
        Quantity that the slider changes, such as "pressure".
    points : Packed
        (loads, nodes, 3) deformed positions, mm.
    faces : Packed
        (m, 4) indices of the nodes of each quad.
    shades : sequence of Panel
        Quantities by which a reader can colour the surface.
    caption, alt : str
        Text below the figure, and its description for those who cannot see it.
    warp : Packed or None
        (k, 3) corners, mm, of a line that draws an arrow along the warp.
    """

    name: str
    loads: Sequence[str]
    slider: str
    points: Packed
    faces: Packed
    shades: Sequence[Panel]
    caption: str
    alt: str = ""
    warp: Packed | None = None
    part: Literal["solid"] = "solid"


def warp_arrow(points: Array) -> Packed:
    """Return an arrow along x (the warp) beside points (n, 3) mm, at their lowest height."""
    nodes = points.reshape(-1, 3)
    radius = np.abs(nodes[:, 0]).max()
    low = nodes[:, 2].min()
    shape = ((1.05, 0), (1.3, 0), (1.23, 0.04), (1.3, 0), (1.23, -0.04))
    return pack([(x * radius, y * radius, low) for x, y in shape])


def maps_of(
    name: str,
    slider: str,
    loads: Sequence[str],
    places: Sequence[Array],
    rows: Sequence[tuple[str, str, Sequence[Array], Sequence[Array], Sequence[Array]]],
    labels: tuple[str, str],
    caption: str,
    alt: str,
    source: str = "measured",
) -> Maps:
    """Return maps of data, model and their difference: a row of three for each quantity.

    Parameters
    ----------
    name : str
        Name of the figure.
    slider : str
        Quantity that the slider changes, such as "pressure".
    loads : sequence of str
        Loads in words.
    places : sequence of (n, 2) arrays, mm
        Places at each load; n may differ from load to load.
    rows : sequence of tuples
        Name of a quantity, its unit, and three sequences with an (n,) array for each load: data,
        model, and model minus data.
    labels : two str
        Labels of the axes.
    caption, alt : str
        Text below the figure, and its description for those who cannot see it.
    source : str
        Word for the data, "measured" or "known".
    """
    names = source, "modelled", f"modelled − {source}"
    steps = [max(1, -(-len(of_load) // MAX_PLACES)) for of_load in places]

    def thin(parts: Sequence[ArrayLike]) -> Array:
        """Join the arrays of all loads, each with every `step`-th row only."""
        return np.concatenate(
            [np.asarray(part, dtype=float)[::step] for part, step in zip(parts, steps, strict=True)]
        )

    panels = []
    for number, (title, unit, *values_of) in enumerate(rows):
        packed = [pack(thin(values)) for values in values_of]
        sizes = [np.nanmax(np.abs(field.values), initial=0.0) for field in packed]
        rounding = ROUNDING * max(sizes)
        for kind, shades, values, size in zip(names, SHADES_OF_ROW, packed, sizes, strict=True):
            heading = f"{title}, {kind}"
            if shades == "about zero" and 0.0 < rounding and size < rounding:
                heading += f": below {rounding:.0e} {unit}"
            panels.append(Panel(heading, unit, values, shades, number))
    counts = [len(of_load[::step]) for of_load, step in zip(places, steps, strict=True)]
    if max(steps) > 1:
        caption += f" Of the places one in {max(steps)} is shown."
    points = pack(thin(places))
    return Maps(name, loads, slider, counts, points, panels, *labels, caption=caption, alt=alt)


def frame_of(maps: Maps, values: Array, load: int) -> Array:
    """Return the values at one load out of those of all loads (sum of counts, ...)."""
    first = sum(maps.counts[:load])
    return values[first : first + maps.counts[load]]


def row_ends(maps: Maps, panel: Panel, load: int) -> tuple[float, float]:
    """Return the ends of a map's colour scale, which maps of a row with the same shades share."""
    row = [p for p in maps.panels if p.row == panel.row]
    values_of = {id(p): frame_of(maps, p.values.values, load) for p in row}
    values = np.concatenate([values_of[id(p)] for p in row if p.shades == panel.shades])
    low, high = ends_of(values, panel.shades)
    if panel.shades == "about zero":
        largest = max(np.nanmax(np.abs(v), initial=0.0) for v in values_of.values())
        rounding = ROUNDING * largest
        low = min(low, -rounding)
        high = max(high, rounding)
    return low, high


def map_chart(maps: Maps, panel: Panel, load: int) -> Chart:
    """Return one map at one load as a chart of coloured dots, true to scale."""
    all_places = maps.places.values
    places = frame_of(maps, all_places, load)
    low = all_places.min(axis=0)
    high = all_places.max(axis=0)
    margin = 0.04 * (high - low).max() or 1.0
    values = frame_of(maps, panel.values.values, load)
    spots = dots("", places[:, 0], places[:, 1], max_points=max(len(places), 1), values=values)
    return Chart(
        panel.name,
        maps.x_label,
        maps.y_label,
        [spots],
        f"{panel.name}, {panel.unit}, {maps.loads[load]}",
        equal=True,
        scale=panel.unit,
        shades=panel.shades,
        ends=row_ends(maps, panel, load),
        x_range=(low[0] - margin, high[0] + margin),
        y_range=(low[1] - margin, high[1] + margin),
    )


def map_views(maps: Maps) -> list[dict[str, Any]]:
    """Return Vega's specifications of all maps at the last load."""
    last = len(maps.loads) - 1
    # Dots are about as wide as the distance of neighbours.
    area = np.clip(1.3 * MAP_WIDTH**2 / max(maps.counts), 5.0, 160.0)
    charts = [map_chart(maps, panel, last) for panel in maps.panels]
    return [view(chart, width=MAP_WIDTH, dot_area=area) for chart in charts]


def maps_data(maps: Maps) -> dict[str, Any]:
    """Return all packed values, and the ends of the colour scales, for the script of the page."""
    loads = range(len(maps.loads))
    ends = [[row_ends(maps, panel, load) for panel in maps.panels] for load in loads]
    return asdict(maps) | {"ends": ends}


def solid_data(solid: Solid) -> dict[str, Any]:
    """Return the packed values and the first view of a surface, for the script of the page."""
    return asdict(solid) | {"colours": COLOURS, "turn": FIRST_TURN, "raise": FIRST_HEIGHT}


#: Quantities that colour a deformed mesh: title, unit and factor; then names of their components.
QUANTITIES = {"strain": ("log strain", "%", 100.0), "stress": ("stress", "MPa", 1.0)}
COMPONENTS = ("along the warp", "along the fill", "in shear")


def history_charts(
    name: str, history: History, quantity: str, component: int, frame: int
) -> Charts:
    """Return a chart of the deformed mesh, coloured by a component of strain or stress.

    A tube is seen from the side, an inflated sheet from above and aside, a flat one from above.

    Parameters
    ----------
    name : str
        Name of the figure.
    history : History
        Result of the analysis.
    quantity : {"strain", "stress"}
        Quantity that colours the quads: logarithmic strain, or stress.
    component : {0, 1, 2}
        Component along the warp, along the fill, or in shear.
    frame : int
        Index of the reported load; negative indices count from the last.

    Raises
    ------
    InputError
        There is no such quantity, component or frame.
    """
    count = len(history.load)
    check_one_of(quantity, QUANTITIES, "quantity")
    check_one_of(component, range(len(COMPONENTS)), "component")
    if not -count <= frame < count:
        raise InputError(None, "frame", f"expected {-count} to {count - 1}, got {frame}")
    title, unit, factor = QUANTITIES[quantity]
    of_frames = history.strain() if quantity == "strain" else history.stress()
    values = factor * of_frames[frame, :, component]
    flat, depth, axes = _projected(history.mesh.points, history.displacement[frame])
    body = painted(flat, depth, history.mesh.quads, values)
    label = f"{title} {COMPONENTS[component]}, {unit}"
    alt = f"{name}: {label}"
    shades = shades_of(values)
    chart = Chart(name, *axes, [body], alt, equal=True, scale=label, shades=shades)
    return Charts(name, [chart], f"{alt}, frame {frame % count + 1} of {count}")


def _projected(points: Array, displacement: Array) -> tuple[Array, Array, tuple[str, str]]:
    """Return deformed points on the page (n, 2), nearness to the eye (n,), and the axes' labels.

    Parameters
    ----------
    points, displacement : (n, 3) array, mm
    """
    deformed = points + displacement
    size = np.ptp(points, axis=0)
    thin, upright, long = np.argsort(size, kind="stable")
    if size[2] > 0.2 * size[long]:  # a tube, along its longest side
        labels = ["x, mm", "y, mm", "z, mm"]
        return deformed[:, [long, upright]], deformed[:, thin], (labels[long], labels[upright])
    if np.ptp(deformed[:, 2]) > 0:  # a sheet that is inflated
        return *project(deformed, FIRST_TURN, FIRST_HEIGHT), PROJECTED_AXES
    return deformed[:, :2], deformed[:, 2], ("x, mm", "y, mm")


#: Direction from which a surface is seen at first, degrees: angle about z, and elevation.
FIRST_TURN = 35.0
FIRST_HEIGHT = 28.0
PROJECTED_AXES = ("seen from above and aside, mm", "mm")


def painted(flat: Array, depth: Array, quads: NDArray[np.intp], values: Array) -> Series:
    """Return coloured quads in the order of their depth, so that the nearest are drawn last.

    Parameters
    ----------
    flat : (n, 2) array
        Places of the nodes on the page.
    depth : (n,) array
        Nearness of the nodes to the eye.
    quads : (m, 4) array
        Indices of the nodes of each quad.
    values : (m,) array
        Value of each quad on the colour scale.
    """
    order = np.argsort(depth[quads].mean(axis=1))
    return faces(flat[quads[order]], values[order])


def solid_view(solid: Solid) -> dict[str, Any]:
    """Return Vega's specification of a surface at the last load, coloured by its first quantity."""
    panel = solid.shades[0]
    quads = np.rint(solid.faces.values).astype(int)
    values = panel.values.values
    flat, nearness = project(solid.points.values[-1], FIRST_TURN, FIRST_HEIGHT)
    series = [painted(flat, nearness, quads, values[-1])]
    if solid.warp is not None:
        arrow, _ = project(solid.warp.values, FIRST_TURN, FIRST_HEIGHT)
        series.append(line("warp", *arrow.T, colour=1))
    chart = Chart(
        "",
        *PROJECTED_AXES,
        series,
        solid.alt or solid.caption,
        equal=True,
        scale=f"{panel.name}, {panel.unit}",
        shades=panel.shades,
        ends=ends_of(values, panel.shades),
    )
    return view(chart, WIDE)


def project(points: Array, turn: float, height: float) -> tuple[Array, Array]:
    """Project points in space onto a plane, as seen from far away.

    Parameters
    ----------
    points : (n, 3) array, mm
        Points in space.
    turn, height : float, degrees
        Direction of the eye: angle about z, and elevation above the x-y plane.

    Returns
    -------
    (n, 2) array, (n,) array
        Coordinates to the right and upwards in the plane, and nearness to the eye, mm.
    """
    a = np.radians(turn)
    b = np.radians(height)
    right = points @ (np.cos(a), np.sin(a), 0.0)
    away = points @ (-np.sin(a), np.cos(a), 0.0)
    up = points[:, 2] * np.cos(b) + away * np.sin(b)
    nearness = points[:, 2] * np.sin(b) - away * np.cos(b)
    return np.column_stack([right, up]), nearness


def write_vtu(
    mesh: Mesh,
    displacement: ArrayLike,
    path: Path | str,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
) -> Path:
    """Write the deformed mesh as a VTK unstructured grid.

    Parameters
    ----------
    mesh : Mesh
        Mesh at rest.
    displacement : (n, 3) array_like, mm
        Displacement of the nodes. It is also written as point data, so that ParaView can take it
        off again to show the mesh at rest (Warp By Vector, scale -1).
    path : path
        File to write.
    point_data, cell_data : mapping of str to (n, ...) or (m, ...) array_like
        Fields of the nodes, and of the quads, by name.

    Raises
    ------
    OutputError
        The file cannot be written.
    ValueError
        A field does not have one row for each node, or each quad.
    """
    grid = meshio_of(mesh, displacement, point_data or {}, cell_data or {})
    with replacing(path) as temporary:
        grid.write(temporary, file_format="vtu")
    return Path(path)


def write_pvd(path: Path, files: Sequence[tuple[float, Path]]) -> Path:
    """Write a ParaView collection (.pvd), which joins VTK files to one series.

    Parameters
    ----------
    path : Path
        File to write.
    files : sequence of (float, Path)
        Time, here often a load, and file, which lies below the folder of the collection.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    rows = [
        f'    <DataSet timestep="{time:.9g}" part="0" '
        f'file="{escape(file.relative_to(path.parent).as_posix())}"/>\n'
        for time, file in files
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
    write_text(path, head + "".join(rows) + "  </Collection>\n</VTKFile>\n")
    return path
