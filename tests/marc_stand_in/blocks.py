"""Blocks of the model section beside mesh, sets and tables."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .content import Condition, Content, Material
from .fields import Deck, Line
from .rows import LABEL, alone, condition_head
from .vessel import VESSEL_BLOCKS

#: Degrees of freedom of a node by element type.
DEGREES = {18: 3, 75: 6, 139: 6}


def loadcase(deck: Deck, line: Line) -> list[str]:
    """The conditions that a load case names."""
    line.name(20)
    line.nothing_after(52)
    (count,) = deck.next().integers(1)
    names = []
    for _ in range(count):
        row = deck.next()
        names.append(alone(row))
        if names[-1] in names[:-1]:
            raise row.fail(f"condition {names[-1]!r} twice in a load case")
    return names


def _nlelast(deck: Deck, content: Content, line: Line) -> None:
    name = _material_head(deck, content, line, [1, 2, 0, 0, 0])
    multipliers = deck.next().reals(4)
    tables = deck.next().integers(4)
    content.material = Material("nlelast", name, alone(deck.next()), multipliers, tables)


def _hypoelastic(deck: Deck, content: Content, line: Line) -> None:
    name = _material_head(deck, content, line, [1, 0, 1, 0, 1])
    row = deck.next()
    if row.reals(7) != [1.0, *[0.0] * 6]:
        raise row.fail("expected 1 and six zeros")
    row = deck.next()
    row.expect(row.integers(7), [0] * 7)
    content.material = Material("hypoelastic", name, alone(deck.next()))


def _material_head(deck: Deck, content: Content, line: Line, expected: list[int | None]) -> str:
    if content.material is not None:
        raise line.fail("a second material")
    deck.blank()
    head = deck.next()
    head.expect([head.integer(10 * (i + 1)) for i in range(5)], expected)
    name = head.name(50, LABEL)
    if head.integer(84) != 0:
        raise head.fail("the field after the name has to be 0")
    head.nothing_after(84)
    return name


def _orientation(deck: Deck, content: Content, line: Line) -> None:
    (count,) = deck.next().integers(1)
    for _ in range(count):
        row = deck.next()
        if row.text[:10].strip() != "3d aniso":
            raise row.fail(f"unknown kind of orientation {row.text[:10]!r}")
        values = [row.real(30 + 20 * i) for i in range(7)]
        row.nothing_after(150)
        if values[0] != 0.0:
            raise row.fail("the angle has to be 0")
        warp, fill = np.array(values[1:4]), np.array(values[4:7])
        for vector in (warp, fill):
            if abs(np.linalg.norm(vector) - 1.0) > 1e-9:
                raise row.fail("directions have to be unit vectors")
        if abs(warp @ fill) > 1e-6:
            raise row.fail("warp and fill are not at right angles")
        content.frames.append((alone(deck.next()), warp, fill))


def _geometry(deck: Deck, content: Content, line: Line) -> None:
    head = deck.next()
    head.expect(head.integers(3), [0, 0, 2])
    # The count is nowhere: a thickness begins with an integer, the next block with a keyword.
    while not deck.ended and deck.peek().text[:1] == " ":
        row = deck.next()
        values = row.integers(6)
        row.expect(values, [len(content.thickness) + 1, 8, 1, 230, 0, 0])
        alone(deck.next())
        row = deck.next()
        thickness, *rest = row.reals(7)
        if not thickness > 0 or any(rest):
            raise row.fail("expected a thickness above 0 and six zeros")
        content.thickness.append((thickness, alone(deck.next())))
    if not content.thickness:
        raise line.fail("geometry without a thickness")


def _fixed_disp(deck: Deck, content: Content, line: Line) -> None:
    deck.blank()
    while not deck.ended and deck.peek().text[:1] == " ":
        head, name = condition_head(deck, content, [1, 0, 0, 0, 1, 0])
        row = deck.next()
        count = len(row.text.rstrip()) // 20
        if not 1 <= count <= 6:
            raise row.fail("expected one to six values of 20 columns")
        values, tables = row.reals(count), deck.next().integers(count)
        row = deck.next()
        dofs = row.integers(count)
        most = DEGREES[content.parameters.type]
        for dof in dofs:
            if not 1 <= dof <= most:
                raise row.fail(f"element {content.parameters.type} has no degree of freedom {dof}")
        if sorted(set(dofs)) != dofs:
            raise row.fail("degrees of freedom have to increase")
        row = deck.next()
        row.expect(row.integers(1), [2])
        content.conditions[name] = Condition(
            name, "fixed", alone(deck.next()), values, tables, dofs, line=head.number
        )


def _dist_loads(deck: Deck, content: Content, line: Line) -> None:
    deck.blank()
    while not deck.ended and deck.peek().text[:1] == " ":
        head, name = condition_head(deck, content, [1, 0, 0, 0, 0, 0])
        row = deck.next()
        magnitude, *rest = row.reals(3)
        if any(rest):
            raise row.fail("expected the magnitude and two zeros")
        table, *others = (row := deck.next()).integers(3)
        row.expect(others, [0, 0])
        (kind,) = deck.next().integers(1)
        row = deck.next()
        row.expect(row.integers(1), [1])
        content.conditions[name] = Condition(
            name, "pressure", alone(deck.next()), [magnitude], [table], kind_number=kind,
            line=head.number,
        )  # fmt: skip


def _no_print(deck: Deck, content: Content, line: Line) -> None:
    """Nothing follows."""


def _post(deck: Deck, content: Content, line: Line) -> None:
    row = deck.next()
    values = row.integers(16)
    row.expect(values, [0, 16, 17, 1, 0, 19, 20, 0, None, *[0] * 7])
    content.every = values[8]
    if content.every < 1:
        raise row.fail("post every 0 increments")


BLOCKS: dict[str, Callable[[Deck, Content, Line], None]] = {
    "nlelast": _nlelast,
    "hypoelastic": _hypoelastic,
    "orientation": _orientation,
    "geometry": _geometry,
    "fixed disp": _fixed_disp,
    "dist loads": _dist_loads,
    "no print": _no_print,
    "post": _post,
    **VESSEL_BLOCKS,
}
