"""A cylinder in bending, as its section describes it, and its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel

from ...errors import InputError
from ...files import is_file
from ...meshes.cylinder_model import (
    DEFLECTION,
    FRAMES,
    LENGTH,
    SEAM_WIDTH,
    Collar,
    CurveReading,
    CylinderModel,
    Gas,
    RigidSupports,
    curve_reading,
    inflated_cylinder,
    usual_collar,
)
from ...readers.bending import BendingCurve, read_bending_curves
from ...readers.frames import FrameSource
from ..keys import channel_of, named_format
from ..kinds import DataFile, Place, Reach, Refined, joined
from .section import CylinderSection, MeasuredSection


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Read every repetition in the files of a section; none where it lists none."""
    names = section.files or []
    folder = place.data_folder
    if folder is None:
        folder = place.path.parent / section.folder
    format = named_format(place, "measured.format", "machine table", section.format)
    curves: list[BendingCurve] = []
    for k, name in enumerate(names):
        file, key = folder / name, f"measured.files[{k}]"
        if Path(name) in map(Path, names[:k]):
            raise place.error(key, f"{name!r} is listed twice; it would count double")
        if not is_file(file):
            if not place.need_data:
                continue
            raise place.error(key, f"there is no file {file}; --data DIR names another folder")
        curves += read_bending_curves(
            file,
            deflection=channel_of(section.deflection),
            load=channel_of(section.load),
            repetition=section.repetition,
            preload=section.preload,
            zero=section.zero,
            comment=section.comment,
            decimal=section.decimal,
            format=format,
        )
    return tuple(curves)


#: The one part of the test.
PART = "cylinder"
#: mm of an element, unless the file says otherwise.
SIZE = 25.0
#: Keys that may be left out, and what is then as usual.
USUAL = {"span": "span", "seam_width": "seam width", "length": "length", "collar": "collar",
         "support_diameter": "diameter of the supports"}  # fmt: skip
KEYS = {"supports.span": "span", "supports.diameter": "support_diameter", "size": "element_size"}


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderTest:
    """One cylinder at one pressure. Lengths mm, pressure MPa (gauge).

    deflections : frames of the bending. listed : whether the section lists measured files. assumed
    : what the section leaves to usual values, in words.
    """

    name: str
    place: Place
    diameter: float
    pressure: float
    length: float
    seam_width: float
    size: float
    symmetry: Literal["quarter", "full"]
    cap_warp: Literal["x", "y"]
    supports: RigidSupports
    collar: Collar
    deflections: tuple[float, ...]
    gas: Gas
    reading: CurveReading
    measured: tuple[BendingCurve, ...] = ()
    listed: bool = False
    assumed: tuple[str, ...] = ()
    kind: str = "cylinder"
    #: Nothing of it is fitted.
    weight: float = 1.0

    @property
    def reads_files(self) -> bool:
        """Return whether its section lists measured files."""
        return self.listed

    def data_files(self) -> Sequence[DataFile]:
        """Return the files of the measured repetitions."""
        return joined(
            DataFile(c.path, c.source or FrameSource(), len(c.load), c.dropped)
            for c in self.measured
            if c.path is not None
        )

    @property
    def reach(self) -> Reach:
        """Return nothing: the strains are known only with a card."""
        return Reach()

    def model(self, thickness: float | None = None) -> CylinderModel:
        """Return the model with a fabric of this thickness (mm), else of the project's."""
        thick = self.place.fabric.thickness if thickness is None else thickness
        return inflated_cylinder(
            self.diameter, self.pressure, thick, self.size, self.length, self.seam_width,
            self.supports, self.collar, self.deflections, self.symmetry, self.cap_warp, self.gas,
            self.reading,
        )  # fmt: skip

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, CylinderModel]:
        """Return the one model; edges, or every increment, divided by a factor."""
        if what == "elements":
            return {PART: replace(self, size=self.size / factor).model(thickness)}
        if factor != int(factor):
            problem = "the cylinder's steps are divided, never joined: use --coarser 0"
            raise InputError(None, "increments", problem)
        model, parts = self.model(thickness), int(factor)
        finer: dict[str, Any] = {}
        for name in ("inflation", "increments"):
            ends = pairwise((0.0, *getattr(model, name)))
            steps = [np.linspace(a, b, parts + 1)[1:] for a, b in ends]
            finer[name] = [float(value) for part in steps for value in part]
        return {PART: replace(model, **finer)}

    def settings(self) -> Mapping[str, object]:
        """Return everything but names, measurements and where the curve is read."""
        names = (
            "diameter", "pressure", "length", "seam_width", "size", "symmetry", "cap_warp",
            "deflections",
        )  # fmt: skip
        bodies = {name: asdict(getattr(self, name)) for name in ("supports", "collar", "gas")}
        return {**{name: getattr(self, name) for name in names}, **bodies}


def read(section: CylinderSection, place: Place, name: str) -> CylinderTest:
    """Read the section of a test; refuse a cylinder that makes no model."""
    scales = place.scales

    def length(value: float | None, default: float) -> float:
        return default if value is None else float(value * scales.length)

    diameter = section.diameter * scales.length
    places = section.places
    try:
        test = CylinderTest(
            name=name,
            place=place,
            diameter=diameter,
            pressure=section.pressure * scales.pressure,
            length=length(section.length, LENGTH),
            seam_width=length(section.seam_width, SEAM_WIDTH),
            size=length(section.element_size, SIZE),
            symmetry=section.symmetry,
            cap_warp=section.cap_warp,
            supports=RigidSupports(
                length(section.span, RigidSupports().span),
                length(section.support_diameter, RigidSupports().diameter),
            ),
            collar=usual_collar(diameter)
            if section.collar is None
            else Collar(**_scaled(section.collar, scales.length)),
            deflections=_deflections(section, scales.length),
            gas=Gas(**_scaled(section.gas, scales.pressure, ("ambient",))),
            reading=curve_reading(
                diameter,
                None if places is None else [p * scales.length for p in places],
                section.slope_over and section.slope_over * scales.length,
            ),
        )
        test.model()
    except InputError as error:
        raise place.error(KEYS.get(error.field, error.field), error.problem) from None
    listed = bool(section.measured.files)
    assumed = tuple(words for key, words in USUAL.items() if getattr(section, key) is None)
    measured = read_measured(section.measured, place)
    return replace(test, measured=measured, listed=listed, assumed=assumed)


def _scaled(section: BaseModel, scale: float, names: Sequence[str] | None = None) -> dict[str, Any]:
    given = section.model_dump(exclude_none=True)
    return {k: v * scale if names is None or k in names else v for k, v in given.items()}


def _deflections(section: CylinderSection, scale: float) -> tuple[float, ...]:
    """Return the deflections listed, else equal steps."""
    if section.deflections is not None:
        return tuple(d * scale for d in section.deflections)
    end = DEFLECTION if section.deflection is None else section.deflection * scale
    return tuple(np.linspace(0.0, end, (section.frames or FRAMES) + 1)[1:].tolist())
