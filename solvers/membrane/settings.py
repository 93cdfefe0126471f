"""`[solver.membrane]` of a project file."""

from typing import Annotated, Literal

from pydantic import Field

from ..settings import SolverSettings


class MembraneSettings(SolverSettings):
    """Wall of a closed membrane, for bendings: a band unless a setting is given."""

    wall: Literal["band", "tension field", "stiff"] = "band"
    wrinkle_stiffness: Annotated[float, Field(gt=0, le=1)] | None = None
    bending_stiffness: Annotated[float, Field(ge=0)] | None = None
