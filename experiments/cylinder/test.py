"""A test of a cylinder in bending: its section, how it is read, and its membrane or beam model."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from ...materials.card import MaterialCard
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeCrossSection
from ...meshes.cylinder_model import (
    DEFAULTS,
    Collar,
    Cord,
    CurveReading,
    CylinderModel,
    Gas,
    RigidSupports,
    curve_reading,
    inflated_cylinder,
    usual_collar,
)
from ...readers.bending import BendingCurve, bending_file_name, loading_of, read_bending_curves
from ...readers.frames import FrameSource
from ...readers.sections import (
    Length,
    Name,
    Number,
    Positive,
    Pressure,
    Section,
    Size,
    Unit,
    whole_in_base_units,
)
from ..base import Reach, Refined, SectionTest
from ..data_files import DataFile, joined
from ..forward import divided
from ..sections import (
    ChannelSection,
    FileNames,
    FormatSection,
    MemberSection,
    Place,
    listed_files,
    named_format,
)

Frames = Annotated[int, Field(ge=1, le=10000)]
Lengths = Annotated[list[Length], Field(min_length=1)]
NotNegative = Annotated[float, Field(ge=0, le=1e18), Unit("length")]


class SaddleSection(Section):
    """A shell around the cylinder in which it lies, in place of a round support."""

    inner_diameter: Size
    length: Size
    fillet: Length | None = None


class CollarSection(SaddleSection):
    """The ring, or two of them, that bends the cylinder; unless given, sized by its diameter."""

    spacing: NotNegative | None = None


class GasSection(Section):
    """The gas that fills the cylinder."""

    ambient: Pressure | None = None
    temperature: Positive | None = None
    density: Positive | None = None
    constant: Literal["mass", "pressure"] = "mass"


NoUnit = Annotated[float, Field(ge=0, le=1e18)]
#: One number for all pressures, or one for each of `pressure`.
ByPressure = Positive | Annotated[list[Positive], Field(min_length=1)]


class CordSection(MemberSection):
    """A cord along the cylinder, by its force (N) over strain or by its stiffness EA (N).

    Strains are plain numbers, not percent.
    """

    angle: NoUnit
    bonded: bool = True
    initial_force: NoUnit | None = None


class WallSection(Section):
    """The wall of a beam: its stiffness in N/mm of width, one number or one for each pressure.

    A plain wall has axial, hoop and shear; a braided one has angle, yarn, yarn_shear, bladder and
    bladder_shear.
    """

    pressure: Annotated[list[Pressure], Field(min_length=1)] | None = None
    axial: ByPressure | None = None
    hoop: ByPressure | None = None
    shear: ByPressure | None = None
    poisson: NoUnit | list[NoUnit] | None = None
    wrinkles: bool = True
    angle: ByPressure | None = None
    yarn: ByPressure | None = None
    yarn_shear: ByPressure | None = None
    bladder: ByPressure | None = None
    bladder_shear: ByPressure | None = None
    across: NoUnit | list[NoUnit] | None = None


class MeasuredSection(FormatSection):
    """Measured loads: a file for each repetition, or a column that names the repetition."""

    files: FileNames | None = None
    folder: str = ""
    deflection: ChannelSection = ChannelSection.model_construct()
    load: ChannelSection = ChannelSection.model_construct()
    repetition: str | None = None
    preload: Number = 0.0
    zero: Literal["none", "first", "line"] = "none"


class BentSection(Section):
    """Keys of a membrane that is inflated, laid on two supports and bent."""

    name: Name | None = None
    cord: list[CordSection] = Field(default_factory=list)
    diameter: Size
    pressure: Pressure
    length: Size | None = None
    seam_width: NotNegative | None = None
    element_size: Length | None = None
    symmetry: Literal["full", "quarter"] = "quarter"
    span: Size | None = None
    support_diameter: Size | None = None
    saddle: SaddleSection | None = None
    mass_per_area: NoUnit | None = None
    collar: CollarSection | None = None
    deflection: Length | None = None
    frames: Frames | None = None
    deflections: Lengths | None = None
    places: Lengths | None = None
    slope_over: Length | None = None
    cap_warp: Literal["x", "y"] = "x"
    gas: GasSection = GasSection.model_construct()
    measured: MeasuredSection = MeasuredSection.model_construct()


class CylinderSection(BentSection):
    """Section [[cylinder]]: a cylinder that is inflated, laid on two supports and bent.

    A collar bends the membrane model, one or two loads bend the beam model.
    """

    model: Literal["membrane", "beam"] = "membrane"
    wall: WallSection | None = None
    load_spacing: NotNegative | None = None
    load_width: NotNegative | None = None
    roller_below_axis: NotNegative | None = None
    mass_per_length: NoUnit | None = None
    friction: NoUnit | None = None


#: The one part of the test.
PART = "cylinder"
#: Acceleration of gravity, m/s^2, for the self weight.
GRAVITY = 9.80665


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderTest(SectionTest):
    """A bending test of one cylinder at one pressure.

    Parameters
    ----------
    diameter, length, seam_width : float
        Dimensions of the cylinder before inflation, mm.
    size : float
        Edge length of an element, mm.
    pressure : float
        Gauge pressure, MPa.
    symmetry, cap_warp, supports, collar, gas, reading, cords
        Arguments of the same names of `inflated_cylinder`.
    deflections : tuple of float
        Deflection of each frame of the bending, mm.
    mass_per_area : float
        Mass of one layer of fabric, kg/m^2.
    beam : BeamModel, optional
        Model of a beam, which takes the place of a membrane.
    measured : tuple of BendingCurve
        Measured repetitions.
    reads_files : bool
        Whether the section lists measured files.
    assumed : tuple of str
        Words on each key for which a usual value is assumed.
    """

    setting_names: ClassVar[tuple[str, ...]] = (
        "diameter",
        "pressure",
        "length",
        "seam_width",
        "size",
        "symmetry",
        "cap_warp",
        "deflections",
        "mass_per_area",
    )

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
    cords: tuple[Cord, ...] = ()
    mass_per_area: float = 0.0
    beam: BeamModel | None = None
    measured: tuple[BendingCurve, ...] = ()
    reads_files: bool = False
    assumed: tuple[str, ...] = ()
    kind: str = "cylinder"
    #: Strains that the test reaches are unknown: they depend on the card it is predicted with.
    reach = Reach()

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files, with how they were read."""
        return joined(
            DataFile(
                c.path or Path(bending_file_name(c)),
                c.source or FrameSource(),
                len(c.load),
                c.dropped,
                () if c.path is not None else (c.deflection, c.load),
            )
            for c in self.measured
            if c.path is not None or c.source is not None
        )

    @property
    def own_card(self) -> MaterialCard | None:
        """Return a beam's wall as a material card with constant moduli; None for a membrane."""
        if self.beam is None:
            return None
        thickness = self.thick(None)
        axial, hoop, shear, nu = self.beam.section.wall.moduli
        law = HypoelasticLaw.linear(axial / thickness, hoop / thickness, shear / thickness, nu)
        return MaterialCard(law, thickness, "its wall")

    def model(self, thickness: float | None = None) -> CylinderModel | BeamModel:
        """Return the model with a fabric of this thickness (mm), else of the project's."""
        if self.beam is not None:
            return self.beam
        return inflated_cylinder(
            diameter=self.diameter,
            pressure=self.pressure,
            thickness=self.thick(thickness),
            size=self.size,
            length=self.length,
            seam_width=self.seam_width,
            supports=self.supports,
            collar=self.collar,
            deflections=self.deflections,
            symmetry=self.symmetry,
            cap_warp=self.cap_warp,
            gas=self.gas,
            reading=self.reading,
            cords=self.cords,
            weight=1e-6 * GRAVITY * self.mass_per_area,
        )

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, CylinderModel | BeamModel]:
        """Return the one model, refined.

        Parameters
        ----------
        thickness : float, optional
            Thickness of the fabric, mm; the project's unless given.
        refined : {"elements", "increments"}
            What is refined.
        factor : float
            Number by which edges of elements, or increments, are divided.
        """
        if refined == "elements":
            if self.beam is not None:
                return {PART: replace(self.beam, size=self.beam.size / factor)}
            return {PART: replace(self, size=self.size / factor).model(thickness)}
        model = self.model(thickness)
        steps = ("inflation", "increments") if self.beam is None else ("increments",)
        finer: dict[str, Any] = {
            name: divided(getattr(model, name), factor, "cylinder") for name in steps
        }
        return {PART: replace(model, **finer)}

    def settings(self) -> Mapping[str, object]:
        """Return everything but names, measurements and where the curve is read."""
        settings = {
            **super().settings(),
            "supports": asdict(self.supports),
            "collar": asdict(self.collar),
            "gas": asdict(self.gas),
        }
        if self.cords:
            settings["cords"] = repr(self.cords)
        if self.beam is not None:
            settings["beam"] = repr(self.beam)
        return settings


