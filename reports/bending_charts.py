"""Charts of inflated cylinders in bending: load over deflection, pressure of the gas, bent beams.

A beam is seen from the side, close to its collar, and cut at mid-span.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..experiments.cylinder.measures import CurvePoint
from ..readers.bending import BendingCurve, BendingScatter
from ..solvers.base import Array
from .charts import Chart, Charts, Series, band, dots, faces, line, shades_of

MM3_PER_LITRE = 1e6
COLLAR_DEFLECTION = "deflection of the collar, mm"
#: Index in the palette of the colour of measured values.
MEASURED_COLOUR = 7


@dataclass(frozen=True, eq=False)
class BendLine:
    """Modelled curve of load over deflection with one material card.

    Parameters
    ----------
    name : str
        Name of the card.
    rank : int
        Number of the card, from 0, which gives its colour in every figure.
    deflection, load, pressure, volume : (frames,) arrays
        Deflection, mm, load, N, gauge pressure, MPa, and volume of the gas, mm^3.
    knee, limit : CurvePoint, optional
        Deflection and load at the knee and at the limit point of the curve.
    rms : float, optional
        RMS error of the load against what was measured, N.
    other_limit : (deflection, load), optional
        Curve at the other end of a band of possible loads, of which this curve is one end, mm and
        N.
    half_band : (frames,) array, optional
        Half the width of a band about the load, by the uncertainty of the card, N.
    """

    name: str
    rank: int
    deflection: Array
    load: Array
    pressure: Array | None = None
    volume: Array | None = None
    knee: CurvePoint | None = None
    limit: CurvePoint | None = None
    rms: float | None = None
    other_limit: tuple[ArrayLike, ArrayLike] | None = None
    half_band: Array | None = None

    @property
    def colour(self) -> int:
        """Return the index of the curve's colour in the palette."""
        return 1 + self.rank % 6


@dataclass(frozen=True, eq=False)
class BendPanel:
    """Content of the chart of one test: curves of the cards, and measured repetitions.

    Parameters
    ----------
    title : str
        Title of the chart.
    lines : sequence of BendLine
        One modelled curve for each card.
    readings : sequence of BendingCurve
        Measured curves, one for each repetition.
    measured : BendingScatter, optional
        Mean and standard deviation of the repetitions.
    spread : str
        Name in the legend of the bands `BendLine.half_band`, "" for none.
    along : str
        Label of the axis of deflections.
    """

    title: str
    lines: Sequence[BendLine] = ()
    readings: Sequence[BendingCurve] = ()
    measured: BendingScatter | None = None
    spread: str = ""
    along: str = COLLAR_DEFLECTION


def bending_charts(
    panels: Sequence[BendPanel], caption: str = "", columns: int = 0, misses: bool = False
) -> Charts:
    """Return charts of load over deflection, one for each test.

    Parameters
    ----------
    panels : sequence of BendPanel
        Content of each chart.
    caption : str
        Caption of the figure.
    columns : int
        Number of charts in a row. From 2 on, all charts share the axis of deflections, those of a
        row the axis of loads, and charts without curves keep their place. 0 for as many as fit.
    misses : bool
        Whether charts of the difference of model and measurement follow.
    """
    drawn_panels = [panel for panel in panels if panel.lines or columns > 1]
    charts = [_load_chart(panel) for panel in drawn_panels]
    if columns > 1:
        rows = [charts[k : k + columns] for k in range(0, len(charts), columns)]
        x_range = _common_range(charts, "x")
        charts = [
            replace(chart, x_range=x_range, y_range=_common_range(row, "y"))
            for row in rows
            for chart in row
        ]
    if misses:
        charts += [_miss_chart(panel) for panel in drawn_panels if panel.measured is not None]
    return Charts("loads", charts, caption, columns)


def _common_range(charts: Sequence[Chart], axis: str) -> tuple[float, float]:
    """Return the range from zero of an axis, "x" or "y", that holds the data of all charts."""
    fields = ("x",) if axis == "x" else ("y", "upper")
    values = [
        value
        for chart in charts
        for series in chart.series
        for field in fields
        for value in getattr(series, field)
        if value is not None
    ]
    return 0.0, 1.06 * max(values, default=0.0) or 1.0


def _load_chart(panel: BendPanel) -> Chart:
    """Return a chart of load over deflection of one test."""
    series = _measured_series(panel)
    for curve in panel.lines:
        series += _line_series(curve)
    if panel.spread and any(curve.half_band is not None for curve in panel.lines):
        series.append(band(panel.spread, (), (), (), colour=panel.lines[0].colour))
    errors = [(curve.name, curve.rms) for curve in panel.lines if curve.rms is not None]
    highest = max((curve.load.max() for curve in panel.lines), default=0.0)
    alt = f"{panel.title}: load over deflection, up to {highest:.4g} N"
    alt += "".join(f"; {name}: RMS error {rms:.3g} N" for name, rms in errors)
    title = panel.title
    if len(errors) == 1:
        title += f": RMS error {errors[0][1]:.3g} N"
    return Chart(title, panel.along, "load, N", series, alt, from_zero=True)


