"""Draw values at places and surfaces over several loads: maps, a body to turn, ParaView's files.

Arrays are kept packed (`Packed`); Vega draws maps as coloured dots, and the surface for paper; a
script of the page draws that anew and turns it.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from math import prod
from pathlib import Path
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, check_one_of
from ..meshes.mesh import Mesh, meshio_of
from ..solvers.base import History
from ..storage.writing import replacing, write_text
from .charts import Array, Chart, Charts, Series, Shades, dots, ends_of, faces, line, shades_of
from .vega import COLOURS, WIDE, view

#: Steps between the least and the largest value; one more stands for what is not there.
STEPS = 65534
MISSING = 65535


@dataclass(frozen=True)
class Packed:
    """Hold numbers of any shape as text: value = least + step * (0 to `STEPS`).

    Attributes
    ----------
    shape : tuple of int
        Of the array, in C order.
    least, step : float
        In the numbers' unit.
    data : str
        Numbers of steps, `MISSING` for NaN: little endian unsigned 16 bit, zlib, base 64.
    """

    shape: tuple[int, ...]
    least: float
    step: float
    data: str

    @property
    def values(self) -> Array:
        """Return the array, within half a `step`; ValueError: damaged, or of another shape."""
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
    """Pack numbers as text; infinite ones and NaN are missing."""
    array = np.asarray(values, dtype=float)
    is_finite = np.isfinite(array)
    finite = array[is_finite]
    low = float(finite.min()) if len(finite) else 0.0
    high = float(finite.max()) if len(finite) else 0.0
    step = (high - low) / STEPS or 1.0
    steps = np.full(array.shape, MISSING, dtype="<u2")
    steps[is_finite] = np.rint((finite - low) / step)
    data = base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode()
    return Packed(array.shape, low, step, data)


#: Colours of the maps of a row: data, model and their difference.
SHADES_OF_ROW: tuple[Shades, ...] = ("from least", "from least", "about zero")
#: Share of the largest value below which a difference is one of rounding.
ROUNDING = 1e-6
#: Pixels along which a map is wide.
MAP_WIDTH = 150.0
#: Places that are drawn of one load; of more, every second, third ... is.
MAX_PLACES = 700


@dataclass(frozen=True)
class Panel:
    """Hold one map.

    Attributes
    ----------
    name : str
        Above the map.
    unit : str
        Of the values.
    values : Packed
        (places,) of all loads, one load after the other; of a solid, (loads, faces).
    shades : {"from least", "about zero"}
        Colours.
    row : int
        In which it stands; maps of a row with the same shades have the same ends of colours.
    """

    name: str
    unit: str
    values: Packed
    shades: Shades = "from least"
    row: int = 0


@dataclass(frozen=True)
class Maps:
    """Hold maps of the same places, with a slider of loads.

    Attributes
    ----------
    name : str
        Of the figure.
    loads : sequence of str
        In words.
    slider : str
        What it moves.
    counts : sequence of int
        Number of places of each load.
    places : Packed
        (all, 2), mm: of the first load, then of the second ...
    panels : sequence of Panel
        The maps.
    x_label, y_label : str
        Of the axes.
    caption, alt : str
        Of the figure.
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
    """Hold a surface of quads to turn, with a slider of loads.

    Attributes
    ----------
    name : str
        Of the figure.
    loads : sequence of str
        In words.
    slider : str
        What it moves.
    points : Packed
        (loads, nodes, 3), mm.
    faces : Packed
        (m, 4) numbers of nodes.
    shades : sequence of Panel
        Values that colour it.
    caption, alt : str
        Of the figure.
    warp : Packed or None
        (k, 3), mm: an arrow along the warp, as one line.
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


def warp_arrow(points: ArrayLike) -> Packed:
    """Return an arrow along x beside points (n, 3) mm, in their lowest plane."""
    nodes = np.asarray(points, dtype=float).reshape(-1, 3)
    radius = float(np.abs(nodes[:, 0]).max())
    low = float(nodes[:, 2].min())
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
    """Return maps of data, model and difference, a row a quantity.

    Parameters
    ----------
    name : str
        Of the figure.
    slider : str
        What the slider moves.
    loads : sequence of str
        In words.
    places : sequence of (n, 2) arrays, mm
        Of each load.
    rows : sequence of tuples
        Quantity, unit, and three sequences of (n,) arrays by load: data, model, difference.
    labels : two str
        Of the axes.
    caption, alt : str
        Of the figure.
    source : str
        Name of the data.
    """
    names = source, "modelled", f"modelled − {source}"
    steps = [max(1, -(-len(of_load) // MAX_PLACES)) for of_load in places]

    def thin(parts: Sequence[ArrayLike]) -> Array:
        return np.concatenate(
            [np.asarray(part, dtype=float)[::step] for part, step in zip(parts, steps, strict=True)]
        )

    panels = []
    for number, (title, unit, *values_of) in enumerate(rows):
        for kind, shades, values in zip(names, SHADES_OF_ROW, values_of, strict=True):
            panels.append(Panel(f"{title}, {kind}", unit, pack(thin(values)), shades, number))
    counts = [len(of_load[::step]) for of_load, step in zip(places, steps, strict=True)]
    if max(steps) > 1:
        caption += f" Of the places one in {max(steps)} is shown."
    return Maps(name, loads, slider, counts, pack(thin(places)), panels, *labels, caption, alt)


def frame_of(maps: Maps, values: Array, load: int) -> Array:
    """Return the part of values (all, ...) that belongs to a load."""
    first = sum(maps.counts[:load])
    return values[first : first + maps.counts[load]]


def row_ends(maps: Maps, panel: Panel, load: int) -> tuple[float, float]:
    """Return the ends of the colours, the same for maps of a row with the same shades."""
    row = [p for p in maps.panels if p.row == panel.row]
    values_of = {id(p): frame_of(maps, p.values.values, load) for p in row}
    values = np.concatenate([values_of[id(p)] for p in row if p.shades == panel.shades])
    low, high = ends_of(values, panel.shades)
    if panel.shades == "about zero":
        largest = max(float(np.nanmax(np.abs(v), initial=0.0)) for v in values_of.values())
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
    margin = 0.04 * float((high - low).max()) or 1.0
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
        x_range=(float(low[0]) - margin, float(high[0]) + margin),
        y_range=(float(low[1]) - margin, float(high[1]) + margin),
    )


def map_views(maps: Maps) -> list[dict[str, Any]]:
    """Return Vega's specifications of all maps at the last load."""
    last = len(maps.loads) - 1
    # About as wide as neighbours lie apart.
    area = float(np.clip(1.3 * MAP_WIDTH**2 / max(maps.counts), 5.0, 160.0))
    charts = [map_chart(maps, panel, last) for panel in maps.panels]
    return [view(chart, width=MAP_WIDTH, dot_area=area) for chart in charts]


