"""What no block can know alone: names that are used, sets that are missing, supports."""

from __future__ import annotations

import numpy as np

from .content import Condition, Content
from .fields import DeckError
from .model import LOCAL_STRAIN, TIME

NEEDED = ("solver", "connectivity", "coordinates", "geometry", "fixed disp", "loadcase", "post")
#: Exit number for an element that is inside out (from memory).
INSIDE_OUT = 1005


def check(content: Content) -> None:
    """Raise DeckError for what Marc would stop at before the first increment."""
    for word in NEEDED:
        if word not in content.has:
            raise DeckError(f"no {word}")
    if content.material is None:
        raise DeckError("no material")
    if not content.cases:
        raise DeckError("no load case after end option")
    _uses_of_sets(content)
    _tables(content)
    _load_cases(content)
    _parameters(content)
    _sections(content)
    _shapes(content)


def _uses_of_sets(content: Content) -> None:
    material = content.material
    assert material is not None
    uses = [("element", material.on, material.kind)]
    uses += [("element", name, "orientation") for name, *_ in content.frames]
    uses += [("element", name, "geometry") for _, name in content.thickness]
    uses += [("element", body.on, f"body {body.name}") for body in content.bodies if not body.rigid]
    uses += [("element", content.gas_on, "cavity")] if content.gas else []
    for condition in content.conditions.values():
        kind = "node" if condition.kind == "fixed" else "element"
        uses.append((kind, condition.on, f"condition {condition.name}"))
    for kind, name, where in uses:
        sets = content.node_sets if kind == "node" else content.element_sets
        if name not in sets:
            raise DeckError(f"{where}: there is no {kind} set {name!r}")


def _tables(content: Content) -> None:
    uses: list[tuple[int, int, str]] = []
    for c in content.conditions.values():
        uses += [(number, TIME, f"condition {c.name}") for number in c.tables]
    uses += [(body.table, TIME, f"body {body.name}") for body in content.bodies if body.rigid]
    if content.material and content.material.kind == "nlelast":
        uses += [(number, LOCAL_STRAIN, "nlelast") for number in content.material.tables]
    for number, variable, where in uses:
        if number == 0:
            continue
        if number not in content.tables:
            raise DeckError(f"{where}: there is no table {number}")
        if content.tables[number].variable != variable:
            raise DeckError(f"{where}: table {number} is not of variable type {variable}")


def _load_cases(content: Content) -> None:
    named = [("before end option", 0, content.initial or [])]
    named += [(case.title, case.line, case.conditions) for case in content.cases]
    for title, line, conditions in named:
        for name in conditions:
            if name not in content.conditions:
                problem = f"load case {title!r} names the boundary condition {name!r}"
                raise DeckError(f"{problem}, which is not defined", line)
    for name in content.initial or []:
        condition = content.conditions[name]
        if condition.kind != "fixed" or any(condition.values):
            raise DeckError(f"condition {name!r} is not zero, and holds before the first increment")
    for case in content.cases:
        _held_once(content, [content.conditions[name] for name in case.conditions])


def _held_once(content: Content, conditions: list[Condition]) -> None:
    """Two conditions may hold a degree of freedom if they say the same of it."""
    said: dict[tuple[int, int], tuple[float, int]] = {}
    for c in (c for c in conditions if c.kind == "fixed"):
        for dof, value, table in zip(c.dofs, c.values, c.tables, strict=True):
            for node in content.node_sets[c.on].tolist():
                if said.setdefault((node, dof), (value, table)) != (value, table):
                    problem = f"node {node}, degree of freedom {dof} has two values"
                    raise DeckError(f"{problem}, one of them by {c.name!r}", c.line)


def _parameters(content: Content) -> None:
    has, material = content.parameters.has, content.material
    assert material is not None
    pressed = any(c.kind != "fixed" for c in content.conditions.values())
    if pressed != ("follow for" in has):
        raise DeckError("follow for is for decks with pressure, and only for those")
    if (content.gas is not None) != ("cavity" in has):
        raise DeckError("cavity has to be in the parameters and in the model, or in neither")
    states = {18: 7, 139: 7, 75: 9}[content.parameters.type]
    wanted = states if material.kind == "hypoelastic" else 0
    if content.parameters.states != wanted:
        raise DeckError(f"state vars {content.parameters.states}, expected {wanted}")


def _sections(content: Content) -> None:
    """Every element has one thickness, one frame of its fabric and the material."""
    count, material = content.parameters.elements, content.material
    assert material is not None
    for what, names in (
        ("thickness", [name for _, name in content.thickness]),
        ("orientation", [name for name, *_ in content.frames]),
        ("material", [material.on]),
    ):
        times = np.zeros(count, dtype=int)
        for name in names:
            times[content.element_sets[name] - 1] += 1
        if (times != 1).any():
            bad = int(np.argmax(times != 1))
            raise DeckError(f"element {bad + 1} has its {what} {times[bad]} times, expected once")


def _shapes(content: Content) -> None:
    """No element is folded; frames lie in their elements, the fill a quarter turn from the warp."""
    assert content.connectivity is not None and content.coordinates is not None
    corner = content.coordinates[content.connectivity - 1]
    along = np.roll(corner, -1, axis=1) - corner
    turns = np.cross(along, np.roll(along, -1, axis=1))
    normal = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    inside_out = (np.einsum("enk,ek->en", turns, normal) <= 0).any(axis=1)
    if inside_out.any():
        bad = int(np.argmax(inside_out)) + 1
        raise DeckError(f"element {bad} is inside out", number=INSIDE_OUT)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    for name, warp, fill in content.frames:
        of = unit[content.element_sets[name] - 1]
        if (np.cross(warp, fill) @ of.T < 0.9).any():
            raise DeckError(f"orientation {name!r}: the fill is not a quarter turn from the warp")
