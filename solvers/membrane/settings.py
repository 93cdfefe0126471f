"""`[solver.membrane]` of a project file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ..offer import Offer
from ..settings import SolverSettings


class MembraneSettings(SolverSettings):
    """What a closed membrane's wall does where it is pressed together; for bendings."""

    wrinkle_stiffness: Annotated[float, Field(gt=0, le=1)] | None = None
    bending_stiffness: Annotated[float, Field(ge=0)] = 1.0


OFFER = Offer("membrane", __package__, "MembraneSolver", MembraneSettings)
