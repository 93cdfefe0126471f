"""Blocks of the bent cylinder: the cavity, its loads, contact."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .content import Body, Condition, Content
from .fields import Deck, Line
from .rows import LABEL, alone, condition_head


def _cavity(deck: Deck, content: Content, line: Line) -> None:
    row = deck.next()
    row.expect(row.integers(1), [1])
    row = deck.next()
    row.expect(row.integers(3), [1, 1, 1])
    row = deck.next()
    pressure, temperature, density = row.reals(3)
    if not min(pressure, temperature, density) > 0:
        raise row.fail("a gas needs a pressure, a temperature and a density above 0")
    content.gas, content.gas_on = (pressure, temperature, density), alone(deck.next())


def _cavity_load(deck: Deck, content: Content, line: Line) -> None:
    if content.gas is None:
        raise line.fail("cavity load without cavity")
    deck.blank()
    while not deck.ended and deck.peek().text[:1] == " ":
        head, name = condition_head(deck, content, [1, 0, 0, 0, 0, 0])
        row = deck.next()
        values = [row.integer(30 + 10 * i) for i in range(3)]
        row.nothing_after(50)
        if row.real(20) != 1.0 or values[1] not in (1, 2) or values[2] != 1:
            raise row.fail("expected 1, a table, 1 (pressure) or 2 (mass), cavity 1")
        content.conditions[name] = Condition(
            name, "cavity", content.gas_on, [1.0], [values[0]], kind_number=values[1],
            line=head.number,
        )  # fmt: skip


def _contact(deck: Deck, content: Content, line: Line) -> None:
    head = deck.next()
    count, *rest = head.integers(12)
    head.expect(rest, [0] * 11)
    row = deck.next()
    if any(row.reals(3)):
        raise row.fail("expected three zeros: no friction, default distances")
    for i in range(count):
        row = deck.next()
        number, kind, patches = (row.integer(10 * (k + 1)) for k in range(3))
        name = row.name(30, LABEL)
        row.nothing_after(30 + LABEL)
        if number != i + 1 or kind not in (0, 1):
            raise row.fail(f"body {number} of kind {kind}, expected {i + 1} of kind 0 or 1")
        if kind == 0:
            if patches:
                raise row.fail("a deformable body with patches")
            content.bodies.append(Body(name, False, alone(deck.next())))
            continue
        row = deck.next()
        table, direction = row.integer(10), [row.real(30 + 20 * k) for k in range(3)]
        row.nothing_after(70)
        if abs(np.linalg.norm(direction) - 1.0) > 1e-9:
            raise row.fail("the path's direction is not a unit vector")
        corners = [v for _ in range(2 * patches) for v in deck.next().reals(6)]
        body = Body(name, True, "", np.reshape(corners, (patches, 4, 3)), table)
        body.direction = np.array(direction)
        content.bodies.append(body)


VESSEL_BLOCKS: dict[str, Callable[[Deck, Content, Line], None]] = {
    "cavity": _cavity,
    "cavity load": _cavity_load,
    "contact": _contact,
}
