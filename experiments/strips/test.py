"""A test of strips, as its section describes it, and its models."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...meshes.strip_models import (
    GRIP_DISTANCE,
    WIDTH,
    UniaxialModel,
    bias_strip,
    refined_quads,
    straight_strip,
)
from ..kinds import Place, Reach, Refined
from .data import Strip, read_strips
from .section import Match, StripsSection, Unit

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class StripsTest:
    """Cut strips pulled along warp, fill and across the yarns. Lengths mm, loads N, degrees.

    strips, weights : by direction. noise : N of one load. specimens : of each direction; None where
    unknown.
    """

    name: str
    place: Place
    weight: float
    width: float
    grip_distance: float
    bias_angle: float
    increments: int
    strips: Mapping[str, Strip]
    match_by: Match
    weights: Mapping[str, float]
    objective: Unit
    noise: float | None = None
    specimens: int | None = None
    kind: str = "strips"

    @property
    def thickness(self) -> float:
        """Return the thickness of the fabric, mm."""
        return self.place.fabric.thickness

    @property
    def reads_files(self) -> bool:
        """Return True: load curves are measured or published."""
        return True

    @cached_property
    def reach(self) -> Reach:
        """Return the reach of the gauges, see `reach_of`."""
        return reach_of(self)

    @property
    def matched(self) -> tuple[str, ...]:
        """Return the directions of a weight above 0."""
        return tuple(d for d in self.strips if self.weights[d] > 0)

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """Return the models by direction; edges of quads, or increments, divided by a factor."""
        quads = factor if what == "elements" else 1.0
        steps = factor if what == "increments" else 1.0
        thick = self.thickness if thickness is None else thickness
        increments = max(1, round(self.increments * steps))
        return {d: self._model(s, thick, quads, increments) for d, s in self.strips.items()}

    def _model(
        self, strip: Strip, thickness: float, refinement: float, increments: int
    ) -> UniaxialModel:
        lengths = strip.gauge_length, strip.final_length, thickness, self.width
        if strip.direction == "bias":
            quads = refined_quads("bias", refinement)
            return bias_strip(*lengths, self.grip_distance, self.bias_angle, increments, **quads)
        quads = refined_quads("straight", refinement)
        direction: Literal["warp", "fill"] = "warp" if strip.direction == "warp" else "fill"
        return straight_strip(direction, *lengths, increments, **quads)

    def settings(self) -> Mapping[str, object]:
        """Return everything but names and places of files."""
        names = ("width", "grip_distance", "bias_angle", "increments", "match_by", "objective",
                 "weight")  # fmt: skip
        said: dict[str, object] = {name: getattr(self, name) for name in names}
        lengths = {d: (s.gauge_length, s.final_length) for d, s in self.strips.items()}
        return {**said, "weights": dict(self.weights), "lengths": lengths}


def read(section: StripsSection, place: Place, name: str) -> StripsTest:
    """Read the section of a test, and its load curves."""
    length = place.scales.length
    grips = GRIP_DISTANCE if section.grip_distance is None else section.grip_distance * length
    strips = read_strips(place, section)
    weights = section.weights.model_dump()
    if not sum(weights[d] for d in strips) > 0:
        raise place.error("weights", "expected one above 0: nothing would be matched")
    if "bias" in strips and not strips["bias"].gauge_length < grips:
        problem = f"expected less than the distance of the grips, {grips:g} mm"
        raise place.error("bias.gauge_length", problem)
    if section.match == "points":
        if place.need_data and not all(s.curves for s in strips.values()):
            problem = "'points' needs measured points (data.files), not polynomials"
            raise place.error("match", problem)
        for direction, strip in strips.items():
            if strip.curves and not len(strip.points[0]):
                problem = "no measured point lies between the gauge length and this one"
                raise place.error(f"{direction}.final_length", problem)
    return StripsTest(
        name=name,
        place=place,
        weight=section.weight,
        width=WIDTH if section.width is None else section.width * length,
        grip_distance=grips,
        bias_angle=section.bias_angle,
        increments=section.increments,
        strips=strips,
        match_by=section.match,
        weights=weights,
        objective=section.objective,
        noise=section.noise,
        specimens=section.data.specimens,
    )


def reach_of(test: StripsTest, masks: Mapping[str, Mask | None] | None = None) -> Reach:
    """Return the final strains of the strips, and the breaks of their load curves.

    Shear of a strip that keeps its area is 2 sin(2 angle) ln(l_f/l_i). Breaks : shares of the
    strain of the gauge. masks : which points a curve follows, by direction.
    """
    known = {d: mask for d, mask in (masks or {}).items() if mask is not None}
    strips = {d: s for d, s in test.strips.items() if d not in known or known[d].any()}
    per_stretch = {"bias": 2 * math.sin(math.radians(2 * test.bias_angle))}
    ends, shares = {}, {}
    for direction, strip in strips.items():
        ends[direction] = per_stretch.get(direction, 1.0) * strip.strain_by(known.get(direction))
        shares[direction] = strip.break_shares(known.get(direction))
    return Reach(
        (ends.get("warp"), ends.get("fill"), ends.get("bias")),
        (shares.get("warp"), shares.get("fill"), shares.get("bias")),
    )
