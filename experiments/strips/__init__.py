"""Uniaxial tests of cut strips along warp, fill and the bias: load over a gauge's elongation."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...lazy_modules import LazyFunction
from ...materials.card import State
from ...meshes.strip_models import (
    GRIP_DISTANCE,
    WIDTH,
    UniaxialModel,
    bias_strip,
    refined_quads,
    straight_strip,
)
from ...readers.curves import DIRECTION_OF_ANGLE, DIRECTIONS, cut_of
from ...readers.histories import LoadHistory, Pace, pace_of
from ...readers.sections import whole_in_base_units
from ...solvers.base import History
from ..base import Reach, Refined, SectionTest
from ..forward import Studied
from ..measured import MeasuredKind
from ..sections import Place
from ..states import state_from_conditioning
from .data import Strip
from .reading import ErrorUnit, Match, StripsSection, read_strips

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False, kw_only=True)
class StripsTest(SectionTest):
    """A test of cut strips pulled along warp, fill and the bias, with its data.

    Attributes
    ----------
    width, grip_distance : float, mm
        Width of each strip, and free length between the grips.
    bias_angle : float, degrees
        Angle from the pull to the warp of bias strips.
    increments : int
        Number of increments of a model.
    strips : mapping of str to Strip
        Data by direction.
    match_by : {"polynomial", "points"}
        Whether a fit matches the polynomials or the measured points.
    weights : mapping of str to float
        Weight of each direction's error in the objective.
    objective : {"N", "relative"}
        Whether errors count in N or relative to the largest load.
    specimen_count : int or None
        Number of specimens of each direction, where it is given.
    rate : float, mm/min, or None
        Speed of the grips.
    conditioning : str or None
        What was done with the specimens before the test, in words.
    side_by_side : int
        Number of strips that are pulled together and share the load.
    noise : float, N, or None
        Standard deviation of one load, where it is given.
    compliance : float, mm/N
        What machine and grips give, which is off the elongations already.
    compliance_prior : float, mm/N, or None
        Its standard deviation, with which it is an unknown of a fit.
    """

    setting_names: ClassVar[tuple[str, ...]] = (
        "width",
        "side_by_side",
        "grip_distance",
        "bias_angle",
        "increments",
        "match_by",
        "objective",
        "weight",
        "noise",
    )

    width: float
    grip_distance: float
    bias_angle: float
    increments: int
    strips: Mapping[str, Strip]
    match_by: Match
    weights: Mapping[str, float]
    objective: ErrorUnit
    specimen_count: int | None = None
    rate: float | None = None
    conditioning: str | None = None
    side_by_side: int = 1
    compliance: float = 0.0
    compliance_prior: float | None = None
    kind: str = "strips"
    reads_files = True

    @property
    def state(self) -> State:
        """Return "first loading" or "conditioned", as the key `conditioning` says; else ""."""
        return state_from_conditioning(self.conditioning)

    @property
    def pace(self) -> Pace:
        """Return the pace by the times in the files, or else from the key `rate`."""
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
        """Return the final strains of the gauges, see `reach_of`."""
        return reach_of(self)

    @property
    def total_width(self) -> float:
        """Return the width (mm) of all strips that share the load."""
        return self.width * self.side_by_side

    def angle(self, direction: str) -> float:
        """Return the angle (degrees) from the pull to the warp of strips cut at an angle."""
        return self.bias_angle if direction == "bias" else float(direction.split()[0])

    @property
    def matched(self) -> dict[str, Strip]:
        """Return the strips with a weight above 0, by direction."""
        return {d: strip for d, strip in self.strips.items() if self.weights[d] > 0}

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """Return the finite element model of each direction, refined if wanted.

        Parameters
        ----------
        thickness : float, optional
            Thickness of the fabric, mm; the project's unless given.
        refined : {"elements", "increments"}
            What is refined.
        factor : float
            Number by which edges of quads, or increments, are divided.
        """
        edges, steps = (factor, 1.0) if refined == "elements" else (1.0, factor)
        increments = max(1, round(self.increments * steps))
        models = {}
        for direction, strip in self.strips.items():
            lengths = strip.gauge_length, strip.final_length, self.thick(thickness), self.width
            if cut_of(direction) == "bias":
                quads = refined_quads("bias", edges)
                angle = self.angle(direction)
                model = bias_strip(*lengths, self.grip_distance, angle, increments, **quads)
            else:
                quads = refined_quads("straight", edges)
                model = straight_strip(direction, *lengths, increments, **quads)
            load_factor = self.side_by_side * model.load_factor
            models[direction] = replace(model, load_factor=load_factor)
        return models

    def settings(self) -> Mapping[str, object]:
        lengths = {d: (s.gauge_length, s.final_length) for d, s in self.strips.items()}
        settings = {**super().settings(), "weights": dict(self.weights), "lengths": lengths}
        if self.compliance_prior is not None:
            settings["compliance_prior"] = self.compliance_prior
        return settings


def read(section: StripsSection, place: Place, name: str) -> StripsTest:
    """Read a strip test from its section and its load curves.

    Parameters
    ----------
    section : StripsSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        Data or lengths are missing or wrong; the message names the file and the dotted key.
    """
    section = whole_in_base_units(section, place.scales)
    grip_distance = section.grip_distance or GRIP_DISTANCE
    width = section.width or WIDTH
    strips = read_strips(place, section, width * section.side_by_side)
    by_cut = section.weights.model_dump()
    weights = {direction: by_cut[cut_of(direction)] for direction in (*DIRECTIONS, *strips)}
    if not sum(weights[direction] for direction in strips) > 0:
        raise place.error("weights", "expected one above 0: nothing would be matched")
    if any(cut_of(d) == "bias" and s.gauge_length > grip_distance for d, s in strips.items()):
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
        specimen_count=section.data.specimens,
        rate=section.rate,
        conditioning=section.conditioning,
        side_by_side=section.side_by_side,
        compliance=section.compliance,
        compliance_prior=section.compliance_prior,
    )


def _check_points(strips: Mapping[str, Strip], place: Place) -> None:
    """Raise InputError for strips without measured points that are to be matched."""
    if place.need_data and not all(strip.curves for strip in strips.values()):
        problem = "'points' needs measured points (data.files), not polynomials"
        raise place.error("match", problem)
    for direction, strip in strips.items():
        if strip.curves and not len(strip.points[0]):
            problem = "no measured point lies between the gauge length and this one"
            raise place.error(f"{cut_of(direction)}.final_length", problem)


def reach_of(test: StripsTest, masks: Mapping[str, Mask | None] | None = None) -> Reach:
    """Return the final strains of the strips, and the breaks of their load curves.

    A bias strip keeps its area: its shear is 2 sin(2 a) ln(l_f/l_i), with a the angle from the pull
    to the warp, and l_i and l_f the gauge length at rest and at the end. Breaks between the regions
    of a curve are shares of the gauge's final strain. Of several angles the largest shear counts.

    Parameters
    ----------
    test : StripsTest
    masks : mapping or None
        Masks of the points that are kept, by direction; all points unless given.
    """
    ends: dict[str, float] = {}
    breaks: dict[str, tuple[float, float] | None] = {}
    for direction, strip in test.strips.items():
        mask = None if masks is None else masks.get(direction)
        if mask is not None and not mask.any():
            continue
        cut = cut_of(direction)
        factor = 1.0
        if cut == "bias":
            angle = test.angle(direction)
            cut = DIRECTION_OF_ANGLE.get(angle, cut)
            factor = 2 * math.sin(math.radians(2 * angle)) if cut == "bias" else 1.0
        strain = factor * strip.end_strain(mask)
        if strain > ends.get(cut, -math.inf):
            ends[cut] = strain
            breaks[cut] = strip.break_shares(mask)
    return Reach(
        (ends.get("warp"), ends.get("fill"), ends.get("bias")),
        (breaks.get("warp"), breaks.get("fill"), breaks.get("bias")),
    )


def end_load(model: UniaxialModel, history: History) -> dict[str, float]:
    """Return the load (N) at the end of a strip's history, by the name that studies give it."""
    return {"load at the end, N": float(history.load[-1])}


class StripsKind(MeasuredKind):
    """Cut strips pulled along warp, fill and across the yarns."""

    name = "strips"
    title = "cut strips pulled along warp, fill and 45 degrees"
    section = StripsSection
    folder_key = "data.folder"
    prepared = LazyFunction(f"{__name__}.prepared", "PreparedStrips")
    doubts = (
        "elongation-unit",
        "load-unit",
        "preload",
        "after-failure",
        "swapped",
        "grip-travel",
        "gauge-still",
        "load-limit",
        "slack-strip",
        "force-unit",
        "repeated-specimen",
        "odd-specimen",
    )
    read = staticmethod(read)
    candidates = LazyFunction(f"{__name__}.prepared", "candidates")
    studied = Studied(
        steps=lambda model: model.elongations,
        quantities=end_load,
        responses=end_load,
        response="load",
        curve=lambda model, history: (np.array(model.elongations), history.load),
    )


KIND = StripsKind()