def _measured_series(panel: BendPanel) -> list[Series]:
    """Return scatter, mean and single readings of the repetitions; nothing if none are measured."""
    measured = panel.measured
    if measured is None:
        return []
    low = measured.mean - measured.deviation
    high = measured.mean + measured.deviation
    deflection = measured.deflection
    colour = MEASURED_COLOUR
    return [
        band("scatter of repetitions (±)", deflection, low, high, colour=colour),
        line("mean", deflection, measured.mean, colour=colour, wide=True),
        *(dots("measured", c.deflection, c.load, colour=colour) for c in panel.readings),
    ]


def _line_series(curve: BendLine) -> list[Series]:
    """Return a modelled curve, its band, the other end of the possible loads, knee and limit."""
    colour = curve.colour
    half_band = curve.half_band
    limits = None if half_band is None else (curve.load - half_band, curve.load + half_band)
    series = [line(curve.name, curve.deflection, curve.load, limits, colour=colour)]
    if curve.other_limit is not None:
        series.append(line(f"{curve.name}, other end", *curve.other_limit, colour=colour, dashes=1))
    marks_drawn = (("knee", curve.knee, "diamond"), ("limit point", curve.limit, "triangle-up"))
    for name, point, shape in marks_drawn:
        if point is not None:
            x = [point[0]]
            y = [point[1]]
            series.append(dots(name, x, y, colour=colour, shape=shape, hollow=True))
    return series


def _miss_chart(panel: BendPanel) -> Chart:
    """Return a chart of modelled load minus the mean of the readings over deflection."""
    measured = panel.measured
    assert measured is not None
    deflection = measured.deflection
    spread = measured.deviation
    series = [
        band("scatter of repetitions (±)", deflection, -spread, spread, colour=MEASURED_COLOUR)
    ]
    for curve in panel.lines:
        load = np.interp(deflection, curve.deflection, curve.load, left=np.nan, right=np.nan)
        series.append(line(curve.name, deflection, load - measured.mean, colour=curve.colour))
    errors = [f"{curve.name} {curve.rms:.3g} N" for curve in panel.lines if curve.rms is not None]
    title = f"RMS error: {', '.join(errors)}" if errors else ""
    alt = f"{panel.title}: model less mean of the readings"
    return Chart(title, panel.along, "model − mean, N", series, alt, level=0.0)


def gas_charts(panel: BendPanel) -> Charts:
    """Return charts of the gauge pressure over the change of volume and over the deflection."""
    by_volume = []
    by_deflection = []
    for curve in panel.lines:
        assert curve.pressure is not None and curve.volume is not None
        pressure = 1e3 * curve.pressure
        volume = curve.volume / MM3_PER_LITRE
        name = f"{curve.name}, from {volume[0]:.4g} litres"
        by_volume.append(line(name, volume - volume[0], pressure, colour=curve.colour))
        by_deflection.append(line(name, curve.deflection, pressure, colour=curve.colour))
    x_label = "volume less that when inflated, litres"
    y_label = "gauge pressure, kPa"
    over_volume, over_deflection = (
        f"{panel.title}: pressure over {name}" for name in ("volume", "deflection")
    )
    charts = [
        Chart(panel.title, x_label, y_label, by_volume, over_volume),
        Chart("", panel.along, y_label, by_deflection, over_deflection),
    ]
    return Charts("gas", charts, "")


#: Thickness, mm, with which the collar is drawn; in the model it has none.
COLLAR_WALL = 12.0
#: Extent of the close view to either side of the collar's middle, over the collar's length.
CLOSE_VIEW = 2.2


@dataclass(frozen=True)
class BeamBodies:
    """Rigid bodies that bend a beam, where they are when it is bent.

    z is along the axis of the beam, with zero at mid-span, and y is upwards.

    Parameters
    ----------
    supports : tuple of (z, y)
        Positions of the axes of the supports, mm.
    support_radius, collar_radius, collar_length : float
        Dimensions of the cylindrical supports and of the collar, mm.
    collar_height : float
        y of the collar's axis, mm.
    collars : tuple of float
        z of the middle of each collar, or strap, mm.
    """

    supports: tuple[tuple[float, float], ...]
    support_radius: float
    collar_height: float
    collar_radius: float
    collar_length: float
    collars: tuple[float, ...] = (0.0,)

    @property
    def name(self) -> str:
        """Return the name of the body that loads the beam: "collar" at mid-span, else "strap"."""
        return "collar" if self.collars == (0.0,) else "strap"