#: Edge length of an element, mm, unless the section gives it.
ELEMENT_SIZE = 25.0
#: Largest mass per area of one layer, kg/m^2; a larger number is probably in g/m^2.
LARGEST_MASS_PER_AREA = 50.0
#: Keys that may be left out, and words on the usual value that is then assumed.
ASSUMPTIONS = {
    "span": f"span ({RigidSupports().span:g} mm)",
    "seam_width": f"seam width ({DEFAULTS.seam_width:g} mm)",
    "length": f"length ({DEFAULTS.length:g} mm)",
    "collar": "collar",
    "support_diameter": f"diameter of the supports ({RigidSupports().diameter:g} mm)",
}
#: Keys of the section by names of the models' fields.
KEYS = {"supports.span": "span", "supports.diameter": "support_diameter", "size": "element_size"}
#: Keys that belong to one of the models only.
MODEL_KEYS = {
    "membrane": (
        "length",
        "seam_width",
        "symmetry",
        "support_diameter",
        "saddle",
        "mass_per_area",
        "collar",
        "cap_warp",
        "gas",
    ),
    "beam": (
        "wall",
        "load_spacing",
        "load_width",
        "roller_below_axis",
        "mass_per_length",
        "friction",
    ),
}
#: Keys of a plain wall of a beam, and of a braided one.
PLAIN_KEYS = ("axial", "hoop", "shear")
BRAID_KEYS = ("angle", "yarn", "yarn_shear", "bladder", "bladder_shear")


