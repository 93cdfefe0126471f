"""Lines that several blocks have."""

from __future__ import annotations

from .content import Content
from .fields import Deck, Line

#: Columns of the name of a material or a body.
LABEL = 24


def alone(row: Line) -> str:
    """A name that is alone on its line."""
    name = row.name()
    row.nothing_after(32)
    return name


def condition_head(deck: Deck, content: Content, expected: list[int | None]) -> tuple[Line, str]:
    head = deck.next()
    head.expect([head.integer(10 * (i + 1)) for i in range(6)], expected)
    name = head.name(60)
    head.nothing_after(92)
    if name in content.conditions:
        raise head.fail(f"condition {name!r} is defined twice")
    return head, name
