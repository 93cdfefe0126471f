"""A cylinder in bending: its section [[cylinder]] of a project, and its model.

A membrane (`CylinderTest.model`), or a beam of a wall that the section gives per width: the keys of
each are refused where the other is asked for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...materials.card import MaterialCard
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeSection
from ...meshes.cylinder_model import (
    DEFLECTION,
    FRAMES,
    LENGTH,
    SEAM_WIDTH,
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
from ...readers.bending import BendingCurve, read_bending_curves
from ...readers.frames import FrameSource
from ...readers.sections import (
    Length,
    Name,
    Number,
    Positive,
    Pressure,
    Section,
    Unit,
    whole_in_base_units,
)
from .. import kinds
from ..kinds import (
    ChannelSection,
    DataFile,
    MemberSection,
    Place,
    Reach,
    Refined,
    SectionTest,
    divided,
)

Frames = Annotated[int, Field(ge=1, le=10000)]
FileNames = Annotated[list[str], Field(min_length=1)]
Lengths = Annotated[list[Length], Field(min_length=1)]
NotNegative = Annotated[float, Field(ge=0, le=1e18), Unit("length")]


class SaddleSection(Section):
    """A shell around the cylinder in which it lies, in place of a round support."""

    inner_diameter: Length
    length: Length
    fillet: Length | None = None


class CollarSection(SaddleSection):
    """The ring that bends the cylinder, or two of them; by its diameter unless given."""

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
    """A cord along the cylinder: force by strain, or stiffness EA (N); N and plain strains."""

    angle: NoUnit
    bonded: bool = True
    initial_force: NoUnit | None = None


class WallSection(Section):
    """The wall of a beam, N/mm of width by pressure: plain (axial ...) or braided (yarn ...)."""

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


class MeasuredSection(Section):
    """Measured loads: a file a repetition, or a column that tells repetitions apart."""

    files: FileNames | None = None
    folder: str = ""
    format: str | None = None
    deflection: ChannelSection = ChannelSection.model_construct()
    load: ChannelSection = ChannelSection.model_construct()
    repetition: str | None = None
    preload: Number = 0.0
    zero: Literal["none", "first", "line"] = "none"
    comment: str = "#"
    decimal: Literal[".", ","] | None = None


class BentSection(Section):
    """Keys of a membrane that is inflated, laid on two supports and bent."""

    name: Name | None = None
    cord: list[CordSection] = Field(default_factory=list)
    diameter: Length
    pressure: Pressure
    length: Length | None = None
    seam_width: NotNegative | None = None
    element_size: Length | None = None
    symmetry: Literal["full", "quarter"] = "quarter"
    span: Length | None = None
    support_diameter: Length | None = None
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
    """Section [[cylinder]]: inflated, laid on two supports, bent by a collar or two loads."""

    model: Literal["membrane", "beam"] = "membrane"
    wall: WallSection | None = None
    load_spacing: NotNegative | None = None
    load_width: NotNegative | None = None
    roller_below_axis: NotNegative | None = None
    mass_per_length: NoUnit | None = None
    friction: NoUnit | None = None


#: The one part of the test.
PART = "cylinder"
#: mm of an element, unless the file says otherwise.
SIZE = 25.0
#: Keys that may be left out, and what is then as usual.
USUAL = {
    "span": f"span ({RigidSupports().span:g} mm)", "seam_width": f"seam width ({SEAM_WIDTH:g} mm)",
    "length": f"length ({LENGTH:g} mm)", "collar": "collar",
    "support_diameter": f"diameter of the supports ({RigidSupports().diameter:g} mm)",
}  # fmt: skip
KEYS = {"supports.span": "span", "supports.diameter": "support_diameter", "size": "element_size"}
#: Keys of a membrane alone, and of a beam alone.
OF_MEMBRANE = ("length", "seam_width", "symmetry", "support_diameter", "saddle", "mass_per_area",
               "collar", "cap_warp", "gas")  # fmt: skip
OF_BEAM = ("wall", "load_spacing", "load_width", "roller_below_axis", "mass_per_length", "friction")
#: Keys of both kinds of walls of a beam.
PLAIN, BRAID = ("axial", "hoop", "shear"), (
    "angle", "yarn", "yarn_shear", "bladder", "bladder_shear"
)  # fmt: skip
#: m/s^2 of self weight.
GRAVITY = 9.80665
HEAVIEST = 50.0  # kg/m^2 of one layer: beyond, it is given in g/m^2


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderTest(SectionTest):
    """One cylinder at one pressure. Lengths mm, pressure MPa (gauge).

    deflections : frames of the bending. reads_files : whether the section lists any. assumed : what
    the section leaves to usual values, in words.
    """

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
    #: The strains are known only with a card.
    reach = Reach()

    def data_files(self) -> Sequence[DataFile]:
        return kinds.joined(
            DataFile(c.path, c.source or FrameSource(), len(c.load), c.dropped)
            for c in self.measured
            if c.path is not None
        )

    @property
    def own_card(self) -> MaterialCard | None:
        """Return the wall of a beam as a card of constant moduli, of the fabric's thickness."""
        if self.beam is None:
            return None
        thick = self.thick(None)
        axial, hoop, shear, nu = self.beam.section.wall.moduli
        law = HypoelasticLaw.linear(axial / thick, hoop / thick, shear / thick, nu)
        return MaterialCard(law, thick, "its wall")

    def model(self, thickness: float | None = None) -> CylinderModel | BeamModel:
        """Return the model with a fabric of this thickness (mm), else of the project's."""
        if self.beam is not None:
            return self.beam
        thick = self.thick(thickness)
        return inflated_cylinder(
            self.diameter, self.pressure, thick, self.size, self.length, self.seam_width,
            self.supports, self.collar, self.deflections, self.symmetry, self.cap_warp, self.gas,
            self.reading, self.cords, 1e-6 * GRAVITY * self.mass_per_area,
        )  # fmt: skip

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, CylinderModel | BeamModel]:
        """Return the one model; edges, or every increment, divided by a factor."""
        if what == "elements":
            if self.beam is not None:
                return {PART: replace(self.beam, size=self.beam.size / factor)}
            return {PART: replace(self, size=self.size / factor).model(thickness)}
        model = self.model(thickness)
        names = ("inflation", "increments") if self.beam is None else ("increments",)
        finer: dict[str, Any] = {n: divided(getattr(model, n), factor, "cylinder") for n in names}
        return {PART: replace(model, **finer)}

    def settings(self) -> Mapping[str, object]:
        """Return everything but names, measurements and where the curve is read."""
        names = ("diameter", "pressure", "length", "seam_width", "size", "symmetry", "cap_warp",
                 "deflections", "mass_per_area")  # fmt: skip
        bodies = {name: asdict(getattr(self, name)) for name in ("supports", "collar", "gas")}
        of_beam = {} if self.beam is None else {"beam": repr(self.beam)}
        of_cords = {"cords": repr(self.cords)} if self.cords else {}
        return {**{name: getattr(self, name) for name in names}, **bodies, **of_cords, **of_beam}