@dataclass(frozen=True)
class Shared:
    """Fields of `CylinderTest` that membranes and beams have in common, in base units."""

    name: str
    place: Place
    diameter: float
    deflections: tuple[float, ...]
    reads_files: bool
    cords: tuple[Cord, ...]


def read(section: BentSection, place: Place, name: str) -> CylinderTest:
    """Read a bent cylinder, as a membrane or a beam, from its section.

    Parameters
    ----------
    section : BentSection
        Section in the project's units.
    place : Place
        Place of the section in its project, for messages and files.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        If keys do not belong to the model or make no valid one, or if measured files cannot be
        read.
    """
    is_beam = isinstance(section, CylinderSection) and section.model == "beam"
    other_model = "membrane" if is_beam else "beam"
    for key in MODEL_KEYS[other_model]:
        if key in section.model_fields_set:
            problem = f'is a key of model = "{other_model}"; take it out or change model'
            raise place.error(key, problem)
    converted = whole_in_base_units(section, place.scales)
    shared = Shared(
        name=name,
        place=place,
        diameter=converted.diameter,
        deflections=_deflections(converted),
        reads_files=bool(section.measured.files or place.measured),
        cords=tuple(_cord(c, place, f"cord[{i}]") for i, c in enumerate(converted.cord)),
    )
    if isinstance(section, CylinderSection) and is_beam:
        return _beam(section, shared)
    return _membrane(section, converted, shared)


