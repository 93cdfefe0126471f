"""The project file as it is written: sections, keys, allowed values, in the file's own units."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..meshes.disk import MAX_ELEMENTS, MIN_ELEMENTS
from ..solvers.marc.settings import MarcSettings

#: MPa per unit, MPa per unit, mm per unit.
MODULUS_UNITS = {"GPa": 1000.0, "MPa": 1.0, "Pa": 1e-6}
PRESSURE_UNITS = {"kPa": 1e-3, "MPa": 1.0, "bar": 0.1, "Pa": 1e-6}
LENGTH_UNITS = {"mm": 1.0, "m": 1000.0}

#: Beyond, products of a few numbers overflow; nobody means such a number in any unit.
HUGE = 1e18

Number = Annotated[float, Field(ge=-HUGE, le=HUGE)]
Positive = Annotated[float, Field(gt=0, le=HUGE)]
#: Logarithmic, so 2 is 640 %: who writes 13 means percent.
Strain = Annotated[float, Field(gt=0, le=2)]
Elements = Annotated[int, Field(ge=MIN_ELEMENTS, le=MAX_ELEMENTS)]
Symmetry = Literal["full", "quarter"]
LengthUnit = Literal["mm", "m"]
LoadUnit = Literal["N", "kN"]
Method = Literal["lm", "slsqp", "cobyla"]
#: Forms of the moduli by name: how many coefficients each has, less one.
FORMS = {"constant": 0, "linear": 1, "quadratic": 2, "cubic": 3, "trilinear": 2}
Form = Literal["constant", "linear", "quadratic", "cubic", "trilinear"]
Pair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
StrainPair = Annotated[list[Strain], Field(min_length=2, max_length=2)]


class Section(BaseModel):
    """A table of the project file: no unknown keys, no text for numbers, no NaN."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class ProjectSection(Section):
    kind: Literal["bubble", "uniaxial", "joint", "bend"]
    title: str = ""


class UnitsSection(Section):
    modulus: Literal["GPa", "MPa", "Pa"] = "GPa"
    pressure: Literal["kPa", "MPa", "bar", "Pa"] = "kPa"
    length: LengthUnit = "mm"


class BubbleSection(Section):
    radius: Positive
    thickness: Positive
    pressures: Annotated[list[Positive], Field(min_length=1)]
    increments: list[Positive] | None = None
    elements: Elements = 800
    symmetry: Symmetry = "full"
    generator: Literal["blocks", "gmsh"] = "blocks"


class BreaksSection(Section):
    warp: StrainPair
    fill: StrainPair
    shear: StrainPair


class MaterialSection(Section):
    nu12: Annotated[float, Field(ge=0, lt=1)] = 0.24
    thickness_change: Literal["constant", "incompressible"] = "constant"
    moduli: Form | None = None
    degree: Annotated[int, Field(ge=0, le=3)] | None = None
    strain_range: Annotated[list[Strain], Field(min_length=3, max_length=3)] | None = None
    breaks: BreaksSection | None = None


class BoundsSection(Section):
    lower: list[Number] | None = None
    upper: list[Number] | None = None
    E1: Pair | None = None
    E2: Pair | None = None
    G12: Pair | None = None


class KnownSolutionSection(Section):
    beta: list[Number]
    elements: Elements | None = None
    increments: list[Positive] | None = None
    symmetry: Symmetry | None = None


class ColumnsSection(Section):
    x: str = "x"
    y: str = "y"
    dx: str = "dx"
    dy: str = "dy"
    dz: str = "dz"


class PointsSection(Section):
    files: list[str] | None = None
    pattern: str | None = None
    indices: list[int] | None = None
    folder: str = ""
    columns: ColumnsSection = ColumnsSection()
    flag_column: str | None = None
    comment: str = "#"
    length_unit: LengthUnit | None = None


class DataSection(Section):
    known_solution: KnownSolutionSection | None = None
    points: PointsSection | None = None


class MatchSection(Section):
    by: Literal["surfaces", "points"] = "points"
    degree: Annotated[int, Field(ge=1, le=12)] = 4


class MarginSection(Section):
    E: Positive
    G12: Positive


class NuisanceSection(Section):
    displacement_offset: bool = False
    pressure_offset: bool = False


class CommonFitSection(Section):
    starts: Annotated[int, Field(ge=1)] = 50
    seed: Annotated[int, Field(ge=0)] = 1
    method: Method = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    margin: MarginSection | None = None
    solver: str = "membrane"
    max_analyses: Annotated[int, Field(ge=1)] | None = None
    tolerance: Positive = 1e-7


class FitSection(CommonFitSection):
    objective: Literal["e", "mm"] = "e"
    nuisance: NuisanceSection = NuisanceSection()


class CalculixSection(Section):
    ccx: str | None = None
    templates: str | None = None
    element: Literal["S8R", "S4"] = "S8R"
    timeout: Positive = 3600.0
    scratch: str | None = None
    keep: bool = False
    threads: Annotated[int, Field(ge=1)] = 1


class MembraneSection(Section):
    """What a closed membrane's wall does where it is pressed together; for bendings."""

    wrinkle_stiffness: Annotated[float, Field(gt=0, le=1)] | None = None
    bending_stiffness: Annotated[float, Field(ge=0)] = 1.0


class SolverSection(Section):
    """Options by solver; tables of other names are for plug-ins, which check what is in them."""

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, dict[str, Any]] = Field(init=False)

    membrane: MembraneSection = MembraneSection()
    calculix: CalculixSection = CalculixSection()
    marc: MarcSettings = MarcSettings()


class CommonFile(Section):
    """What the file of every fit has."""

    project: ProjectSection
    units: UnitsSection = UnitsSection()
    material: MaterialSection = MaterialSection()
    bounds: BoundsSection
    fit: CommonFitSection = CommonFitSection()
    solver: SolverSection = SolverSection()


class ProjectFile(CommonFile):
    """The whole file of a bubble fit."""

    bubble: BubbleSection
    data: DataSection
    match: MatchSection = MatchSection()
    fit: FitSection = FitSection()
