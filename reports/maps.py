"""Draw values at places and surfaces over several loads: maps, a body to turn, ParaView's files.

Arrays are kept packed (`Packed`); Vega draws maps as coloured dots, and the surface for paper; a
script of the page draws that anew and turns it."""

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
    """Numbers of any shape: value = least + step * (0 to `STEPS`), `MISSING` for NaN.
    shape : of the array, in C order. least, step : in the numbers' unit. data : little endian
    unsigned 16 bit, zlib, base 64."""

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
    known = np.isfinite(array)
    least = float(array[known].min()) if known.any() else 0.0
    most = float(array[known].max()) if known.any() else 0.0
    step = (most - least) / STEPS or 1.0
    steps = np.full(array.shape, MISSING, dtype="<u2")
    steps[known] = np.rint((array[known] - least) / step)
    data = base64.b64encode(zlib.compress(steps.tobytes(), 9)).decode()
    return Packed(array.shape, least, step, data)


#: Colours of the maps of a row: data, model and their difference.
BESIDE: tuple[Shades, ...] = ("from least", "from least", "about zero")
#: Share of the largest value below which a difference is one of rounding.
ROUNDING = 1e-6
#: Pixels of a map, and of which a colour bar is four fifths.
SIDE = 150.0
#: Places that are drawn of one load; of more, every second, third ... is.
MOST_PLACES = 700


@dataclass(frozen=True)
class Panel:
    """One map: values (places of all loads one after the other,) in a unit; of a solid, values
    (loads, faces) that colour it.
    row : in which it stands; maps of a row with the same shades have the same ends of colours."""

    name: str
    unit: str
    values: Packed
    shades: Shades = "from least"
    row: int = 0


