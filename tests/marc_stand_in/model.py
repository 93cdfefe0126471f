"""The model section up to `end option`: mesh, sets, tables; blocks.py has the others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .blocks import BLOCKS, loadcase
from .content import Content, Table
from .fields import Deck, Line

#: Points a line in a list of members, and variable types that a table may have.
ITEMS, TIME, LOCAL_STRAIN = 8, 1, 73


def read_model(deck: Deck, content: Content) -> None:
    """Every block until `end option`, each by the reader of its keyword."""
    readers: dict[str, Callable[[Deck, Content, Line], None]] = {
        "solver": _solver,
        "optimize": _optimize,
        "connectivity": _connectivity,
        "coordinates": _coordinates,
        "define": _define,
        "table": _table,
        "loadcase": _initial,
        **BLOCKS,
    }
    while True:
        line = deck.next()
        word = line.keyword
        if word == "end option":
            line.nothing_after(20)
            return
        if word not in readers:
            raise line.fail(f"unknown model option {line.text.strip()!r}")
        if word in content.has and word not in ("define", "table"):
            raise line.fail(f"{word} twice")
        if word not in ("define", "table", "loadcase", "optimize"):
            line.nothing_after(20)
        content.has.append(word)
        readers[word](deck, content, line)


def _solver(deck: Deck, content: Content, line: Line) -> None:
    values = deck.next()
    values.expect(values.integers(16), [8, *[0] * 15])


def _optimize(deck: Deck, content: Content, line: Line) -> None:
    if line.integer(30) != 11:
        raise line.fail(f"optimize {line.integer(30)}, expected 11")
    line.nothing_after(30)


def _connectivity(deck: Deck, content: Content, line: Line) -> None:
    head = deck.next()
    head.expect(head.integers(9), [0, 0, 1, *[0] * 6])
    count, kind = content.parameters.elements, content.parameters.type
    rows = np.zeros((count, 4), dtype=np.int64)
    for i in range(count):
        row = _row(deck, "connectivity", i, count)
        number, type_, *nodes = row.integers(6)
        if number != i + 1:
            raise row.fail(f"element {number}, expected {i + 1}")
        if type_ != kind:
            raise row.fail(f"element {number} is of type {type_}; elements says {kind}")
        if len(set(nodes)) < 4:
            raise row.fail(f"element {number} has a node twice")
        for node in nodes:
            if not 1 <= node <= content.parameters.nodes:
                raise row.fail(f"element {number} has node {node}, which does not exist")
        rows[i] = nodes
    content.connectivity = rows


def _coordinates(deck: Deck, content: Content, line: Line) -> None:
    head, count = deck.next(), content.parameters.nodes
    head.expect(head.integers(4), [3, count, 0, 1])
    rows = np.zeros((count, 3))
    for i in range(count):
        row = _row(deck, "coordinates", i, count)
        if row.integer(10) != i + 1:
            raise row.fail(f"node {row.integer(10)}, expected {i + 1}")
        rows[i] = [row.real(30), row.real(50), row.real(70)]
        row.nothing_after(70)
    content.coordinates = rows


def _row(deck: Deck, block: str, i: int, count: int) -> Line:
    row = deck.next()
    if row.text[:1].isalpha():
        raise row.fail(f"{block} ends after {i} of {count}")
    return row


def _define(deck: Deck, content: Content, line: Line) -> None:
    kind, word = line.text[20:40].rstrip(), line.text[40:60].rstrip()
    if word != "set" or kind not in ("node", "element"):
        raise line.fail(f"define {kind!r} {word!r}, expected node or element, set")
    name = line.name(60)
    line.nothing_after(60 + 32)
    if name in content.node_sets or name in content.element_sets:
        raise line.fail(f"set {name!r} is defined twice")
    members: list[int] = []
    while True:
        row = deck.next()
        words = row.text.split()
        more = words[-1:] == ["c"]
        _members(row, words[:-1] if more else words, members)
        if not more:
            break
    most = content.parameters.nodes if kind == "node" else content.parameters.elements
    for member in members:
        if not 1 <= member <= most:
            raise row.fail(f"set {name!r} has {kind} {member}, which does not exist")
    if len(set(members)) < len(members):
        raise row.fail(f"set {name!r} has a member twice")
    sets = content.node_sets if kind == "node" else content.element_sets
    sets[name] = np.array(sorted(members), dtype=np.int64)


def _members(row: Line, words: list[str], members: list[int]) -> None:
    """Numbers, and runs `a to b`, of which at most eight make a line."""
    i = items = 0
    if not words:
        raise row.fail("a set without members, or its last line ends in c")
    while i < len(words):
        run = words[i : i + 3]
        if not run[0].isdigit():
            raise row.fail(f"{run[0]!r} is no member of a set")
        first = last = int(run[0])
        if run[1:2] == ["to"]:
            if len(run) < 3 or not run[2].isdigit() or int(run[2]) <= first:
                raise row.fail(f"{' '.join(run)!r} is not a run")
            last = int(run[2])
            i += 2
        members.extend(range(first, last + 1))
        i, items = i + 1, items + 1
    if items > ITEMS:
        raise row.fail(f"{items} items, {ITEMS} a line at most")


def _table(deck: Deck, content: Content, line: Line) -> None:
    line.name(20)
    line.nothing_after(52)
    head = deck.next()
    number, *rest = head.integers(5)
    head.expect(rest, [1, 0, 0, 2])
    if number in content.tables or number < 1:
        raise head.fail(f"table {number} is defined twice, or has no number")
    axis = deck.next()
    values = axis.integers(12)
    variable, count = values[:2]
    axis.expect(values, [None, None, 2, *[0, 0, 2] * 3])
    if variable not in (TIME, LOCAL_STRAIN):
        raise axis.fail(f"table {number}: unknown variable type {variable}")
    if count < 2:
        raise axis.fail(f"table {number} of {count} points")
    points = np.zeros((count, 2))
    for i in range(count):
        row = _row(deck, f"table {number}", i, count)
        points[i] = row.reals(2)
        if i and not points[i, 0] > points[i - 1, 0]:
            raise row.fail(f"table {number}: {points[i, 0]:g} does not increase")
    content.tables[number] = Table(number, variable, points[:, 0], points[:, 1])


def _initial(deck: Deck, content: Content, line: Line) -> None:
    content.initial = loadcase(deck, line)
