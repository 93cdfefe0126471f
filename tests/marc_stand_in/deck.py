"""Read decks as strictly as Marc does: columns, blocks, and what blocks say of one another.

Written from docs/reference/marc-deck.md and what public sources show of Marc. It shares no code
with the adapter that writes the decks, on purpose: a mistake there must not cancel out here.
"""

import re
from collections import deque, namedtuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: Exit numbers: an error in the data (public lists of Marc's), an element inside out (from memory).
DATA_ERROR, INSIDE_OUT = 13, 1005
#: Columns of a line, items a line of a set; variable types of tables.
LONGEST, ITEMS, TIME, LOCAL_STRAIN = 160, 8, 1, 73
#: Degrees of freedom of a node, and state variables of HYPELA2, by element type.
DEGREES, STATES = {18: 3, 75: 6, 139: 6}, {18: 7, 75: 9, 139: 7}
#: Layouts of parameters.
PARAMETERS = {
    "alloc": "t20 25", "elements": "t20 i", "version": "t20 14 1 0 1", "sizing": "t30 0 i i 0",
    "table": "t20 0 0 2 1 1 0 0 1", "processor": "t20 1 1 1 0", "cavity": "t20 1",
    "extended": "t20", "large stra": "t20 2 1 0*5", "follow for": "t20 1 0 0",
    "shell sect": "t20 5 0 1", "state vars": "t20 i", "all points": "t20", "title": "t20 t140",
}  # fmt: skip
ALWAYS = {*PARAMETERS} - {"follow for", "shell sect", "state vars", "cavity"}


class DeckError(Exception):
    def __init__(self, problem, line=0, number=DATA_ERROR):
        self.problem, self.line, self.number = problem, line, number
        super().__init__(f"{problem} (line {line})" if line else problem)


#: A function, straight between its points: x, y.
Table = namedtuple("Table", "variable x y")
#: A boundary condition: kind is "fixed", "pressure" or "cavity"; table 0 is a constant. load: the
#: load type of a pressure; of a cavity 1 for pressure, 2 for constant mass.
Condition = namedtuple("Condition", "kind on values tables dofs load line")
#: A contact body; a rigid one has patches (n, 4, 3) mm, and a direction and table of motion.
Body = namedtuple("Body", "name rigid on patches table direction")
#: Relative residual AND relative correction of a converged increment, and most iterations.
Control = namedtuple("Control", "residual correction iterations")
#: Increments of `step`, the conditions that hold in them, and when they have converged.
LoadCase = namedtuple("LoadCase", "title line conditions control increments step")


def level(table, at):
    return np.interp(at, table.x, table.y)


class Content:
    """The whole deck: connectivity (elements, 4), coordinates (nodes, 3), numbers from 1.

    law : "nlelast" (multipliers, and numbers of tables, of E1, E2, nu12, G12) or "hypoelastic".
    """

    def __init__(self, size, has):
        (self.title,), self.parameters, self.has = size["title"], has, list[str]()
        self.elements, self.nodes, self.type = size["sizing"] + size["elements"]
        self.states = sum(size.get("state vars", []))
        self.connectivity = np.zeros((self.elements, 4), dtype=np.int64)
        self.coordinates = np.zeros((self.nodes, 3))
        self.sets: dict[str, dict[str, NDArray[np.int64]]] = {"node": {}, "element": {}}
        self.tables: dict[int, Table] = {}
        self.law, self.law_on, self.multipliers, self.moduli = "", "", list[float](), list[int]()
        self.frames: list[tuple[str, Array, Array]] = []
        self.thickness: list[tuple[float, str]] = []
        self.conditions: dict[str, Condition] = {}
        self.gas, self.gas_on, self.bodies = list[float](), "", list[Body]()
        self.every, self.initial, self.cases = 0, list[str](), list[LoadCase]()


class Deck:
    """The lines of a file that are no comments, taken apart by layouts.

    A layout names the fields of a line: `i` an integer in 10 columns, `r` a real in 20, a number
    that has to be there (`8` in 10 columns, `0.` in 20), `t30` text in 30, `label` a name in 24,
    `name` one of at most 32 at the end; `r*3` is three of them.
    """

    def __init__(self, path):
        text = path.read_bytes()
        if not text.isascii() or b"\t" in text:
            raise DeckError("a tab, or a byte that is not ASCII")
        lines = list(enumerate(text.decode().splitlines(), 1))
        for number, line in lines:
            if len(line) > LONGEST:
                raise DeckError(f"more than {LONGEST} columns", number)
        self.lines = deque((n, line) for n, line in lines if not line.startswith("$"))
        self.number, self.text = 0, ""

    def fail(self, problem):
        return DeckError(problem, self.number)

    @property
    def coming(self):
        return self.lines[0][1] if self.lines else ""

    def next(self):
        if not self.lines:
            raise self.fail("the file ends here, and a block is not finished")
        self.number, self.text = self.lines.popleft()
        return self.text

    def row(self, layout):
        self.next()
        return self.fields(layout)

    def rows(self, block, count, layout):
        for i in range(count):
            if self.coming[:1].isalpha():
                raise self.fail(f"{block} ends after {i} of {count}")
            yield self.row(layout)

    def fields(self, layout):
        found, end = [], 0
        for kind, times in re.findall(r"(\S+?)(?:\*(\d+))?(?= |$)", layout):
            for _ in range(int(times or 1)):
                start = end
                width = {"name": 32, "label": 24}.get(
                    kind, 20 if kind == "r" or "." in kind else 10
                )
                end += int(kind[1:]) if kind[0] == "t" else width
                value = self._value(kind, self.text[start:end], end - start)
                if value is None or not (kind[0].isalpha() or value == float(kind)):
                    seen = self.text[start:end]
                    raise self.fail(f"columns {start + 1} to {end}: {seen!r}, expected {kind}")
                if kind[0].isalpha():
                    found.append(value)
        if self.text[end:].strip():
            raise self.fail(f"unexpected beyond column {end}: {self.text[end:].strip()!r}")
        return found

    @staticmethod
    def _value(kind, text, width):
        """Return what a field holds; None where that is not of its kind."""
        if kind[0] == "t":
            return text.rstrip()
        if kind in ("name", "label"):
            return text.rstrip() if re.match(r"[a-z0-9_]{1,32} *\Z", text) else None
        if len(text) < width:
            return None
        if width == 10:
            return int(text.strip() or 0) if re.match(r" *([+-]?\d+)?\Z", text) else None
        # Fortran takes an exponent without its letter: 1.000000000000000-3.
        real = r" *([+-]?(?:\d+\.\d*|\.\d+))(?:[EeDd]?([+-]\d+)|[EeDd](\d+))?\Z"
        if not (match := re.match(real, text)):
            return None
        return float(f"{match[1]}e{match[2] or match[3] or 0}")

    def members(self, where, members, most):
        if len(set(members)) < len(members) or not 1 <= min(members) <= max(members) <= most:
            raise self.fail(f"{where} has a member twice, or one that does not exist: {members}")


def read_deck(path):
    deck = Deck(path)
    content = _parameters(deck)
    while (word := deck.next()[:20].rstrip()) != "end option":
        if word in content.has and word not in ("define", "table"):
            raise deck.fail(f"{word} twice")
        content.has.append(word)
        _block(deck, content, word)
    while deck.coming:
        content.cases.append(_case(deck))
    _check(content)
    return content


def _parameters(deck):
    found = {}
    while (word := deck.next()[:10].rstrip()) != "end":
        if word in found or word not in PARAMETERS:
            raise deck.fail(f"unknown parameter, or twice: {deck.text.strip()!r}")
        if word not in ("title", "extended") and "extended" not in found:
            raise deck.fail("extended has to come before anything that has columns")
        keyword, *found[word] = deck.fields(PARAMETERS[word])
        if keyword != word:
            raise deck.fail(f"columns behind {word!r} have to be empty")
    deck.fields("t10")
    if missing := sorted(ALWAYS - {*found}):
        raise DeckError(f"no parameter {missing}")
    (kind,), sizes = found["elements"], found["sizing"]
    if kind not in DEGREES or min(sizes) < 1 or (kind != 18) != ("shell sect" in found):
        raise DeckError(f"type {kind} is none of {tuple(DEGREES)}, or of no size, or shell sect")
    return Content(found, list(found))


def _block(deck, content, word):
    p, more = content, {"define": "t20 t20 name", "table": "name", "loadcase": "name"}
    head = deck.fields(f"t20 {'11' if word == 'optimize' else more.get(word, '')}")[1:]
    match word:
        case "optimize" | "no print":
            pass
        case "solver":
            deck.row("8 0*15")
        case "connectivity":
            deck.row("0 0 1 0*6")
            for n, (number, kind, *nodes) in enumerate(deck.rows(word, p.elements, "i*6"), 1):
                if (number, kind) != (n, p.type):
                    raise deck.fail(f"element {number} of type {kind}, expected {n} of {p.type}")
                deck.members(f"element {number}", nodes, p.nodes)
                p.connectivity[n - 1] = nodes
        case "coordinates":
            deck.row(f"3 {p.nodes} 0 1")
            for n, (number, *point) in enumerate(deck.rows(word, p.nodes, "i r*3"), 1):
                if number != n:
                    raise deck.fail(f"node {number}, expected {n}")
                p.coordinates[n - 1] = point
        case "define":
            kind, what, name = head
            if what != "set" or any(name in sets for sets in p.sets.values()):
                raise deck.fail(f"define {what!r}, or set {name!r} is defined twice")
            members = set_members(deck)
            most = {"node": p.nodes, "element": p.elements}[kind]
            deck.members(f"set {name!r}", members, most)
            p.sets[kind][name] = np.array(sorted(members), dtype=np.int64)
        case "table":
            (number,) = deck.row("i 1 0 0 2")
            variable, count = deck.row("i i 2 0 0 2 0 0 2 0 0 2")
            if number in p.tables or variable not in (TIME, LOCAL_STRAIN) or count < 2:
                raise deck.fail(f"table {number} is defined twice, or has no points or variable")
            x, y = np.array(list(deck.rows(f"table {number}", count, "r r"))).T
            if not (np.diff(x) > 0).all():
                raise deck.fail(f"table {number} does not increase")
            p.tables[number] = Table(variable, x, y)
        case "loadcase":
            p.initial = _names(deck)
        case "nlelast" | "hypoelastic":
            deck.row("")
            if p.law:
                raise deck.fail("a second material")
            if word == "nlelast":
                deck.row("1 2 0 0 0 label 0")
                p.multipliers, p.moduli = deck.row("r*4"), deck.row("i*4")
            else:
                for layout in ("1 0 1 0 1 label 0", "1. 0.*6", "0*7"):
                    deck.row(layout)
            p.law, p.law_on = word, *deck.row("name")
        case "orientation":
            for _ in range(*deck.row("i")):
                kind, *values = deck.row("t10 0. r*6")
                warp, fill = np.reshape(values, (2, 3))
                off = max(abs(np.linalg.norm(v) - 1.0) for v in (warp, fill))
                if kind != "3d aniso" or off > 1e-9 or abs(warp @ fill) > 1e-6:
                    raise deck.fail("expected 3d aniso and two unit vectors at right angles")
                p.frames.append((*deck.row("name"), warp, fill))
        case "geometry":
            deck.row("0 0 2")
            # The count is nowhere: a thickness begins with an integer, a block with a keyword.
            while deck.coming[:1] == " ":
                deck.row(f"{len(p.thickness) + 1} 8 1 230 0 0")
                deck.row("name")
                p.thickness.append((*deck.row("r 0.*6"), *deck.row("name")))
                if not p.thickness[-1][0] > 0:
                    raise deck.fail("expected a thickness above 0")
        case "fixed disp":
            for name, line in _each_condition(deck, p, "1 0 0 0 1 0 name"):
                count = len(deck.coming.rstrip()) // 20
                values, tables, dofs = (deck.row(f"{kind}*{count}") for kind in "rii")
                if not dofs or dofs != [n for n in range(1, DEGREES[p.type] + 1) if n in dofs]:
                    raise deck.fail(f"element {p.type} has no degrees of freedom {dofs}")
                deck.row("2")
                (on,) = deck.row("name")
                p.conditions[name] = Condition("fixed", on, values, tables, dofs, 0, line)
        case "dist loads":
            for name, line in _each_condition(deck, p, "1 0*5 name"):
                values, tables, (load,) = deck.row("r 0. 0."), deck.row("i 0 0"), deck.row("i")
                deck.row("1")
                (on,) = deck.row("name")
                p.conditions[name] = Condition("pressure", on, values, tables, [], load, line)
        case "post":
            (p.every,) = deck.row("0 16 17 1 0 19 20 0 i 0*7")
        case "cavity":
            deck.row("1")
            deck.row("1 1 1")
            p.gas, (p.gas_on,) = deck.row("r*3"), deck.row("name")
            if not min(p.gas) > 0:
                raise deck.fail("a gas needs a pressure, a temperature and a density above 0")
        case "cavity load":
            for name, line in _each_condition(deck, p, "1 0*5 name"):
                table, kind = deck.row("1. i i 1")
                p.conditions[name] = Condition("cavity", p.gas_on, [1.0], [table], [], kind, line)
        case "contact":
            (count,) = deck.row("i 0*11")
            deck.row("0.*3")  # no friction, default distances
            for i in range(1, count + 1):
                rigid, patches, name = deck.row(f"{i} i i label")
                on, table, direction = "", 0, [1.0, 0.0, 0.0]
                if rigid:
                    table, *direction = deck.row("i r*3")
                else:
                    (on,) = deck.row("name")
                if bool(patches) != rigid or abs(np.linalg.norm(direction) - 1.0) > 1e-9:
                    raise deck.fail(f"body of kind {rigid}, {patches} patches along {direction}")
                patches = np.reshape([deck.row("r*6") for _ in range(2 * patches)], (-1, 4, 3))
                p.bodies.append(Body(name, bool(rigid), on, patches, table, np.array(direction)))
        case _:
            raise deck.fail(f"unknown model option {deck.text.strip()!r}")


def set_members(deck):
    """Return numbers and runs `a to b`, at most eight a line; a line that goes on ends in c."""
    members = []
    more = True
    while more:
        more = deck.next().split()[-1:] == ["c"]
        items = re.findall(r"(\d+)(?: +to +(\d+))?(?= |$)", deck.text)
        whole = re.match(r"(?: *\d+(?: +to +\d+)?)+(?: +c)? *\Z", deck.text)
        if not whole or len(items) > ITEMS or any(b and int(b) <= int(a) for a, b in items):
            raise deck.fail(f"expected 1 to {ITEMS} members of a set, found {deck.text.strip()!r}")
        members.extend(n for a, b in items for n in range(int(a), int(b or a) + 1))
    return members


def _names(deck):
    names = [deck.row("name")[0] for _ in range(*deck.row("i"))]
    if len(set(names)) < len(names):
        raise deck.fail("a condition twice in a load case")
    return names


def _each_condition(deck, content, head):
    deck.row("")
    while deck.coming[:1] == " ":
        (name,) = deck.row(head)
        if name in content.conditions:
            raise deck.fail(f"condition {name!r} is defined twice")
        yield name, deck.number


def _case(deck):
    found = {"title": ""}
    while (word := deck.next()[:20].rstrip()) != "continue":
        word = "title" if word.startswith("title ") else word
        if found.get(word):
            raise deck.fail(f"{word} twice in a load case: is a continue missing?")
        match word:
            case "title":
                found[word] = deck.text[20:].strip()
            case "loadcase":
                deck.fields("t20 name")
                found[word] = deck.number, _names(deck)
            case "control":
                # Convergence is judged by residual AND displacement (5), full Newton-Raphson (1).
                increments, most = deck.row("i i 0 5 0 1 0 0 1 0*7")
                found[word] = Control(*deck.row("r 0.*7"), *deck.row("r 0.*7"), most)
                if min(increments, most) < 1 or not all(0 < t < 1 for t in found[word][:2]):
                    raise deck.fail("control without increments, iterations or tolerances")
            case "auto load" | "time step":
                (found[word],) = deck.row("i 0 10 0 0" if word == "auto load" else "r")
                if not found[word] > 0:
                    raise deck.fail(f"no increments, or {word} not above 0")
            case _:
                raise deck.fail(f"unknown history option {deck.text.strip()!r}")
    deck.fields("t20")
    if missing := {"loadcase", "control", "auto load", "time step"} - {*found}:
        raise deck.fail(f"a load case without {missing}")
    rest = found["control"], found["auto load"], found["time step"]
    return LoadCase(found["title"], *found["loadcase"], *rest)


def _check(content):
    """Raise DeckError for what no block can know alone, and Marc stops at."""
    for word in ("solver", "connectivity", "coordinates", "geometry", "loadcase", "post"):
        if word not in content.has:
            raise DeckError(f"no {word}")
    if not (content.law and content.cases and "fixed disp" in content.has and content.every > 0):
        raise DeckError(
            "no material, no load case after end option, no fixed disp, or post every 0"
        )
    _check_references(content)
    _check_load_cases(content)
    has = content.parameters
    if any(c.kind != "fixed" for c in content.conditions.values()) != ("follow for" in has):
        raise DeckError("follow for is for decks with pressure, and only for those")
    if bool(content.gas) != ("cavity" in has):
        raise DeckError("cavity has to be in the parameters and in the model, or in neither")
    wanted = STATES[content.type] if content.law == "hypoelastic" else 0
    if content.states != wanted:
        raise DeckError(f"state vars {content.states}, expected {wanted}")
    _check_elements(content)


def _check_references(content):
    on = [content.law_on, *(f[0] for f in content.frames), *(t[1] for t in content.thickness)]
    on += [body.on for body in content.bodies if not body.rigid]
    uses = [("element", name, content.law) for name in on + [content.gas_on] * bool(content.gas)]
    tables = [(body.table, TIME, f"body {body.name}") for body in content.bodies if body.rigid]
    tables += [(number, LOCAL_STRAIN, "nlelast") for number in content.moduli]
    for name, c in content.conditions.items():
        uses.append(("node" if c.kind == "fixed" else "element", c.on, f"condition {name}"))
        tables += [(number, TIME, f"condition {name}") for number in c.tables]
    for kind, name, where in uses:
        if name not in content.sets[kind]:
            raise DeckError(f"{where}: there is no {kind} set {name!r}")
    for number, variable, where in tables:
        if number and getattr(content.tables.get(number), "variable", None) != variable:
            raise DeckError(f"{where}: there is no table {number} of variable type {variable}")


def _check_load_cases(content):
    """Raise DeckError unless named conditions are there, and two hold a degree of freedom alike."""
    named = [("before end option", 0, content.initial)]
    for title, line, names in named + [(c.title, c.line, c.conditions) for c in content.cases]:
        if unknown := {*names} - {*content.conditions}:
            raise DeckError(f"load case {title!r} names {unknown}, which is not defined", line)
        said = {}
        for name in names:
            c = content.conditions[name]
            if line == 0 and (c.kind != "fixed" or any(c.values)):
                raise DeckError(f"condition {name!r} is not zero, and holds from the beginning")
            for dof, *value in zip(c.dofs, c.values, c.tables, strict=True) if c.dofs else ():
                for node in content.sets["node"][c.on].tolist():
                    if said.setdefault((node, dof), tuple(value)) != tuple(value):
                        problem = f"node {node}, degree of freedom {dof} has two values"
                        raise DeckError(f"{problem}, one of them by {name!r}", c.line)


def _check_elements(content):
    """Raise DeckError unless each has one thickness, frame and material, and lies flat in both."""
    sets = content.sets["element"]
    for what, names in (
        ("thickness", [name for _, name in content.thickness]),
        ("orientation", [name for name, *_ in content.frames]),
        ("material", [content.law_on]),
    ):
        times = sum(np.bincount(sets[n], minlength=content.elements + 1) for n in names)
        if (np.atleast_1d(times)[1:] != 1).any() or not names:
            raise DeckError(f"an element has its {what} not once")
    corner = content.coordinates[content.connectivity - 1]
    along = np.roll(corner, -1, axis=1) - corner
    turns = np.cross(along, np.roll(along, -1, axis=1))
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    inside_out = (np.einsum("enk,ek->en", turns, normal) <= 0).any(axis=1)
    if inside_out.any():
        raise DeckError(f"element {np.argmax(inside_out) + 1} is inside out", number=INSIDE_OUT)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    for name, warp, fill in content.frames:
        if (unit[sets[name] - 1] @ np.cross(warp, fill) < 0.9).any():
            raise DeckError(f"orientation {name!r}: the fill is not a quarter turn from the warp")
