"""Sections of columns and formats that several kinds of test share."""

from __future__ import annotations

from ..errors import InputError
from ..readers.machine_tables import Channel
from ..readers.registry import Content, format_named
from ..readers.sections import Number, Section
from .kinds import Place


class ChannelSection(Section):
    """A column of a measured file."""

    column: str | None = None
    unit: str | None = None
    scale: Number | None = None
    offset: Number = 0.0


def channel_of(section: ChannelSection) -> Channel:
    """Return the channel of a section."""
    return Channel(**section.model_dump())


def named_format(place: Place, field: str, content: Content, name: str | None) -> str | None:
    """Return the name after a check that there is such a format; None where none is given.

    field : dotted key of the name below the section.
    Raises InputError: naming file and key. PlugInFailure : a reader of a plug-in that does not
    work.
    """
    if name is not None:
        try:
            format_named(content, name)
        except InputError as error:
            raise place.error(field, error.problem) from None
    return name
