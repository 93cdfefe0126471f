"""Read decks as strictly as Marc does: columns, blocks, and what blocks say of one another.

Written from docs/reference/marc-deck.md and what public sources show of Marc. It shares no code
with the adapter that writes the decks, on purpose: a mistake there must not cancel out here.
In this order: plain data, columns of a line, parameters, model blocks, load cases, checks.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Exit numbers: an error in the data (public lists of Marc's), an element inside out (from memory).
DATA_ERROR, INSIDE_OUT = 13, 1005
#: Columns of a line; of the names of sets, and of materials and bodies; items a line of a list.
LONGEST, NAME, LABEL, ITEMS = 160, 32, 24, 8
#: Variable types of tables.
TIME, LOCAL_STRAIN = 1, 73
#: Degrees of freedom of a node, and state variables of HYPELA2, by element type.
DEGREES, STATES = {18: 3, 75: 6, 139: 6}, {18: 7, 75: 9, 139: 7}


class DeckError(Exception):
    """Marc would not run this deck."""

    def __init__(self, problem: str, line: int = 0, number: int = DATA_ERROR) -> None:
        self.problem, self.line, self.number = problem, line, number
        super().__init__(f"{problem} (line {line})" if line else problem)


@dataclass
class Parameters:
    """The parameter section; `has` are its keywords."""

    title: str = ""
    elements: int = 0
    nodes: int = 0
    type: int = 0
    states: int = 0
    has: list[str] = field(default_factory=list)


@dataclass
class Table:
    """A function, straight between its points."""

    number: int
    variable: int
    x: Array
    y: Array

    def at(self, x: float) -> float:
        return float(np.interp(x, self.x, self.y))


@dataclass
class Condition:
    """A boundary condition: kind is "fixed", "pressure" or "cavity"; table 0 is a constant.

    kind_number is the load type of a pressure; of a cavity 1 for pressure, 2 for constant mass.
    """

    name: str
    kind: str
    on: str
    values: list[float]
    tables: list[int]
    dofs: list[int] = field(default_factory=list)
    kind_number: int = 0
    line: int = 0


@dataclass
class Material:
    """kind is "nlelast" (multipliers and tables of E1, E2, nu12, G12) or "hypoelastic"."""

    kind: str
    on: str
    multipliers: list[float] = field(default_factory=list)
    tables: list[int] = field(default_factory=list)


@dataclass
class Body:
    """A contact body; a rigid one has patches (n, 4, 3) mm, and a direction and table of motion."""

    name: str
    rigid: bool
    on: str = ""
    patches: Array = field(default_factory=lambda: np.zeros((0, 4, 3)))
    table: int = 0
    direction: Array = field(default_factory=lambda: np.zeros(3))


@dataclass
class Control:
    """Relative residual AND relative correction of a converged increment, and most iterations."""

    residual: float
    correction: float
    iterations: int


@dataclass
class LoadCase:
    """Increments of `step`, the conditions that hold in them, and when they have converged."""

    title: str = ""
    conditions: list[str] = field(default_factory=list)
    increments: int = 0
    step: float = 0.0
    line: int = 0
    control: Control | None = None


@dataclass
class Content:
    """The whole deck: connectivity (elements, 4), coordinates (nodes, 3), numbers from 1."""

    parameters: Parameters
    connectivity: Integers = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    coordinates: Array = field(default_factory=lambda: np.zeros((0, 3)))
    node_sets: dict[str, Integers] = field(default_factory=dict)
    element_sets: dict[str, Integers] = field(default_factory=dict)
    tables: dict[int, Table] = field(default_factory=dict)
    material: Material = field(default_factory=lambda: Material("", ""))
    frames: list[tuple[str, Array, Array]] = field(default_factory=list)
    thickness: list[tuple[float, str]] = field(default_factory=list)
    conditions: dict[str, Condition] = field(default_factory=dict)
    gas: tuple[float, float, float] | None = None
    gas_on: str = ""
    bodies: list[Body] = field(default_factory=list)
    initial: list[str] = field(default_factory=list)
    every: int = 0
    cases: list[LoadCase] = field(default_factory=list)
    has: list[str] = field(default_factory=list)


def read_deck(path: Path) -> Content:
    """Return everything in a deck; DeckError where Marc would refuse it."""
    deck = Deck(path)
    content = Content(_parameters(deck))
    while (word := deck.next()[:20].rstrip()) != "end option":
        if word not in BLOCKS:
            raise deck.fail(f"unknown model option {deck.text.strip()!r}")
        if word in content.has and word not in ("define", "table"):
            raise deck.fail(f"{word} twice")
        if word not in ("define", "table", "loadcase", "optimize"):
            deck.nothing_after(20)
        content.has.append(word)
        BLOCKS[word](deck, content)
    deck.nothing_after(20)
    while not deck.ended:
        content.cases.append(_case(deck))
    _check(content)
    return content


class Deck:
    """The lines of a file that are no comments; the current one is cut into its columns."""

    # Fortran takes an exponent without its letter: 1.000000000000000-3.
    _REAL = re.compile(r" *([+-]?(?:\d+\.\d*|\.\d+))(?:[EeDd]([+-]?\d+)|([+-]\d+))?\Z")

    def __init__(self, path: Path) -> None:
        try:
            lines = path.read_text(encoding="ascii").splitlines()
        except UnicodeDecodeError as error:
            raise DeckError(f"byte {error.start} is not ASCII") from None
        for number, line in enumerate(lines, 1):
            if "\t" in line:
                raise DeckError("a tab", number)
            if len(line) > LONGEST:
                raise DeckError(f"{len(line)} columns, {LONGEST} at most", number)
        self.rows = [(n, line) for n, line in enumerate(lines, 1) if not line.startswith("$")]
        self.at, self.number, self.text = 0, 0, ""

    def fail(self, problem: str) -> DeckError:
        return DeckError(problem, self.number)

    @property
    def ended(self) -> bool:
        return self.at >= len(self.rows)

    @property
    def goes_on(self) -> bool:
        """The next line begins with a field, and not with a keyword."""
        return not self.ended and self.rows[self.at][1][:1] == " "

    def next(self) -> str:
        if self.ended:
            raise self.fail("the file ends here, and a block is not finished")
        self.number, self.text = self.rows[self.at]
        self.at += 1
        return self.text

    def blank(self) -> None:
        if self.next().strip():
            raise self.fail(f"expected an empty line, found {self.text.strip()!r}")

    def integer(self, end: int) -> int:
        """Return the i10 that ends in column `end`; an empty field is 0, as in Fortran."""
        text = self.text[end - 10 : end]
        if not text.strip():
            return 0
        if len(text) < 10 or not re.match(r" *[+-]?\d+\Z", text):
            raise self.fail(f"columns {end - 9} to {end}: {text!r} is not an integer in its place")
        return int(text)

    def real(self, end: int) -> float:
        """Return the e20 that ends in column `end`."""
        text = self.text[end - 20 : end]
        found = self._REAL.match(text)
        if len(text) < 20 or not found:
            raise self.fail(f"columns {end - 19} to {end}: {text!r} is not a real in its place")
        mantissa, lettered, bare = found.groups()
        return float(f"{mantissa}e{lettered or bare or 0}")

    def name(self, start: int = 0, width: int = NAME) -> str:
        """Return the name in `width` columns from `start` + 1, the last field of the line."""
        name = self.text[start : start + width].rstrip()
        if not re.match(r"[a-z0-9_]{1,32}\Z", name):
            raise self.fail(f"columns {start + 1} on: {name!r} is not a name of a-z, 0-9 and _")
        return name

    def nothing_after(self, column: int) -> None:
        if self.text[column:].strip():
            raise self.fail(f"unexpected beyond column {column}: {self.text[column:].strip()!r}")

    def fields(self, *expected: int | None, first: int = 10) -> list[int]:
        """Return the i10 of the current line from the one that ends in column `first`."""
        values = [self.integer(first + 10 * i) for i in range(len(expected))]
        return self.expect(values, expected)

    def expect(self, values: list[int], expected: tuple[int | None, ...]) -> list[int]:
        for i, (value, wanted) in enumerate(zip(values, expected, strict=True), 1):
            if wanted is not None and value != wanted:
                raise self.fail(f"field {i} is {value}, expected {wanted}")
        return values

    def integers(self, *expected: int | None) -> list[int]:
        """Return the i10 of the next line, which has exactly these fields (None: any value)."""
        if len(self.next()) < 10 * len(expected):
            raise self.fail(f"ends in column {len(self.text)}, expected {10 * len(expected)}")
        values = [self.integer(10 * (i + 1)) for i in range(len(expected))]
        self.nothing_after(10 * len(expected))
        return self.expect(values, expected)

    def reals(self, count: int) -> list[float]:
        """Return the e20 of the next line, which has exactly `count`."""
        self.next()
        values = [self.real(20 * (i + 1)) for i in range(count)]
        self.nothing_after(20 * count)
        return values

    def alone(self) -> str:
        """Return the name that is alone on the next line."""
        self.next()
        self.nothing_after(NAME)
        return self.name()

    def row(self, block: str, i: int, count: int) -> None:
        """Go to row `i` of `count` rows of a block."""
        if self.next()[:1].isalpha():
            raise self.fail(f"{block} ends after {i} of {count}")


#: Fields of a parameter, in columns 30, 40, ... (sizing: from 40); None where any integer will do.
FIXED: dict[str, tuple[int | None, ...]] = {
    "alloc": (25,), "elements": (None,), "version": (14, 1, 0, 1), "sizing": (0, None, None, 0),
    "table": (0, 0, 2, 1, 1, 0, 0, 1), "processor": (1, 1, 1, 0), "cavity": (1,), "extended": (),
    "large stra": (2, 1, 0, 0, 0, 0, 0), "follow for": (1, 0, 0), "shell sect": (5, 0, 1),
    "state vars": (None,), "all points": (),
}  # fmt: skip
ALWAYS = {"title", *FIXED} - {"follow for", "shell sect", "state vars", "cavity"}


def _parameters(deck: Deck) -> Parameters:
    found = Parameters()
    while (word := deck.next()[:10].rstrip()) != "end":
        if word in found.has:
            raise deck.fail(f"parameter {word!r} twice")
        if word not in ("title", "extended") and "extended" not in found.has:
            raise deck.fail("extended has to come before anything that has columns")
        found.has.append(word)
        if word == "title":
            found.title = deck.text[20:].strip()
            continue
        if word not in FIXED:
            raise deck.fail(f"unknown parameter {deck.text.strip()!r}")
        first, count = 40 if word == "sizing" else 30, len(FIXED[word])
        if deck.text[len(word) : first - 10].strip():
            raise deck.fail(f"columns {len(word) + 1} to {first - 10} have to be empty")
        deck.nothing_after(first - 10 + 10 * count)
        if count and len(deck.text.rstrip()) < first - 10 + 10 * count:
            raise deck.fail(f"{word}: fewer than {count} fields")
        values = deck.fields(*FIXED[word], first=first)
        if word == "sizing":
            found.elements, found.nodes = values[1:3]
            if min(values[1:3]) < 1:
                raise deck.fail("sizing without elements or nodes")
        elif word == "state vars":
            (found.states,) = values
        elif word == "elements":
            (found.type,) = values
            if found.type not in DEGREES:
                raise deck.fail(f"element type {found.type} is none of {tuple(DEGREES)}")
    deck.nothing_after(10)
    for word in sorted(ALWAYS - {*found.has}):
        raise DeckError(f"no parameter {word!r}")
    if (found.type != 18) != ("shell sect" in found.has):
        raise DeckError(f"shell sect is for shells, and elements are {found.type}")
    return found


def _solver(deck: Deck, content: Content) -> None:
    deck.integers(8, *[0] * 15)


def _optimize(deck: Deck, content: Content) -> None:
    deck.fields(11, first=30)
    deck.nothing_after(30)


def _connectivity(deck: Deck, content: Content) -> None:
    deck.integers(0, 0, 1, *[0] * 6)
    count, rows = content.parameters.elements, []
    for i in range(count):
        deck.row("connectivity", i, count)
        deck.at -= 1
        number, type_, *nodes = deck.integers(*[None] * 6)
        if number != i + 1:
            raise deck.fail(f"element {number}, expected {i + 1}")
        if type_ != content.parameters.type:
            kind = content.parameters.type
            raise deck.fail(f"element {number} is of type {type_}; elements says {kind}")
        if len(set(nodes)) < 4:
            raise deck.fail(f"element {number} has a node twice")
        _exist(deck, f"element {number}", "node", nodes, content.parameters.nodes)
        rows.append(nodes)
    content.connectivity = np.array(rows, dtype=np.int64)


def _exist(deck: Deck, where: str, kind: str, members: list[int], most: int) -> None:
    for member in members:
        if not 1 <= member <= most:
            raise deck.fail(f"{where} has {kind} {member}, which does not exist")


def _coordinates(deck: Deck, content: Content) -> None:
    count, rows = content.parameters.nodes, []
    deck.integers(3, count, 0, 1)
    for i in range(count):
        deck.row("coordinates", i, count)
        if deck.integer(10) != i + 1:
            raise deck.fail(f"node {deck.integer(10)}, expected {i + 1}")
        rows.append([deck.real(end) for end in (30, 50, 70)])
        deck.nothing_after(70)
    content.coordinates = np.array(rows)


def _define(deck: Deck, content: Content) -> None:
    kind, word = deck.text[20:40].rstrip(), deck.text[40:60].rstrip()
    if word != "set" or kind not in ("node", "element"):
        raise deck.fail(f"define {kind!r} {word!r}, expected node or element, set")
    name = deck.name(60)
    deck.nothing_after(60 + NAME)
    if name in content.node_sets or name in content.element_sets:
        raise deck.fail(f"set {name!r} is defined twice")
    members: list[int] = []
    more = True
    while more:
        words = deck.next().split()
        more = words[-1:] == ["c"]
        _members(deck, words[:-1] if more else words, members)
    p = content.parameters
    _exist(deck, f"set {name!r}", kind, members, p.nodes if kind == "node" else p.elements)
    if len(set(members)) < len(members):
        raise deck.fail(f"set {name!r} has a member twice")
    sets = content.node_sets if kind == "node" else content.element_sets
    sets[name] = np.array(sorted(members), dtype=np.int64)


def _members(deck: Deck, words: list[str], members: list[int]) -> None:
    """Add numbers, and runs `a to b`, of which at most eight make a line."""
    i = items = 0
    if not words:
        raise deck.fail("a set without members, or its last line ends in c")
    while i < len(words):
        run = words[i : i + 3]
        if not run[0].isdigit():
            raise deck.fail(f"{run[0]!r} is no member of a set")
        first = last = int(run[0])
        if run[1:2] == ["to"]:
            if len(run) < 3 or not run[2].isdigit() or int(run[2]) <= first:
                raise deck.fail(f"{' '.join(run)!r} is not a run")
            last = int(run[2])
            i += 2
        members.extend(range(first, last + 1))
        i, items = i + 1, items + 1
    if items > ITEMS:
        raise deck.fail(f"{items} items, {ITEMS} a line at most")


def _table(deck: Deck, content: Content) -> None:
    deck.name(20)
    deck.nothing_after(20 + NAME)
    number = deck.integers(None, 1, 0, 0, 2)[0]
    if number in content.tables or number < 1:
        raise deck.fail(f"table {number} is defined twice, or has no number")
    variable, count = deck.integers(None, None, 2, *[0, 0, 2] * 3)[:2]
    if variable not in (TIME, LOCAL_STRAIN):
        raise deck.fail(f"table {number}: unknown variable type {variable}")
    if count < 2:
        raise deck.fail(f"table {number} of {count} points")
    points = np.zeros((count, 2))
    for i in range(count):
        deck.row(f"table {number}", i, count)
        deck.at -= 1
        points[i] = deck.reals(2)
        if i and not points[i, 0] > points[i - 1, 0]:
            raise deck.fail(f"table {number}: {points[i, 0]:g} does not increase")
    content.tables[number] = Table(number, variable, points[:, 0], points[:, 1])


def _loadcase(deck: Deck) -> list[str]:
    """Return the conditions that a load case names."""
    deck.name(20)
    deck.nothing_after(20 + NAME)
    names: list[str] = []
    for _ in range(deck.integers(None)[0]):
        name = deck.alone()
        if name in names:
            raise deck.fail(f"condition {name!r} twice in a load case")
        names.append(name)
    return names


def _initial(deck: Deck, content: Content) -> None:
    content.initial = _loadcase(deck)


def _nlelast(deck: Deck, content: Content) -> None:
    _material_head(deck, content, 1, 2, 0, 0, 0)
    multipliers, tables = deck.reals(4), deck.integers(*[None] * 4)
    content.material = Material("nlelast", deck.alone(), multipliers, tables)


def _hypoelastic(deck: Deck, content: Content) -> None:
    _material_head(deck, content, 1, 0, 1, 0, 1)
    if deck.reals(7) != [1.0, *[0.0] * 6]:
        raise deck.fail("expected 1 and six zeros")
    deck.integers(*[0] * 7)
    content.material = Material("hypoelastic", deck.alone())


def _material_head(deck: Deck, content: Content, *expected: int) -> None:
    if content.material.kind:
        raise deck.fail("a second material")
    deck.blank()
    deck.next()
    deck.fields(*expected)
    deck.name(50, LABEL)
    if deck.integer(84) != 0:
        raise deck.fail("the field after the name has to be 0")
    deck.nothing_after(84)


def _orientation(deck: Deck, content: Content) -> None:
    for _ in range(deck.integers(None)[0]):
        if deck.next()[:10].strip() != "3d aniso":
            raise deck.fail(f"unknown kind of orientation {deck.text[:10]!r}")
        angle, *values = [deck.real(30 + 20 * i) for i in range(7)]
        deck.nothing_after(150)
        if angle != 0.0:
            raise deck.fail("the angle has to be 0")
        warp, fill = np.array(values[:3]), np.array(values[3:])
        if max(abs(np.linalg.norm(vector) - 1.0) for vector in (warp, fill)) > 1e-9:
            raise deck.fail("directions have to be unit vectors")
        if abs(warp @ fill) > 1e-6:
            raise deck.fail("warp and fill are not at right angles")
        content.frames.append((deck.alone(), warp, fill))


def _geometry(deck: Deck, content: Content) -> None:
    deck.integers(0, 0, 2)
    # The count is nowhere: a thickness begins with an integer, the next block with a keyword.
    while deck.goes_on:
        deck.integers(len(content.thickness) + 1, 8, 1, 230, 0, 0)
        deck.alone()
        thickness, *rest = deck.reals(7)
        if not thickness > 0 or any(rest):
            raise deck.fail("expected a thickness above 0 and six zeros")
        content.thickness.append((thickness, deck.alone()))
    if not content.thickness:
        raise deck.fail("geometry without a thickness")


def _condition_head(deck: Deck, content: Content, *expected: int) -> tuple[str, int]:
    """Return name and line of a condition."""
    deck.next()
    deck.fields(*expected)
    name = deck.name(60)
    deck.nothing_after(60 + NAME)
    if name in content.conditions:
        raise deck.fail(f"condition {name!r} is defined twice")
    return name, deck.number


def _fixed_disp(deck: Deck, content: Content) -> None:
    deck.blank()
    most = DEGREES[content.parameters.type]
    while deck.goes_on:
        name, line = _condition_head(deck, content, 1, 0, 0, 0, 1, 0)
        count = len(deck.next().rstrip()) // 20
        if not 1 <= count <= 6:
            raise deck.fail("expected one to six values of 20 columns")
        deck.at -= 1
        values, tables = deck.reals(count), deck.integers(*[None] * count)
        dofs = deck.integers(*[None] * count)
        for dof in dofs:
            if not 1 <= dof <= most:
                kind = content.parameters.type
                raise deck.fail(f"element {kind} has no degree of freedom {dof}")
        if sorted(set(dofs)) != dofs:
            raise deck.fail("degrees of freedom have to increase")
        deck.integers(2)
        content.conditions[name] = Condition(
            name, "fixed", deck.alone(), values, tables, dofs, line=line
        )


def _dist_loads(deck: Deck, content: Content) -> None:
    deck.blank()
    while deck.goes_on:
        name, line = _condition_head(deck, content, 1, 0, 0, 0, 0, 0)
        magnitude, *rest = deck.reals(3)
        if any(rest):
            raise deck.fail("expected the magnitude and two zeros")
        table, (kind,) = deck.integers(None, 0, 0)[0], deck.integers(None)
        deck.integers(1)
        content.conditions[name] = Condition(
            name, "pressure", deck.alone(), [magnitude], [table], [], kind, line
        )


def _post(deck: Deck, content: Content) -> None:
    content.every = deck.integers(0, 16, 17, 1, 0, 19, 20, 0, None, *[0] * 7)[8]
    if content.every < 1:
        raise deck.fail("post every 0 increments")


def _cavity(deck: Deck, content: Content) -> None:
    deck.integers(1)
    deck.integers(1, 1, 1)
    pressure, temperature, density = deck.reals(3)
    if not min(pressure, temperature, density) > 0:
        raise deck.fail("a gas needs a pressure, a temperature and a density above 0")
    content.gas, content.gas_on = (pressure, temperature, density), deck.alone()


def _cavity_load(deck: Deck, content: Content) -> None:
    if content.gas is None:
        raise deck.fail("cavity load without cavity")
    deck.blank()
    while deck.goes_on:
        name, line = _condition_head(deck, content, 1, 0, 0, 0, 0, 0)
        deck.next()
        table, kind, cavity = deck.fields(None, None, None, first=30)
        deck.nothing_after(50)
        if deck.real(20) != 1.0 or kind not in (1, 2) or cavity != 1:
            raise deck.fail("expected 1, a table, 1 (pressure) or 2 (mass), cavity 1")
        content.conditions[name] = Condition(
            name, "cavity", content.gas_on, [1.0], [table], [], kind, line
        )


def _contact(deck: Deck, content: Content) -> None:
    count = deck.integers(None, *[0] * 11)[0]
    if any(deck.reals(3)):
        raise deck.fail("expected three zeros: no friction, default distances")
    for i in range(count):
        deck.next()
        number, kind, patches = deck.fields(None, None, None)
        name = deck.name(30, LABEL)
        deck.nothing_after(30 + LABEL)
        if number != i + 1 or kind not in (0, 1):
            raise deck.fail(f"body {number} of kind {kind}, expected {i + 1} of kind 0 or 1")
        if kind == 0:
            if patches:
                raise deck.fail("a deformable body with patches")
            content.bodies.append(Body(name, False, deck.alone()))
            continue
        deck.next()
        table, direction = deck.integer(10), np.array([deck.real(30 + 20 * k) for k in range(3)])
        deck.nothing_after(70)
        if abs(np.linalg.norm(direction) - 1.0) > 1e-9:
            raise deck.fail("the path's direction is not a unit vector")
        corners = np.reshape([v for _ in range(2 * patches) for v in deck.reals(6)], (-1, 4, 3))
        content.bodies.append(Body(name, True, "", corners, table, direction))


BLOCKS: dict[str, Callable[[Deck, Content], None]] = {
    "solver": _solver, "optimize": _optimize, "connectivity": _connectivity, "table": _table,
    "coordinates": _coordinates, "define": _define, "loadcase": _initial, "nlelast": _nlelast,
    "hypoelastic": _hypoelastic, "orientation": _orientation, "geometry": _geometry,
    "fixed disp": _fixed_disp, "dist loads": _dist_loads, "post": _post, "cavity": _cavity,
    "cavity load": _cavity_load, "contact": _contact, "no print": lambda deck, content: None,
}  # fmt: skip


def _case(deck: Deck) -> LoadCase:
    """Return a load case, which ends with `continue`."""
    case, has = LoadCase(), set()
    while True:
        text = deck.next()
        word = "title" if text[:6] == "title " else text[:20].rstrip()
        if word == "continue":
            break
        if word in has:
            raise deck.fail(f"{word} twice in a load case: is a continue missing?")
        has.add(word)
        if word == "title":
            case.title = text[20:].strip()
        elif word == "loadcase":
            case.line, case.conditions = deck.number, _loadcase(deck)
        elif word == "control":
            # Convergence is judged by residual AND displacement (5), full Newton-Raphson (1).
            increments, most, *_ = deck.integers(None, None, 0, 5, 0, 1, 0, 0, 1, *[0] * 7)
            if min(increments, most) < 1:
                raise deck.fail("control without increments or iterations")
            tolerances = []
            for _ in range(2):
                tolerance, *rest = deck.reals(8)
                if not 0 < tolerance < 1 or any(rest):
                    raise deck.fail("expected a tolerance between 0 and 1, and seven zeros")
                tolerances.append(tolerance)
            case.control = Control(*tolerances, iterations=most)
        elif word == "auto load":
            case.increments = deck.integers(None, 0, 10, 0, 0)[0]
            if case.increments < 1:
                raise deck.fail("auto load of no increments")
        elif word == "time step":
            (case.step,) = deck.reals(1)
            if not case.step > 0:
                raise deck.fail("a time step has to be above 0")
        else:
            raise deck.fail(f"unknown history option {text.strip()!r}")
    deck.nothing_after(20)
    for word in ("loadcase", "control", "auto load", "time step"):
        if word not in has:
            raise deck.fail(f"a load case without {word}")
    return case


def _check(content: Content) -> None:
    """Raise DeckError for what no block can know alone, and Marc stops at."""
    needed = "solver connectivity coordinates geometry loadcase post".split()
    for word in [*needed, "fixed disp"]:
        if word not in content.has:
            raise DeckError(f"no {word}")
    if not content.material.kind:
        raise DeckError("no material")
    if not content.cases:
        raise DeckError("no load case after end option")
    _check_references(content)
    _check_load_cases(content)
    has, material = content.parameters.has, content.material
    if any(c.kind != "fixed" for c in content.conditions.values()) != ("follow for" in has):
        raise DeckError("follow for is for decks with pressure, and only for those")
    if (content.gas is not None) != ("cavity" in has):
        raise DeckError("cavity has to be in the parameters and in the model, or in neither")
    wanted = STATES[content.parameters.type] if material.kind == "hypoelastic" else 0
    if content.parameters.states != wanted:
        raise DeckError(f"state vars {content.parameters.states}, expected {wanted}")
    _check_elements(content)


def _check_references(content: Content) -> None:
    """Sets and tables that are named are there."""
    material, conditions = content.material, content.conditions.values()
    uses = [("element", material.on, material.kind)]
    uses += [("element", name, "orientation") for name, *_ in content.frames]
    uses += [("element", name, "geometry") for _, name in content.thickness]
    uses += [("element", body.on, f"body {body.name}") for body in content.bodies if not body.rigid]
    uses += [("element", content.gas_on, "cavity")] if content.gas else []
    for c in conditions:
        uses.append(("node" if c.kind == "fixed" else "element", c.on, f"condition {c.name}"))
    for kind, name, where in uses:
        if name not in (content.node_sets if kind == "node" else content.element_sets):
            raise DeckError(f"{where}: there is no {kind} set {name!r}")
    tables = [(number, TIME, f"condition {c.name}") for c in conditions for number in c.tables]
    tables += [(body.table, TIME, f"body {body.name}") for body in content.bodies if body.rigid]
    tables += [(number, LOCAL_STRAIN, "nlelast") for number in material.tables]
    for number, variable, where in tables:
        if number and number not in content.tables:
            raise DeckError(f"{where}: there is no table {number}")
        if number and content.tables[number].variable != variable:
            raise DeckError(f"{where}: table {number} is not of variable type {variable}")


def _check_load_cases(content: Content) -> None:
    """Conditions that are named are there, and two hold a degree of freedom alike."""
    named = [("before end option", 0, content.initial)]
    for title, line, names in named + [(c.title, c.line, c.conditions) for c in content.cases]:
        for name in names:
            if name not in content.conditions:
                problem = f"load case {title!r} names the boundary condition {name!r}"
                raise DeckError(f"{problem}, which is not defined", line)
    for name in content.initial:
        if content.conditions[name].kind != "fixed" or any(content.conditions[name].values):
            raise DeckError(f"condition {name!r} is not zero, and holds before the first increment")
    for case in content.cases:
        said: dict[tuple[int, int], tuple[float, int]] = {}
        for c in (content.conditions[name] for name in case.conditions):
            for dof, *value in zip(c.dofs, c.values, c.tables, strict=True) if c.dofs else ():
                for node in content.node_sets[c.on].tolist():
                    if said.setdefault((node, dof), tuple(value)) != tuple(value):
                        problem = f"node {node}, degree of freedom {dof} has two values"
                        raise DeckError(f"{problem}, one of them by {c.name!r}", c.line)


def _check_elements(content: Content) -> None:
    """Each has one thickness, frame and material, is not folded, and its frame lies in it."""
    for what, names in (
        ("thickness", [name for _, name in content.thickness]),
        ("orientation", [name for name, *_ in content.frames]),
        ("material", [content.material.on]),
    ):
        times = np.zeros(content.parameters.elements, dtype=int)
        for name in names:
            times[content.element_sets[name] - 1] += 1
        if (times != 1).any():
            bad = int(np.argmax(times != 1))
            raise DeckError(f"element {bad + 1} has its {what} {times[bad]} times, expected once")
    corner = content.coordinates[content.connectivity - 1]
    along = np.roll(corner, -1, axis=1) - corner
    turns = np.cross(along, np.roll(along, -1, axis=1))
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    inside_out = (np.einsum("enk,ek->en", turns, normal) <= 0).any(axis=1)
    if inside_out.any():
        raise DeckError(f"element {np.argmax(inside_out) + 1} is inside out", number=INSIDE_OUT)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    for name, warp, fill in content.frames:
        if (unit[content.element_sets[name] - 1] @ np.cross(warp, fill) < 0.9).any():
            raise DeckError(f"orientation {name!r}: the fill is not a quarter turn from the warp")
