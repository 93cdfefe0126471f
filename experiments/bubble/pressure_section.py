"""[bubble.data.points.pressure]: where the pressure of each frame stands, and which are fitted."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...sections import Number, Positive, Section
from ..channels import ChannelSection

Unit = Literal["Pa", "hPa", "mbar", "kPa", "psi", "bar", "MPa"]
Name = Annotated[str, Field(min_length=1)]


class LogSection(Section):
    """[bubble.data.points.pressure.log]: readings by a clock of their own."""

    file: Name
    format: str | None = None
    comment: str = "#"
    decimal: Literal[".", ","] | None = None
    pressure: ChannelSection = ChannelSection()
    time: ChannelSection = ChannelSection()
    rate: Positive | None = None
    times: Name | None = None
    times_column: Name | None = None
    time_in_name: bool | Name = False
    offset: Number | None = None


class PressureSection(Section):
    """One of `from_name`, `column` and `log` says the pressures; `frames` are evenly spread."""

    from_name: bool | Name = False
    column: Name | None = None
    unit: Unit | None = None
    scale: Number | None = None
    offset: Number = 0.0
    log: LogSection | None = None
    frames: Annotated[int, Field(ge=1, le=10000)] | None = None
    tolerance: Positive | None = None
