"""Maps of a bubble test for the page: measured, modelled and what is left, pressure by pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...reports import Maps, maps_of
from ..fittable import FittedTest
from .charts import kilo, source
from .findings import objective_of

if TYPE_CHECKING:
    from .prepared import PreparedBubble

LABELS = ("x (warp), mm", "y (fill), mm")


def field_maps(prepared: PreparedBubble, fitted: FittedTest) -> Maps:
    """dx, dy and dz at every place that was matched."""
    objective = objective_of(fitted)
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    displacement = fitted.histories[0].displacement
    modelled = objective.modelled(displacement, fitted.nuisance)
    left = objective.differences(displacement, fitted.nuisance)
    targets, name = objective.targets, prepared.test.name
    rows = [
        (
            quantity,
            "mm",
            [np.asarray(target.displacement)[:, axis] for target in targets],
            [own[:, axis] for own in modelled],
            [own[:, axis] for own in left],
        )
        for axis, quantity in enumerate(("dx", "dy", "dz"))
    ]
    caption = (
        f"{name}: displacement of {source(prepared)}, of the model, and their difference. Colours "
        "end at the least and the largest value of the pressure shown."
    )
    if objective.constant:
        caption += " From the difference a field is taken out that is the same at all pressures."
    return maps_of(
        f"{name} maps", "pressure", [kilo(t.pressure) for t in targets],
        [target.at(nodes) for target in targets], rows, LABELS, caption,
        f"maps of dx, dy and dz of {name}",
    )  # fmt: skip