def beam_charts(
    positions: Array,
    cells: NDArray[np.intp],
    strain: Array,
    outline: Array,
    section: tuple[Array, Array],
    bodies: BeamBodies,
    title: str = "",
) -> Charts:
    """Return drawings of a bent beam, true to scale and coloured by its strain along the axis.

    The three charts show the beam from the side, the same close to its collar, and its section at
    mid-span.

    Parameters
    ----------
    positions : (n, 3) array
        Positions of the nodes of the whole bent beam, mm; z along the axis, y upwards.
    cells : (m, 4) array of int
        Indices of the nodes of each quad.
    strain : (m,) array
        Logarithmic strain along the axis of each quad when the beam is bent.
    outline : (k, 2) array
        Outline of the inflated beam from the side as a closed line (z, y), mm.
    section : two (k, 2) arrays
        Section at mid-span as a closed line (x, y), inflated and then bent, mm.
    bodies : BeamBodies
        Supports and collar when the beam is bent.
    title : str
        Title of the first chart.
    """
    # The negative strains of wrinkles are many times the largest strain of the fabric: colours
    # end at minus the largest strain, so that all wrinkles look the same.
    largest = max(strain.max(), 1e-6)
    values = 100 * np.clip(strain, -largest, largest)
    # From the side one half of the beam is seen, x >= 0; the nearest quads are drawn last.
    visible = np.flatnonzero(positions[cells, 0].mean(axis=1) >= 0)
    visible = visible[np.argsort(positions[cells[visible], 0].mean(axis=1))]
    side = [
        faces(positions[cells[visible]][:, :, [2, 1]], values[visible]),
        line("inflated", *outline.T, colour=7, dashes=1),
        *_body_lines(bodies),
    ]
    ring = bodies.collar_radius + COLLAR_WALL
    middle = bodies.collar_height
    feet = [y - bodies.support_radius for _, y in bodies.supports]
    low = min(positions[:, 1].min(), middle - ring, *feet)
    high = max(positions[:, 1].max(), outline[:, 1].max(), middle + ring)
    end = np.abs(positions[:, 2]).max()
    scale: dict[str, Any] = {
        "equal": True,
        "scale": "log strain along the axis, %",
        "shades": shades_of(values),
    }
    side_view = Chart(
        title,
        "z, mm",
        "y, mm",
        side,
        f"{title}: the bent beam from the side",
        x_range=(-1.03 * end, 1.03 * end),
        y_range=(low - 20, high + 20),
        **scale,
    )
    position = bodies.collars[-1]
    reach = CLOSE_VIEW * bodies.collar_length
    half_height = bodies.collar_radius + 4 * COLLAR_WALL
    close_view = Chart(
        f"at the {bodies.name}",
        "z, mm",
        "y, mm",
        side,
        f"the bent beam at the {bodies.name}",
        x_range=(position - reach, position + reach),
        y_range=(middle - half_height, middle + half_height),
        **scale,
    )
    return Charts("beam", [side_view, close_view, _cut_chart(section, bodies)], "", columns=1)


def _body_lines(bodies: BeamBodies) -> list[Series]:
    """Return the outlines of supports and collars from the side."""
    series = [
        line("support", *_circle(z, y, bodies.support_radius), colour=3) for z, y in bodies.supports
    ]
    half = 0.5 * bodies.collar_length
    radius = bodies.collar_radius
    for z in bodies.collars:
        for y in (bodies.collar_height - radius - COLLAR_WALL, bodies.collar_height + radius):
            x = [z - half, z + half, z + half, z - half, z - half]
            top = y + COLLAR_WALL
            series.append(line(bodies.name, x, [y, y, top, top, y], colour=0))
    return series


def _circle(x: float, y: float, radius: float) -> tuple[Array, Array]:
    """Return x and y (73,) of points on a circle."""
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    return x + radius * np.cos(angle), y + radius * np.sin(angle)


def _cut_chart(section: tuple[Array, Array], bodies: BeamBodies) -> Chart:
    """Return a chart of the section at mid-span, inflated and bent, with the collar about it."""
    inflated, bent = section
    circle = _circle(0.0, bodies.collar_height, bodies.collar_radius + 0.5 * COLLAR_WALL)
    series = [line("collar", *circle)] if 0.0 in bodies.collars else []
    series += [
        line("inflated", *inflated.T, colour=7, dashes=1),
        line("bent", *bent.T, colour=3),
    ]
    alt = "the beam cut at mid-span, inflated and bent"
    return Chart("cut at mid-span", "x, mm", "y, mm", series, alt, equal=True)
