"""Charts of a bubble test for the page: cuts along warp and fill, residual over height."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...reports import Chart, Charts, Series, dots, line
from ...reports.cuts import node_cut, point_cut
from ..fittable import FittedTest
from .findings import objective_of
from .objective import displacement_offset

if TYPE_CHECKING:
    from .prepared import PreparedBubble

Array = NDArray[np.float64]

#: Pressures that are drawn in one chart; of more, as many spread over all, the last among them.
MOST = 8
#: Points that are drawn of one pressure.
POINTS = 120
AXES = (("Cut along the warp", "x, mm"), ("Cut along the fill", "y, mm"))


def chosen(count: int) -> list[int]:
    """Numbers of the pressures that are drawn."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).round().astype(int)).tolist()


def profile_charts(prepared: PreparedBubble, fitted: FittedTest) -> Charts:
    """Heights along both axes: lines of the model, dots of what was measured."""
    pressures, offset = prepared.test.pressures, displacement_offset(fitted.nuisance)
    displacement = fitted.histories[0].displacement + offset
    points = fitted.comparisons[0].model.mesh.points
    numbers = chosen(len(pressures))
    charts = []
    for axis, (title, label) in enumerate(AXES):
        series: list[Series] = []
        for rank, k in zip(ranks(len(numbers)), numbers, strict=True):
            cut, name = node_cut(points, displacement[k], axis), kilo(pressures[k])
            series.append(line(name, cut.position, cut.height, rank=rank))
            seen = prepared.fields[k]
            spots = point_cut(seen.points, seen.displacement, axis)
            series.append(dots(name, spots.position, spots.height, rank=rank))
        alt = f"{title}: heights modelled and measured at {len(numbers)} pressures"
        charts.append(Chart(title, label, "height z, mm", series, alt))
    caption = f"{prepared.test.name}: lines are the model, dots {source(prepared)}"
    return Charts(f"{prepared.test.name} cuts", charts, f"{caption}.{left_out(pressures, numbers)}")


def residual_chart(prepared: PreparedBubble, fitted: FittedTest) -> Charts:
    """What is left of dx, dy and dz over the measured height."""
    objective = objective_of(fitted)
    left = objective.differences(fitted.histories[0].displacement, fitted.nuisance)
    targets = objective.targets
    numbers, charts = chosen(len(targets)), []
    for axis, name in enumerate(("dx", "dy", "dz")):
        series = []
        for rank, k in zip(ranks(len(numbers)), numbers, strict=True):
            every = slice(None, None, max(1, -(-len(left[k]) // POINTS)))
            height = np.asarray(targets[k].displacement)[every, 2]
            off = left[k][every, axis]
            series.append(dots(kilo(targets[k].pressure), height, off, rank=rank))
        rms = float(np.sqrt(np.mean(np.concatenate([own[:, axis] for own in left]) ** 2)))
        title = f"{name}: RMS {rms:.2g} mm"
        alt = f"modelled less measured {name} over the measured height, {rms:.2g} mm RMS"
        charts.append(
            Chart(title, "measured dz, mm", "modelled − measured, mm", series, alt, level=0.0)
        )
    pressures = [target.pressure for target in targets]
    caption = f"{prepared.test.name}: what is left, over the measured height."
    return Charts(f"{prepared.test.name} residual", charts, caption + left_out(pressures, numbers))


def ranks(count: int) -> list[float]:
    """Of rising pressures, for their colours."""
    return np.linspace(0.1, 1.0, count).tolist()


def kilo(pressure: float) -> str:
    """A pressure (MPa) in kPa."""
    return f"{1e3 * pressure:.4g} kPa"


def source(prepared: PreparedBubble) -> str:
    """What the model is compared with."""
    return "the known solution" if prepared.known is not None else "what was measured"


def left_out(pressures: Sequence[float], numbers: Sequence[int]) -> str:
    """That not every pressure is drawn."""
    if len(numbers) == len(pressures):
        return ""
    return f" Of {len(pressures)} pressures {len(numbers)} are drawn."
