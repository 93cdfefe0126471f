"""A reference picture under pressure, as an alternative to the sheet at rest of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...meshes.bubble_model import SLACK
from ...notes import NoteKind, Objection
from ..base import Alternative
from .frame_doubts import REFERENCE
from .sheet import FLAT
from .test import BubbleTest

LOADED_REFERENCE = NoteKind(
    "loaded reference",
    weight=20,
    objection=Objection(
        "a reference picture under pressure explains the data better",
        "let displacements count from the reference picture: give it as a frame of its pressure "
        "with displacements of zero, and from_pressure in [bubble.sheet]",
        unusable=True,
    ),
)
#: Slack below which a sheet may have been under pressure, %: half of its prior's usual deviation.
SMALLEST_SLACK = -0.15


def loaded_alternative(prepared: Any, nuisance: Mapping[str, float]) -> Alternative | None:
    """Return a loaded reference picture as an alternative, where the fitted sheet makes it likely.

    That is a sheet shorter than flat, or one that stands as a dome in the sense of its rise.

    Parameters
    ----------
    prepared : PreparedBubble
        The bubble as it was fitted.
    nuisance : mapping of str to float
        Values of its nuisance parameters by name.
    """
    test = prepared.test
    if prepared.known is not None or not _can_be_loaded(test):
        return None
    dome = nuisance.get("z0_1", 0.0)
    if prepared.sheet.surface is not None:
        dome += _height(prepared)
    is_short = min(nuisance.get(name, 0.0) for name in SLACK) <= SMALLEST_SLACK
    if not is_short and dome <= REFERENCE.dome * test.outline.radius:
        return None
    # The height of a sheet that is flat at rest grows with the cube root of the pressure.
    slope, zero = np.polyfit(np.cbrt(test.pressures), prepared.view.rises, 1)
    pressure = max(-float(zero / slope), 0.0) ** 3
    lowest = 1e3 * test.pressures[0]
    return Alternative(
        "a reference picture under {:.3g} kPa",
        "the sheet at rest as it was fitted",
        min(max(1e3 * pressure, 1e-2 * lowest), 0.5 * lowest),
        0.9 * lowest,
        partial(with_loaded_reference, prepared),
        LOADED_REFERENCE,
    )


def _can_be_loaded(test: BubbleTest) -> bool:
    """Return whether the displacements of a test may be counted from a loaded reference picture."""
    is_counted = test.sheet.reference_frame is not None or test.displacement_offset
    has_rising_points = test.match_by == "points" and test.rising == len(test.pressures) > 1
    return has_rising_points and not is_counted and not test.sheet.moving_rim


def _height(prepared: Any) -> float:
    """Return the height (mm) of the centre of the measured surface above its rim."""
    model = prepared.model
    heights = model.mesh.points[:, 2]
    return float(heights[model.mesh.node_sets["apex"][0]])


def with_loaded_reference(prepared: Any, pressure: float) -> Any:
    """Return a bubble whose reference picture was taken under a pressure (kPa), flat at rest."""
    test = prepared.test
    reference = max(prepared.fields, key=lambda field: len(field.points))
    reference = replace(
        reference,
        pressure=1e-3 * pressure,
        displacement=np.zeros_like(reference.displacement),
    )
    sheet = replace(
        test.sheet,
        slack=False,
        measured=False,
        constant=(),
        reference_frame=0,
    )
    loaded = replace(
        test,
        pressures=(reference.pressure, *test.pressures),
        increments=tuple(sorted({reference.pressure, *test.increments})),
        sheet=sheet,
    )
    return replace(prepared, test=loaded, fields=(reference, *prepared.fields), sheet=FLAT)