def read(section: BentSection, place: Place, name: str) -> CylinderTest:
    """Read the section of a test; refuse a cylinder that makes no model."""
    beam = isinstance(section, CylinderSection) and section.model == "beam"
    for key in OF_MEMBRANE if beam else OF_BEAM:
        if key in section.model_fields_set:
            other = "membrane" if beam else "beam"
            raise place.error(key, f'is a key of model = "{other}"; take it out or change model')

    own = whole_in_base_units(section, place.scales)
    deflections = own.deflections
    if deflections is None:
        end = own.deflection or DEFLECTION
        deflections = np.linspace(0.0, end, (own.frames or FRAMES) + 1)[1:].tolist()
    shared: dict[str, Any] = {
        "name": name, "place": place, "diameter": own.diameter, "deflections": tuple(deflections),
        "reads_files": bool(section.measured.files),
        "cords": tuple(_cord(c, place, f"cord[{i}]") for i, c in enumerate(own.cord)),
    }  # fmt: skip
    if isinstance(section, CylinderSection) and beam:
        return _beam(section, shared)
    usual, mass = RigidSupports(), own.mass_per_area or 0.0
    if mass > HEAVIEST:
        raise place.error("mass_per_area", f"expected kg/m^2, 0.9 for 900 g/m^2; got {mass:g}")
    with place.naming(keys=KEYS):
        collar, saddle = (
            None if one is None else Collar(**one.model_dump(exclude_none=True))
            for one in (own.collar, own.saddle)
        )
        test = CylinderTest(
            **shared,
            pressure=own.pressure,
            length=own.length or LENGTH,
            seam_width=SEAM_WIDTH if own.seam_width is None else own.seam_width,
            size=own.element_size or SIZE,
            symmetry=own.symmetry,
            cap_warp=own.cap_warp,
            supports=RigidSupports(
                own.span or usual.span,
                own.support_diameter or usual.diameter,
                saddle,
            ),
            mass_per_area=mass,
            collar=collar or usual_collar(own.diameter),
            gas=Gas(**own.gas.model_dump(exclude_none=True)),
            reading=curve_reading(own.diameter, own.places, own.slope_over),
        )
        test.model()
    return replace(
        test,
        measured=read_measured(section.measured, place),
        assumed=tuple(words for key, words in USUAL.items() if getattr(own, key) is None),
    )


