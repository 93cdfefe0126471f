"""A cylinder in bending: its section [[cylinder]] of a project, and its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field

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
from ...readers.sections import Length, Name, Number, Positive, Pressure, Section, Unit
from ..kinds import (
    ChannelSection,
    DataFile,
    Place,
    Reach,
    Refined,
    channel_of,
    joined,
    named_format,
)

Frames = Annotated[int, Field(ge=1, le=10000)]
FileNames = Annotated[list[str], Field(min_length=1)]
Lengths = Annotated[list[Length], Field(min_length=1)]
NotNegative = Annotated[float, Field(ge=0, le=1e18), Unit("length")]


class CollarSection(Section):
    """The ring that bends the cylinder; by its diameter unless given."""

    inner_diameter: Length
    length: Length
    fillet: Length | None = None


class GasSection(Section):
    """The gas that fills the cylinder."""

    ambient: Pressure | None = None
    temperature: Positive | None = None
    density: Positive | None = None


class MeasuredSection(Section):
    """Measured loads: a file a repetition, or a column that tells repetitions apart."""

    files: FileNames | None = None
    folder: str = ""
    format: str | None = None
    deflection: ChannelSection = ChannelSection()
    load: ChannelSection = ChannelSection()
    repetition: str | None = None
    preload: Number = 0.0
    zero: Literal["none", "first", "line"] = "none"
    comment: str = "#"
    decimal: Literal[".", ","] | None = None


class CylinderSection(Section):
    """Section [[cylinder]]: inflated, laid on two supports, bent by a collar."""

    name: Name | None = None
    diameter: Length
    pressure: Pressure
    length: Length | None = None
    seam_width: NotNegative | None = None
    element_size: Length | None = None
    symmetry: Literal["full", "quarter"] = "quarter"
    span: Length | None = None
    support_diameter: Length | None = None
    collar: CollarSection | None = None
    deflection: Length | None = None
    frames: Frames | None = None
    deflections: Lengths | None = None
    places: Lengths | None = None
    slope_over: Length | None = None
    cap_warp: Literal["x", "y"] = "x"
    gas: GasSection = GasSection()
    measured: MeasuredSection = MeasuredSection()


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

    deflections : frames of the bending. reads_files : whether the section lists any. assumed : what
    the section leaves to usual values, in words.
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
    reads_files: bool = False
    assumed: tuple[str, ...] = ()
    kind: str = "cylinder"
    #: Nothing of it is fitted.
    weight: float = 1.0
    #: The strains are known only with a card.
    reach = Reach()

    def data_files(self) -> Sequence[DataFile]:
        """Return the files of the measured repetitions."""
        return joined(
            DataFile(c.path, c.source or FrameSource(), len(c.load), c.dropped)
            for c in self.measured
            if c.path is not None
        )

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
        names = ("diameter", "pressure", "length", "seam_width", "size", "symmetry", "cap_warp",
                 "deflections")  # fmt: skip
        bodies = {name: asdict(getattr(self, name)) for name in ("supports", "collar", "gas")}
        return {**{name: getattr(self, name) for name in names}, **bodies}


def read(section: CylinderSection, place: Place, name: str) -> CylinderTest:
    """Read the section of a test; refuse a cylinder that makes no model."""
    length, pressure = place.scales.length, place.scales.pressure

    def own(value: float | None, default: float) -> float:
        return default if value is None else float(value * length)

    def scaled(part: BaseModel, scale: float, *names: str) -> dict[str, Any]:
        given = part.model_dump(exclude_none=True)
        return {k: v * scale if k in names else v for k, v in given.items()}

    def listed(values: Sequence[float] | None) -> list[float] | None:
        return None if values is None else [v * length for v in values]

    diameter, usual = section.diameter * length, RigidSupports()
    deflections, end = listed(section.deflections), own(section.deflection, DEFLECTION)
    if deflections is None:
        deflections = np.linspace(0.0, end, (section.frames or FRAMES) + 1)[1:].tolist()
    try:
        collar = section.collar and Collar(
            **scaled(section.collar, length, "inner_diameter", "length", "fillet")
        )
        test = CylinderTest(
            name=name,
            place=place,
            diameter=diameter,
            pressure=section.pressure * pressure,
            length=own(section.length, LENGTH),
            seam_width=own(section.seam_width, SEAM_WIDTH),
            size=own(section.element_size, SIZE),
            symmetry=section.symmetry,
            cap_warp=section.cap_warp,
            supports=RigidSupports(
                own(section.span, usual.span), own(section.support_diameter, usual.diameter)
            ),
            collar=collar or usual_collar(diameter),
            deflections=tuple(deflections),
            gas=Gas(**scaled(section.gas, pressure, "ambient")),
            reading=curve_reading(
                diameter, listed(section.places), section.slope_over and section.slope_over * length
            ),
        )
        test.model()
    except InputError as error:
        raise place.error(KEYS.get(error.field, error.field), error.problem) from None
    return replace(
        test,
        measured=read_measured(section.measured, place),
        reads_files=bool(section.measured.files),
        assumed=tuple(words for key, words in USUAL.items() if getattr(section, key) is None),
    )


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Read every repetition in the files of a section; none where it lists none."""
    names = section.files or []
    folder = place.data_folder
    if folder is None:
        folder = place.path.parent / section.folder
    format = named_format(place, "measured.format", "machine table", section.format)
    way, load = channel_of(section.deflection), channel_of(section.load)
    keys = ("repetition", "preload", "zero", "comment", "decimal")
    said = {key: getattr(section, key) for key in keys}
    curves: list[BendingCurve] = []
    for k, name in enumerate(names):
        file, key = folder / name, f"measured.files[{k}]"
        if Path(name) in map(Path, names[:k]):
            raise place.error(key, f"{name!r} is listed twice; it would count double")
        if not is_file(file):
            if not place.need_data:
                continue
            raise place.error(key, f"there is no file {file}; --data DIR names another folder")
        curves += read_bending_curves(file, deflection=way, load=load, format=format, **said)
    return tuple(curves)
