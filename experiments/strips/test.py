"""A test of strips: what its section says, and its models."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...materials.card import State
from ...meshes.strip_models import (
    GRIP_DISTANCE,
    WIDTH,
    UniaxialModel,
    bias_strip,
    refined_quads,
    straight_strip,
)
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.sections import whole_in_base_units
from ..base import Reach, Refined, SectionTest
from ..sections import Place
from ..states import state_from_conditioning
from .data import Strip
from .reading import read_strips
from .section import Match, StripsSection, Unit

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class StripsTest(SectionTest):
    """Cut strips pulled along warp, fill and across the yarns.

    Attributes
    ----------
    width, grip_distance : float, mm
    bias_angle : float, degrees
        From the pull to the warp of strips across the yarns.
    increments : int
    strips : mapping
        By direction.
    match_by : {"polynomial", "points"}
    weights : mapping
        By direction.
    objective : {"N", "relative"}
    specimens : int or None
        Of each direction; None where unknown.
    rate : float, mm a minute, or None
        Between the grips.
    conditioning : str or None
        In words.
    noise : float, N, or None
        Of one load.
    """

    width: float
    grip_distance: float
    bias_angle: float
    increments: int
    strips: Mapping[str, Strip]
    match_by: Match
    weights: Mapping[str, float]
    objective: Unit
    specimens: int | None = None
    rate: float | None = None
    conditioning: str | None = None
    kind: str = "strips"
    reads_files = True

    @property
    def state(self) -> State:
        """Return "first loading" or "conditioned", as the key `conditioning` says; else ""."""
        return state_from_conditioning(self.conditioning)

    @property
    def pace(self) -> Pace:
        """Return rate of strain and hold by the files' times, else the rate by its key."""
        measured = pace_of(
            LoadHistory(Path(), curve.load, curve.elongation / strip.gauge_length, curve.time)
            for strip in self.strips.values()
            for curve in strip.curves
        )
        if math.isfinite(measured.rate):
            return measured
        return Pace() if self.rate is None else Pace(self.rate / 60.0 / self.grip_distance)

    @cached_property
    def reach(self) -> Reach:
        """Return the reach of the gauges, see `reach_of`."""
        return reach_of(self)

    @property
    def matched(self) -> dict[str, Strip]:
        """Return the strips of a weight above 0, by direction."""
        return {d: strip for d, strip in self.strips.items() if self.weights[d] > 0}

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """Return the models by direction; edges of quads, or increments, divided by a factor."""
        quads, steps = (factor, 1.0) if refined == "elements" else (1.0, factor)
        increments = max(1, round(self.increments * steps))
        models = {}
        for d, s in self.strips.items():
            lengths = s.gauge_length, s.final_length, self.thick(thickness), self.width
            if d == "bias":
                across = refined_quads("bias", quads)
                grips = self.grip_distance, self.bias_angle
                models[d] = bias_strip(*lengths, *grips, increments, **across)
            else:
                along = refined_quads("straight", quads)
                yarn: Literal["warp", "fill"] = "warp" if d == "warp" else "fill"
                models[d] = straight_strip(yarn, *lengths, increments, **along)
        return models

    def settings(self) -> Mapping[str, object]:
        return {
            "width": self.width,
            "grip_distance": self.grip_distance,
            "bias_angle": self.bias_angle,
            "increments": self.increments,
            "match_by": self.match_by,
            "objective": self.objective,
            "weight": self.weight,
            "weights": dict(self.weights),
            "lengths": {d: (s.gauge_length, s.final_length) for d, s in self.strips.items()},
        }


def read(section: StripsSection, place: Place, name: str) -> StripsTest:
    """Read the section of a test, and its load curves.

    Raises
    ------
    InputError
        Names the file and the dotted key.
    """
    section = whole_in_base_units(section, place.scales)
    grip_distance = section.grip_distance or GRIP_DISTANCE
    width = section.width or WIDTH
    strips = read_strips(place, section, width)
    weights = section.weights.model_dump()
    if not sum(weights[direction] for direction in strips) > 0:
        raise place.error("weights", "expected one above 0: nothing would be matched")
    if "bias" in strips and strips["bias"].gauge_length > grip_distance:
        problem = f"expected at most the distance of the grips, {grip_distance:g} mm"
        raise place.error("bias.gauge_length", problem)
    if section.match == "points":
        _check_points(strips, place)
    return StripsTest(
        name=name,
        place=place,
        weight=section.weight,
        noise=section.noise,
        width=width,
        grip_distance=grip_distance,
        bias_angle=section.bias_angle,
        increments=section.increments,
        strips=strips,
        match_by=section.match,
        weights=weights,
        objective=section.objective,
        specimens=section.data.specimens,
        rate=section.rate,
        conditioning=section.conditioning,
    )


def _check_points(strips: Mapping[str, Strip], place: Place) -> None:
    """Refuse strips without measured points where these are to be matched."""
    if place.need_data and not all(strip.curves for strip in strips.values()):
        problem = "'points' needs measured points (data.files), not polynomials"
        raise place.error("match", problem)
    for direction, strip in strips.items():
        if strip.curves and not len(strip.points[0]):
            problem = "no measured point lies between the gauge length and this one"
            raise place.error(f"{direction}.final_length", problem)


def reach_of(test: StripsTest, masks: Mapping[str, Mask | None] | None = None) -> Reach:
    """Return the final strains of the strips, and the breaks of their load curves.

    Shear of a strip that keeps its area is 2 sin(2 angle) ln(l_f/l_i). Breaks are shares of the
    strain of the gauge.

    Parameters
    ----------
    test : StripsTest
    masks : mapping or None
        Which points a curve follows, by direction; all unless given.
    """
    ends: dict[str, float] = {}
    breaks: dict[str, tuple[float, float] | None] = {}
    shear_per_strain = 2 * math.sin(math.radians(2 * test.bias_angle))
    for direction, strip in test.strips.items():
        mask = None if masks is None else masks.get(direction)
        if mask is not None and not mask.any():
            continue
        factor = shear_per_strain if direction == "bias" else 1.0
        ends[direction] = factor * strip.strain_by(mask)
        breaks[direction] = strip.break_shares(mask)
    return Reach(
        (ends.get("warp"), ends.get("fill"), ends.get("bias")),
        (breaks.get("warp"), breaks.get("fill"), breaks.get("bias")),
    )
