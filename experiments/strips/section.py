"""The section [[strips]] of a project file."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, TypeAdapter

from ...readers.curves import LengthUnit, LoadUnit, cut_of
from ...readers.sections import Length, Name, Positive, Section, Size, Weight
from ..sections import FileNames, TableFilesSection

Match = Literal["polynomial", "points"]
ErrorUnit = Literal["N", "relative"]


class GaugeSection(Section):
    """Section [strips.warp], fill or bias: the virtual strain gauge at rest and at the end.

    That of "bias" is also the gauge of strips at further angles, such as "15 degrees".
    """

    gauge_length: Size | None = None
    final_length: Size | None = None


class StripColumnsSection(Section):
    """Section [strips.data.columns]: the files' own column names."""

    elongation: str | None = None
    load: str | None = None
    lateral: str | None = None  # engineering strain across the strip
    specimen: str | None = None
    direction: str | None = None


class FilesSection(Section):
    """File names by direction; the files themselves need no column of directions."""

    warp: FileNames | None = None
    fill: FileNames | None = None
    bias: FileNames | None = None


def _files(value: Any) -> Any:
    """Return the files of a section, as a table of names or as a list, checked."""
    # Either form is checked here and not as a union: complaints then name the key, not the form.
    if isinstance(value, dict):
        return FilesSection.model_validate(value)
    return value if value is None else TypeAdapter(FileNames).validate_python(value, strict=True)


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


class CurvesSection(TableFilesSection):
    """Section [strips.data]: load curves, as polynomials or as measured.

    `directions` lists files, or one, by the angle from the warp in degrees.
    """

    polynomials: str | None = None
    files: Annotated[list[str] | FilesSection | None, BeforeValidator(_files)] = None
    directions: dict[str, Annotated[FileNames, BeforeValidator(_as_list)]] | None = None
    columns: StripColumnsSection = StripColumnsSection.model_construct()
    load_unit: LoadUnit | None = None
    length_unit: LengthUnit | None = None
    until_largest_load: bool = False
    order: Annotated[int, Field(ge=1, le=10)] = 4
    through_origin: bool = True
    specimens: Annotated[int, Field(ge=1, le=10000)] | None = None


class WeightsSection(Section):
    """Section [strips.weights]: weight of each direction's error in the objective."""

    warp: Weight = 1.0
    fill: Weight = 1.0
    bias: Weight = 1.0


class StripsSection(GaugeSection):
    """Section [[strips]]: cut strips pulled along warp, fill and across the yarns."""

    name: Name | None = None
    width: Size | None = None
    side_by_side: Annotated[int, Field(ge=1, le=1000)] = 1
    grip_distance: Size | None = None
    bias_angle: Annotated[float, Field(ge=0, le=90)] = 45.0
    increments: Annotated[int, Field(ge=1, le=10000)] = 100
    warp: GaugeSection | None = None
    fill: GaugeSection | None = None
    bias: GaugeSection | None = None
    data: CurvesSection
    noise: Positive | None = None
    compliance: Annotated[float, Field(ge=0)] = 0.0  # mm/N, of machine and grips
    compliance_prior: Positive | None = None  # mm/N, standard deviation of it
    rate: Length | None = None
    conditioning: Name | None = None
    match: Match = "polynomial"
    objective: ErrorUnit = "N"
    weight: Weight = 1.0
    weights: WeightsSection = WeightsSection.model_construct()

    def gauge(self, direction: str) -> GaugeSection:
        """Return the lengths of a direction's gauge, or of all strips where it has none."""
        gauge = getattr(self, cut_of(direction)) or GaugeSection()
        return GaugeSection(
            gauge_length=gauge.gauge_length or self.gauge_length,
            final_length=gauge.final_length or self.final_length,
        )