@dataclass(frozen=True)
class Maps:
    """Maps of the same places (all, 2) mm, of which each load has some (counts), with a slider."""

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
    """A surface of quads to turn: points (loads, nodes, 3) mm, faces (m, 4) of node numbers.
    warp : (k, 3) mm, an arrow along the warp, as one line."""

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
    every = np.asarray(points, dtype=float).reshape(-1, 3)
    radius = float(np.abs(every[:, 0]).max())
    low = float(every[:, 2].min())
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
    """Return maps of data, model and difference (n,), a row with a unit a quantity.
    source : the name of the data."""
    names = source, "modelled", f"modelled − {source}"
    every = [max(1, -(-len(own) // MOST_PLACES)) for own in places]

    def thin(parts: Sequence[ArrayLike]) -> Array:
        return np.concatenate(
            [np.asarray(part, dtype=float)[::k] for part, k in zip(parts, every, strict=True)]
        )

    panels = [
        Panel(f"{title}, {what}", unit, pack(thin(values)), shades, number)
        for number, (title, unit, *three) in enumerate(rows)
        for what, shades, values in zip(names, BESIDE, three, strict=True)
    ]
    counts = [len(own[::k]) for own, k in zip(places, every, strict=True)]
    if max(every) > 1:
        caption += f" Of the places one in {max(every)} is shown."
    return Maps(name, loads, slider, counts, pack(thin(places)), panels, *labels, caption, alt)


def frame_of(maps: Maps, values: Array, load: int) -> Array:
    """Return the part of values (all, ...) that belongs to a load."""
    first = sum(maps.counts[:load])
    return values[first : first + maps.counts[load]]


def row_ends(maps: Maps, panel: Panel, load: int) -> tuple[float, float]:
    """Return the ends of the colours, the same for maps of a row with the same shades."""
    row = [p for p in maps.panels if p.row == panel.row]
    shown = {id(p): frame_of(maps, p.values.values, load) for p in row}
    every = np.concatenate([shown[id(p)] for p in row if p.shades == panel.shades])
    low, high = ends_of(every, panel.shades)
    if panel.shades == "about zero":
        least = ROUNDING * max(float(np.nanmax(np.abs(own), initial=0.0)) for own in shown.values())
        low = min(low, -least)
        high = max(high, least)
    return low, high


def map_chart(maps: Maps, panel: Panel, load: int) -> Chart:
    """Return one map at one load as a chart of coloured dots, true to scale."""
    every = maps.places.values
    places = frame_of(maps, maps.places.values, load)
    low = every.min(axis=0)
    high = every.max(axis=0)
    around = 0.04 * float((high - low).max()) or 1.0
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
        x_range=(float(low[0]) - around, float(high[0]) + around),
        y_range=(float(low[1]) - around, float(high[1]) + around),
    )


def map_views(maps: Maps) -> list[dict[str, Any]]:
    """Return Vega's specifications of all maps at the last load."""
    last = len(maps.loads) - 1
    # About as wide as neighbours lie apart.
    size = float(np.clip(1.3 * SIDE**2 / max(maps.counts), 5.0, 160.0))
    return [view(map_chart(maps, panel, last), width=SIDE, dot_area=size) for panel in maps.panels]


def maps_data(maps: Maps) -> dict[str, Any]:
    """Return all values, packed, and the ends of the colours, for the page's script."""
    loads = range(len(maps.loads))
    ends = [[row_ends(maps, panel, load) for panel in maps.panels] for load in loads]
    return asdict(maps) | {"ends": ends}


def solid_data(solid: Solid) -> dict[str, Any]:
    """Return values and first view of a surface, for the page's script."""
    return asdict(solid) | {"colours": COLOURS, "turn": TURN, "raise": RAISE}


#: What a history is drawn of, with its unit and a factor, and the names of the components.
DRAWN = {"strain": ("log strain", "%", 100.0), "stress": ("stress", "MPa", 1.0)}
WAYS = ("along the warp", "along the fill", "in shear")
#: Height over width at rest up to which a mesh is a sheet, and not a tube.
FLAT = 0.2


def history(name: str, history: History, quantity: str, component: int, frame: int) -> Charts:
    """Return the deformed mesh coloured by its strain or stress: a tube from the side."""
    count = len(history.load)
    check_one_of(quantity, DRAWN, "quantity")
    check_one_of(component, range(len(WAYS)), "component")
    if not -count <= frame < count:
        raise InputError(None, "frame", f"expected {-count} to {count - 1}, got {frame}")
    what, unit, factor = DRAWN[quantity]
    every = history.strain() if quantity == "strain" else history.stress()
    values = factor * every[frame, :, component]
    rest = history.mesh.points
    now = rest + history.displacement[frame]
    size = np.ptp(rest, axis=0)
    labels, (least, up, across) = ["x, mm", "y, mm", "z, mm"], np.argsort(size, kind="stable")
    if size[2] > FLAT * size[across]:  # a tube, along its longest side
        flat = now[:, [across, up]]
        depth = now[:, least]
        axes = (labels[across], labels[up])
    elif np.ptp(now[:, 2]) > 0:  # a sheet that is inflated
        (flat, depth), axes = seen(now, TURN, RAISE), SEEN
    else:
        flat = now[:, :2]
        depth = now[:, 2]
        axes = (labels[0], labels[1])
    body = painted(flat, depth, history.mesh.quads, values)
    said = f"{what} {WAYS[component]}, {unit}"
    chart = Chart(
        name, *axes, [body], f"{name}: {said}", equal=True, scale=said, shades=shades_of(values)
    )
    return Charts(name, [chart], f"{name}: {said}, frame {frame % count + 1} of {count}")


#: From where it is seen at first, degrees: turned about z, and raised over the horizon.
TURN, RAISE = 35.0, 28.0
SEEN = "seen from above and aside, mm", "mm"


def painted(flat: Array, depth: Array, quads: NDArray[np.intp], values: Array) -> Series:
    """Return quads of points (n, 2), coloured by values (m,), the nearest (n,) drawn last."""
    order = np.argsort(depth[quads].mean(axis=1))
    return faces("", flat[quads[order]], values[order])


def solid_view(solid: Solid) -> dict[str, Any]:
    """Return Vega's specification of the surface at the last load, in the first of its shades."""
    own = solid.shades[0]
    quads = np.rint(solid.faces.values).astype(int)
    values = own.values.values
    arrow = solid.warp
    drawn = [painted(*seen(solid.points.values[-1], TURN, RAISE), quads, values[-1])]
    if arrow is not None:
        drawn.append(line("warp", *seen(arrow.values, TURN, RAISE)[0].T, colour=1))
    chart = Chart(
        "",
        *SEEN,
        drawn,
        solid.alt or solid.caption,
        equal=True,
        scale=f"{own.name}, {own.unit}",
        shades=own.shades,
        ends=ends_of(values, own.shades),
    )
    return view(chart, WIDE)


def seen(points: Array, turn: float, height: float) -> tuple[Array, Array]:
    """Return right and up (n, 2), and nearness (n,), of points (n, 3) mm."""
    a = np.radians(turn)
    b = np.radians(height)
    right = points @ (np.cos(a), np.sin(a), 0.0)
    away = points @ (-np.sin(a), np.cos(a), 0.0)
    up = points[:, 2] * np.cos(b) + away * np.sin(b)
    near = points[:, 2] * np.sin(b) - away * np.cos(b)
    return np.column_stack([right, up]), near


def write_vtu(
    mesh: Mesh,
    displacement: ArrayLike,
    path: Path | str,
    point_data: Mapping[str, ArrayLike] | None = None,
    cell_data: Mapping[str, ArrayLike] | None = None,
) -> Path:
    """Write the deformed mesh as a VTK unstructured grid.
    displacement : (n, 3) mm; also written as point data, so the mesh at rest is `displacement`
    subtracted (ParaView: Warp By Vector, scale -1). point_data, cell_data : (n, ...), (m, ...).
    Raises OutputError, and ValueError for a field that does not have one row a node."""
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