def _cord(section: CordSection, place: Place, at: str) -> Cord:
    """Return a cord of a section; InputError names its key."""
    table = section.table(place, at)
    with place.naming(at):
        return Cord(table=table, **section.model_dump(exclude={"stiffness", "strain", "force"}))


def _wall(section: WallSection, at: float, place: Place) -> PlainWall | BraidedWall:
    """Return the wall at a pressure (in the project's unit), straight between those listed."""
    known = section.pressure or [at]
    if not (np.diff(known) > 0).all():
        raise place.error("wall.pressure", f"expected each above the last, got {known}")
    if not known[0] * (1 - 1e-9) <= at <= known[-1] * (1 + 1e-9):
        ends = f"{known[0]:g} to {known[-1]:g}"
        raise place.error("pressure", f"{at:g} lies outside wall.pressure, {ends}")

    def value(key: str) -> float:
        given = getattr(section, key)
        if isinstance(given, list) and len(given) != len(known):
            raise place.error(f"wall.{key}", f"expected {len(known)}, one a pressure, got {given}")
        return float(np.interp(at, known, given)) if isinstance(given, list) else float(given)

    own, other = (BRAID, PLAIN) if section.yarn is not None else (PLAIN, BRAID)
    for keys, there in ((own, False), (other, True)):
        if wrong := [key for key in keys if (getattr(section, key) is not None) == there]:
            problem = f"expected {', '.join(PLAIN)}, or of a braid {', '.join(BRAID)}"
            raise place.error(f"wall.{wrong[0]}", problem)
    more = "across" if own is BRAID else "poisson"
    values = {k: value(k) for k in (*own, more) if getattr(section, k) is not None}
    with place.naming("wall"):
        if own is BRAID:
            return BraidedWall(**values)
        return PlainWall(**values, wrinkles=section.wrinkles)


def _beam(section: CylinderSection, shared: dict[str, Any]) -> CylinderTest:
    """Read the section of a beam; shared : by fields of any test."""
    place = shared["place"]
    own = whole_in_base_units(section, place.scales)
    if section.wall is None:
        raise place.error("wall", 'a beam (model = "beam") needs its stiffness per width; add it')
    wall = _wall(section.wall, section.pressure, place)
    for i, cord in enumerate(shared["cords"]):
        if not cord.bonded:
            problem = "one that slides is for a membrane; a beam takes bonded = true"
            raise place.error(f"cord[{i}].bonded", problem)
    with place.naming(keys={**KEYS, "angle": "wall.angle"}):
        beam = BeamModel(
            TubeSection(0.5 * own.diameter, own.pressure, wall, shared["cords"]),
            own.span or RigidSupports().span, list(shared["deflections"]),
            own.load_spacing or 0.0, load_width=own.load_width or 0.0,
            roller_below=own.roller_below_axis or 0.0,
            weight=1e-3 * GRAVITY * (own.mass_per_length or 0.0), friction=own.friction or 0.0,
            size=own.element_size or SIZE,
            reading=curve_reading(own.diameter, own.places, own.slope_over),
        )  # fmt: skip
    assumed = [USUAL["span"]] if section.span is None else []
    assumed += ["constant pressure while bending"]
    assumed += ["weightless tube"] if section.mass_per_length is None else []
    return CylinderTest(
        **shared, pressure=beam.pressure, length=beam.span, seam_width=0.0, size=beam.size,
        symmetry="quarter", cap_warp="x", supports=beam.supports, collar=beam.collar, gas=Gas(),
        reading=beam.reading, beam=beam, measured=read_measured(section.measured, place),
        assumed=tuple(assumed),
    )  # fmt: skip


def read_measured(section: MeasuredSection, place: Place) -> tuple[BendingCurve, ...]:
    """Read every repetition in the files of a section; none where it lists none."""
    folder, files = place.folder(section.folder), {None: section.files or []}
    format = kinds.named_format(place, "measured.format", "machine table", section.format)
    way, load = section.deflection.channel, section.load.channel
    keys = ("repetition", "preload", "zero", "comment", "decimal")
    said = {key: getattr(section, key) for key in keys}
    curves: list[BendingCurve] = []
    for file, key, _ in kinds.listed_files(place, folder, files, "measured.files"):
        if place.has(file, key):
            curves += read_bending_curves(file, deflection=way, load=load, format=format, **said)
    return tuple(curves)
