"""Settings of the membrane solver: the table `[solver.membrane]` of a project file."""

from typing import Annotated, Literal

from pydantic import Field

from ..settings import SolverSettings


class MembraneSettings(SolverSettings):
    """Assumption on the wall of a bent, inflated cylinder; a band of two unless one is given.

    wrinkle_stiffness, bending_stiffness : see `wall.Wall`.
    """

    wall: Literal["band", "tension field", "stiff"] = "band"
    wrinkle_stiffness: Annotated[float, Field(gt=0, le=1)] | None = None
    bending_stiffness: Annotated[float, Field(ge=0)] | None = None
