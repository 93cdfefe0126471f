"""How a project says what a column of readings means, for every kind of test."""

from __future__ import annotations

from ..data.channels import Channel
from ..sections import Number, Section


class ChannelSection(Section):
    """How a column of a measured file is meant."""

    column: str | None = None
    unit: str | None = None
    scale: Number | None = None
    offset: Number = 0.0


def channel_of(section: ChannelSection) -> Channel:
    """The channel that a section describes."""
    return Channel(**section.model_dump())
