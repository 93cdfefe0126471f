"""The project files of a uniaxial and of a joint fit, in the file's own units."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from .schema import (
    CommonFile,
    CommonFitSection,
    LoadUnit,
    NuisanceSection,
    Positive,
    ProjectFile,
    Section,
)

Weight = Annotated[float, Field(ge=0, le=1e6)]


class GaugeSection(Section):
    gauge_length: Positive | None = None
    final_length: Positive | None = None


class CurveColumnsSection(Section):
    elongation: str | None = None
    load: str | None = None
    specimen: str | None = None
    direction: str | None = None


FileNames = Annotated[list[str], Field(min_length=1)]


class FilesSection(Section):
    """Files that do not name their direction, by direction."""

    warp: FileNames | None = None
    fill: FileNames | None = None
    bias: FileNames | None = None


def _files(given: Any) -> Any:
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    if isinstance(given, dict):
        return FilesSection.model_validate(given)
    return given if given is None else TypeAdapter(FileNames).validate_python(given, strict=True)


class CurvesSection(Section):
    polynomials: str | None = None
    files: Annotated[list[str] | FilesSection | None, BeforeValidator(_files)] = None
    folder: str = ""
    columns: CurveColumnsSection = CurveColumnsSection()
    load_unit: LoadUnit | None = None
    length_unit: Literal["mm", "cm", "m"] | None = None
    decimal: Literal[".", ","] | None = None
    comment: str = "#"
    order: Annotated[int, Field(ge=1, le=10)] = 4
    through_origin: bool = True


class WeightsSection(Section):
    warp: Weight = 1.0
    fill: Weight = 1.0
    bias: Weight = 1.0


class UniaxialSection(Section):
    thickness: Positive
    width: Positive | None = None
    grip_distance: Positive | None = None
    bias_angle: Annotated[float, Field(gt=0, lt=90)] = 45.0
    increments: Annotated[int, Field(ge=1, le=10000)] = 100
    warp: GaugeSection | None = None
    fill: GaugeSection | None = None
    bias: GaugeSection | None = None
    data: CurvesSection
    match: Literal["polynomial", "points"] = "polynomial"
    weights: WeightsSection = WeightsSection()


class UniaxialFitSection(CommonFitSection):
    objective: Literal["N", "relative"] = "N"


class UniaxialFile(CommonFile):
    """The whole file of a uniaxial fit."""

    uniaxial: UniaxialSection
    fit: UniaxialFitSection = UniaxialFitSection()


class JointWeightsSection(Section):
    bubble: Weight = 1.0
    uniaxial: Weight = 1.0


class JointFitSection(CommonFitSection):
    nuisance: NuisanceSection = NuisanceSection()


class JointFile(ProjectFile):
    """The whole file of a joint fit: a bubble and strips of the same material."""

    uniaxial: UniaxialSection
    joint: JointWeightsSection = JointWeightsSection()
    fit: JointFitSection = JointFitSection()  # type: ignore[assignment]
