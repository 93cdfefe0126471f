"""What every section of a project file is made of: the base of its model, numbers, units.

A room's own sections live in that room; what pydantic finds wrong becomes one line by
`section_errors.first_error`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

ModulusUnit = Literal["GPa", "MPa", "Pa"]
PressureUnit = Literal["kPa", "MPa", "bar", "Pa"]
LengthUnit = Literal["mm", "m"]
LoadUnit = Literal["N", "kN"]
Name = Annotated[str, Field(min_length=1, max_length=300)]

#: MPa per unit.
MODULUS_UNITS: dict[str, float] = {"GPa": 1000.0, "MPa": 1.0, "Pa": 1e-6}
#: MPa per unit.
PRESSURE_UNITS: dict[str, float] = {"kPa": 1e-3, "MPa": 1.0, "bar": 0.1, "Pa": 1e-6}
#: mm per unit.
LENGTH_UNITS: dict[str, float] = {"mm": 1.0, "m": 1000.0}

#: Beyond, products of a few numbers overflow; nobody means such a number in any unit.
HUGE = 1e18

Number = Annotated[float, Field(ge=-HUGE, le=HUGE)]
Positive = Annotated[float, Field(gt=0, le=HUGE)]
#: Logarithmic, so 2 is 640 %: who writes 13 means percent.
Strain = Annotated[float, Field(gt=0, le=2)]
#: Lower and upper bound.
Pair = Annotated[list[Positive], Field(min_length=2, max_length=2)]
#: Ends of a range of strain: warp, fill, shear.
StrainTriple = Annotated[list[Strain], Field(min_length=3, max_length=3)]


class Section(BaseModel):
    """A table of a project file: no unknown keys, no text for numbers, no NaN."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def beside(folder: Path, given: str) -> Path:
    """The path that a file in `folder` names: beside it, unless absolute or below the home (~)."""
    return folder / os.path.expanduser(given)