def _deflections(section: BentSection) -> tuple[float, ...]:
    """Return the deflection (mm) of each frame of a section in base units.

    Listed deflections count before an end and a number of frames, which may be of the defaults.
    """
    if section.deflections is not None:
        return tuple(section.deflections)
    end = section.deflection or DEFAULTS.deflection
    steps = np.linspace(0.0, end, (section.frames or DEFAULTS.frames) + 1)
    return tuple(steps[1:].tolist())


def _membrane(section: BentSection, converted: BentSection, shared: Shared) -> CylinderTest:
    """Return the test of a membrane; InputError if no valid model can be made.

    `section` is in the project's units, `converted` the same in base units.
    """
    place = shared.place
    usual = RigidSupports()
    mass = converted.mass_per_area or 0.0
    if mass > LARGEST_MASS_PER_AREA:
        raise place.error("mass_per_area", f"expected kg/m^2, 0.9 for 900 g/m^2; got {mass:g}")
    seam_width = converted.seam_width
    with place.errors_name(keys=KEYS):
        collar, saddle = (
            None if ring is None else Collar(**ring.model_dump(exclude_none=True))
            for ring in (converted.collar, converted.saddle)
        )
        test = CylinderTest(
            **vars(shared),
            pressure=converted.pressure,
            length=converted.length or DEFAULTS.length,
            seam_width=DEFAULTS.seam_width if seam_width is None else seam_width,
            size=converted.element_size or ELEMENT_SIZE,
            symmetry=converted.symmetry,
            cap_warp=converted.cap_warp,
            supports=RigidSupports(
                converted.span or usual.span,
                converted.support_diameter or usual.diameter,
                saddle,
            ),
            mass_per_area=mass,
            collar=collar or usual_collar(converted.diameter),
            gas=Gas(**converted.gas.model_dump(exclude_none=True)),
            reading=curve_reading(converted.diameter, converted.places, converted.slope_over),
        )
        test.model()
    assumed = [words for key, words in ASSUMPTIONS.items() if getattr(converted, key) is None]
    return replace(test, measured=read_measured(section.measured, place), assumed=tuple(assumed))


def _cord(section: CordSection, place: Place, key: str) -> Cord:
    """Return a cord of a section; InputError names its key."""
    table = section.table(place, key)
    with place.errors_name(key):
        return Cord(table=table, **section.model_dump(exclude={"stiffness", "strain", "force"}))


def _wall(section: WallSection, pressure: float, place: Place) -> PlainWall | BraidedWall:
    """Return the wall at a pressure (in the project's unit), interpolated between those listed."""
    listed = section.pressure or [pressure]
    if not (np.diff(listed) > 0).all():
        raise place.error("wall.pressure", f"expected each above the last, got {listed}")
    if not listed[0] * (1 - 1e-9) <= pressure <= listed[-1] * (1 + 1e-9):
        ends = f"{listed[0]:g} to {listed[-1]:g}"
        raise place.error("pressure", f"{pressure:g} lies outside wall.pressure, {ends}")
    is_braid = section.yarn is not None
    keys = BRAID_KEYS if is_braid else PLAIN_KEYS
    foreign_keys = (*PLAIN_KEYS, "poisson", "wrinkles") if is_braid else (*BRAID_KEYS, "across")
    _check_wall_keys(section, keys, foreign_keys, place)
    optional = "across" if is_braid else "poisson"
    values = {
        key: _at_pressure(section, key, listed, pressure, place)
        for key in (*keys, optional)
        if getattr(section, key) is not None
    }
    with place.errors_name("wall"):
        if is_braid:
            return BraidedWall(**values)
        return PlainWall(**values, wrinkles=section.wrinkles)


