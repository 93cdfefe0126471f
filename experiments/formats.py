"""The key `format` of a test's data: a format of files that is named, not found by content."""

from __future__ import annotations

from ..data.registry import Content, format_named
from ..errors import InputError
from .base import Place


def named_format(place: Place, field: str, content: Content, name: str | None) -> str | None:
    """The name, if there is such a format; None where the section leaves it to the files.

    Parameters
    ----------
    field : dotted key of the name below the section.

    Raises
    ------
    InputError : naming file and key. PlugInFailure : a reader of a plug-in that does not work.
    """
    if name is not None:
        try:
            format_named(content, name)
        except InputError as error:
            raise place.error(field, error.problem) from None
    return name