def maps_data(maps: Maps) -> dict[str, Any]:
    """Return all values, packed, and the ends of the colours, for the page's script."""
    loads = range(len(maps.loads))
    ends = [[row_ends(maps, panel, load) for panel in maps.panels] for load in loads]
    return asdict(maps) | {"ends": ends}


def solid_data(solid: Solid) -> dict[str, Any]:
    """Return values and first view of a surface, for the page's script."""
    return asdict(solid) | {"colours": COLOURS, "turn": FIRST_TURN, "raise": FIRST_HEIGHT}


#: Quantities that colour a history, with their units and factors, and their components.
QUANTITIES = {"strain": ("log strain", "%", 100.0), "stress": ("stress", "MPa", 1.0)}
COMPONENTS = ("along the warp", "along the fill", "in shear")


def history(name: str, history: History, quantity: str, component: int, frame: int) -> Charts:
    """Return the deformed mesh coloured by its strain or stress: a tube from the side.

    Parameters
    ----------
    name : str
        Of the charts.
    history : History
        What is drawn.
    quantity : {"strain", "stress"}
        Colours of the quads.
    component : {0, 1, 2}
        Along the warp, along the fill, or in shear.
    frame : int
        Number of the load, negative from the last.

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
    """Return deformed points as they are drawn (n, 2), their nearness (n,), and the axes."""
    deformed = points + displacement
    size = np.ptp(points, axis=0)
    thin, upright, long = np.argsort(size, kind="stable")
    if size[2] > 0.2 * size[long]:  # a tube, along its longest side
        labels = ["x, mm", "y, mm", "z, mm"]
        return deformed[:, [long, upright]], deformed[:, thin], (labels[long], labels[upright])
    if np.ptp(deformed[:, 2]) > 0:  # a sheet that is inflated
        return *project(deformed, FIRST_TURN, FIRST_HEIGHT), PROJECTED_AXES
    return deformed[:, :2], deformed[:, 2], ("x, mm", "y, mm")


#: Direction from which a surface is seen at first, degrees: turned about z, over the horizon.
FIRST_TURN = 35.0
FIRST_HEIGHT = 28.0
PROJECTED_AXES = ("seen from above and aside, mm", "mm")


def painted(flat: Array, depth: Array, quads: NDArray[np.intp], values: Array) -> Series:
    """Return quads of points (n, 2), coloured by values (m,), the nearest (n,) drawn last."""
    order = np.argsort(depth[quads].mean(axis=1))
    return faces("", flat[quads[order]], values[order])


def solid_view(solid: Solid) -> dict[str, Any]:
    """Return Vega's specification of the surface at the last load, in the first of its shades."""
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
    """Project points on a screen.

    Parameters
    ----------
    points : (n, 3) array, mm
        The points.
    turn, height : float, degrees
        Direction from which they are seen: turned about z, over the horizon.

    Returns
    -------
    (n, 2) array, (n,) array
        Places to the right and up, and nearness, mm.
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
        At rest.
    displacement : (n, 3) array_like, mm
        Also written as point data, so the mesh at rest is `displacement` subtracted (ParaView:
        Warp By Vector, scale -1).
    path : path
        The file.
    point_data, cell_data : mapping of str to (n, ...) or (m, ...) array_like
        Fields of nodes and of quads.

    Raises
    ------
    OutputError
        The file cannot be written.
    ValueError
        A field does not have one row a node.
    """
    grid = meshio_of(mesh, displacement, point_data or {}, cell_data or {})
    with replacing(path) as temporary:
        grid.write(temporary, file_format="vtu")
    return Path(path)


def write_pvd(path: Path, files: Sequence[tuple[float, Path]]) -> Path:
    """Write a collection (.pvd) of files, each with its time; raises OutputError."""
    rows = [
        f'    <DataSet timestep="{time:.9g}" part="0" '
        f"file={quoteattr(file.relative_to(path.parent).as_posix())}/>\n"
        for time, file in files
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
    write_text(path, head + "".join(rows) + "  </Collection>\n</VTKFile>\n")
    return path
