"""One [[biaxial]] of a project, in the file's own units."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from ...readers.sections import Name, Number, Positive, Section
from .data import LoadUnit, StrainUnit

Weight = Annotated[float, Field(ge=0, le=1e6)]
FileNames = Annotated[list[str], Field(min_length=1)]
ByRatio = Annotated[dict[str, FileNames], Field(min_length=1)]


def _files(given: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    kind: Any = ByRatio if isinstance(given, dict) else FileNames
    return TypeAdapter(kind).validate_python(given, strict=True)


class ColumnsSection(Section):
    """Section [biaxial.data.columns]: the files' own column names."""

    warp_load: str | None = None
    fill_load: str | None = None
    warp_strain: str | None = None
    fill_strain: str | None = None
    ratio: str | None = None


class TablesSection(Section):
    """Section [biaxial.data]: the files, in any order, or those of each ratio."""

    files: Annotated[list[str] | dict[str, list[str]], BeforeValidator(_files)]
    folder: str = ""
    format: str | None = None
    columns: ColumnsSection = ColumnsSection()
    load_unit: LoadUnit | None = None
    strain_unit: StrainUnit | None = None
    decimal: Literal[".", ","] | None = None
    comment: str = "#"


class BiaxialSection(Section):
    """Section [[biaxial]]: a cruciform, its loads in kN/m and strains as one test.

    range : kN/m, of the larger load, in which paths are evaluated. cycle : of each ratio.
    conditioning : cycles at the beginning of each file that count for nothing. noise : of one
    measured strain, in %.
    """

    name: Name | None = None
    weight: Weight = 1.0
    ratios: Annotated[list[str], Field(min_length=1)] | None = None
    range: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    cycle: Literal["last"] | Annotated[int, Field(ge=1)] = "last"
    conditioning: Annotated[int, Field(ge=0)] = 0
    points: Annotated[int, Field(ge=2, le=10000)] = 50
    noise: Positive | None = None
    data: TablesSection
