"""Text that goes into the page as it is: the one place where that is decided."""

from __future__ import annotations

from markupsafe import Markup


def as_markup(text: str) -> Markup:
    """Text of our own making; whatever came from elsewhere is escaped in it already."""
    return Markup(text)  # noqa: S704 - callers escape names, titles and units one by one
