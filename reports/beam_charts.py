"""Drawings of a bent inflated beam: from the side, close to its collar, and cut at mid-span."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solvers.base import Array
from .charts import Chart, Charts, Series, faces, line, shades_of

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
