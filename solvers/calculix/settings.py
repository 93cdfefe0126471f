"""`[solver.calculix]` of a project file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...readers.sections import Positive
from ..settings import ExternalSettings, Offer, Override


class CalculixSettings(ExternalSettings):
    """The settings of CalculiX; `CalculixSolver` says what each key means."""

    paths = ("templates", "scratch", "licence_folder")
    programs = started = ("ccx",)
    overrides = (
        Override(
            "ccx",
            "The CalculiX to run.",
            metavar="PATH",
            look="A CalculiX to look at beside the ones found.",
        ),
        Override("templates", "Folder of your own input decks.", metavar="PATH", path=True),
        Override("element", "Shell element", "S8R or S4"),
    )

    ccx: str | None = None
    templates: str | None = None
    element: Literal["S8R", "S4"] = "S8R"
    timeout: Positive = 3600.0
    scratch: str | None = None
    keep: bool = False
    threads: Annotated[int, Field(ge=1)] = 1


OFFER = Offer("calculix", __package__, "CalculixSolver", CalculixSettings)