def _check_wall_keys(
    section: WallSection,
    keys: Sequence[str],
    foreign_keys: Sequence[str],
    place: Place,
) -> None:
    """Raise InputError unless a wall has all keys of its kind, and none of the other kind."""
    missing = [key for key in keys if getattr(section, key) is None]
    misplaced = [key for key in foreign_keys if key in section.model_fields_set]
    if misplaced:
        kind = "a plain wall" if "yarn" in keys else "a braid"
        raise place.error(f"wall.{misplaced[0]}", f"is of {kind}, and {keys[0]} of another kind")
    if missing:
        problem = f"expected {', '.join(PLAIN_KEYS)}, or of a braid {', '.join(BRAID_KEYS)}"
        raise place.error(f"wall.{missing[0]}", problem)


def _at_pressure(
    section: WallSection,
    key: str,
    listed: Sequence[float],
    pressure: float,
    place: Place,
) -> float:
    """Return a value of a wall that is one number, or a number for each listed pressure."""
    value = getattr(section, key)
    if not isinstance(value, list):
        return float(value)
    if len(value) != len(listed):
        raise place.error(f"wall.{key}", f"expected {len(listed)}, one a pressure, got {value}")
    return float(np.interp(pressure, listed, value))


def _beam(section: CylinderSection, shared: Shared) -> CylinderTest:
    """Return the test of a beam; InputError if no valid model can be made."""
    place = shared.place
    converted = whole_in_base_units(section, place.scales)
    if section.wall is None:
        raise place.error("wall", 'a beam (model = "beam") needs its stiffness per width; add it')
    wall = _wall(section.wall, section.pressure, place)
    for i, cord in enumerate(shared.cords):
        if not cord.bonded:
            problem = "one that slides is for a membrane; a beam takes bonded = true"
            raise place.error(f"cord[{i}].bonded", problem)
    with place.errors_name(keys={**KEYS, "angle": "wall.angle"}):
        tube = TubeCrossSection(0.5 * converted.diameter, converted.pressure, wall, shared.cords)
        beam = BeamModel(
            section=tube,
            span=converted.span or RigidSupports().span,
            deflections=list(shared.deflections),
            load_spacing=converted.load_spacing or 0.0,
            load_width=converted.load_width or 0.0,
            roller_below=converted.roller_below_axis or 0.0,
            weight=1e-3 * GRAVITY * (converted.mass_per_length or 0.0),
            friction=converted.friction or 0.0,
            size=converted.element_size or ELEMENT_SIZE,
            reading=curve_reading(converted.diameter, converted.places, converted.slope_over),
        )
    assumed = [ASSUMPTIONS["span"]] if section.span is None else []
    assumed.append("constant pressure while bending")
    if section.mass_per_length is None:
        assumed.append("weightless tube")
    return CylinderTest(
        **vars(shared),
        pressure=beam.pressure,
        length=beam.span,
        seam_width=0.0,
        size=beam.size,
        symmetry="quarter",
        cap_warp="x",
        supports=beam.supports,
        collar=beam.collar,
        gas=Gas(),
        reading=beam.reading,
        beam=beam,
        measured=read_measured(section.measured, place),
        assumed=tuple(assumed),
    )


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Read the measured repetitions, in memory or in the files that a section lists, if any."""
    folder = place.folder(section.folder)
    options: dict[str, Any] = {
        "deflection": section.deflection.channel,
        "load": section.load.channel,
        "format": named_format(place, "measured.format", "machine table", section.format),
    }
    for key in ("repetition", "preload", "zero", "comment", "decimal"):
        options[key] = getattr(section, key)
    curves: list[BendingCurve] = []
    for number, curve in enumerate(place.measured or ()):
        readings = replace(curve, load=curve.load + section.preload)
        curves.append(loading_of(readings, section.zero, f"curves[{number}]"))
    for file, key, _ in listed_files(place, folder, {None: section.files or []}, "measured.files"):
        if place.has(file, key):
            curves += read_bending_curves(file, **options)
    return tuple(curves)
