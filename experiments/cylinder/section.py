"""Keys of the section [[cylinder]] of a project: a bent membrane, or a beam with a given wall."""

from typing import Annotated, Literal

from pydantic import Field

from ...readers.sections import Length, Name, Number, Positive, Pressure, Section, Size, Unit
from ..sections import ChannelSection, FileNames, FormatSection, MemberSection

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
