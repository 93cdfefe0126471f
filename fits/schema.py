"""The project file as it is written: what all tests share, in the file's own units."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field

from ..sections import (
    LengthUnit,
    ModulusUnit,
    Name,
    Number,
    Pair,
    Positive,
    PressureUnit,
    Section,
    StrainTriple,
)

Count = Annotated[int, Field(ge=1, le=1_000_000)]


class FabricSection(Section):
    """[fabric]: the one fabric that all tests are of."""

    name: str = ""
    thickness: Positive
    thickness_change: Literal["constant", "incompressible"] = "constant"


class UnitsSection(Section):
    """[units]: of every number in the file."""

    modulus: ModulusUnit = "GPa"
    pressure: PressureUnit = "kPa"
    length: LengthUnit = "mm"


class BoundsSection(Section):
    """[law.bounds]: least and largest of each modulus, or of each coefficient."""

    E1: Pair | None = None
    E2: Pair | None = None
    G12: Pair | None = None
    lower: list[Number] | None = None
    upper: list[Number] | None = None


class MarginSection(Section):
    """[law.margin]: the smallest moduli allowed where coefficients are bounded."""

    E: Positive
    G12: Positive


class LawSection(Section):
    """[law]: the form of the moduli, and between what they are looked for.

    Keys beyond these belong to a form (knots, breaks); it checks them.
    """

    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)
    __pydantic_extra__: dict[str, Any] = Field(init=False)

    form: Name = "cubic"
    nu12: Annotated[float, Field(ge=0, lt=1)] = 0.24
    strain_range: StrainTriple | None = None
    bounds: BoundsSection | None = None
    margin: MarginSection | None = None


class UnknownSection(Section):
    """[fit.unknowns.NAME]: between what it is looked for, and what is known of it before."""

    bounds: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    prior: Positive | None = None


class UnknownsSection(Section):
    """[fit.unknowns]: what is fitted beside the moduli, one value for all tests."""

    nu12: UnknownSection | None = None
    thickness: UnknownSection | None = None


class FitSection(Section):
    """[fit]: how it is looked for."""

    starts: Annotated[int, Field(ge=1)] = 50
    seed: Annotated[int, Field(ge=0)] = 1
    starts_from: Literal["random", "sobol", "proposed"] = "random"
    earlier: Name | None = None
    method: Name = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    solver: Name = "membrane"
    max_analyses: Annotated[int, Field(ge=1)] | None = None
    tolerance: Positive = 1e-7
    coarse_to_fine: bool = False
    jobs: Annotated[int, Field(ge=1, le=10000)] | None = None
    trust: list[Name] = Field(default=[])
    unknowns: UnknownsSection = UnknownsSection()
    mesh_error: Literal["told", "taken out"] = "told"
    cache: bool | Name = True


class CommonSections(Section):
    """Everything of a project file but its tests, its cards and the solvers' own sections."""

    fabric: FabricSection
    units: UnitsSection = UnitsSection()
    law: LawSection = LawSection()
    fit: FitSection = FitSection()
