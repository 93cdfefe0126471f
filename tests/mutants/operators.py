"""The changes: cosmic-ray's operators, those of them that are worth a test, and units in texts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from cosmic_ray.operators.operator import Example, Operator
from cosmic_ray.plugins import get_operator, operator_names

#: An operator is replaced by one of its own family: the others end in a TypeError at once, or
#: are the same for what the code compares.
FAMILIES = (
    {"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"},
    {"BitOr", "BitAnd", "BitXor", "LShift", "RShift"},
    {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"},
    {"Is", "IsNot"},
)
#: What a decorator does is not a formula; without one a module rarely loads.
LEFT_OUT = ("core/RemoveDecorator", "core/NoOp")
#: A unit in a text, and what it becomes.
UNITS = {"mm": "m", "kPa": "MPa", "MPa": "GPa", "GPa": "MPa", "Pa": "kPa", "N": "kN", "%": "‰"}
UNIT = re.compile(r"(?<![A-Za-z])(?:mm|kPa|MPa|GPa|Pa|N)(?![A-Za-z])|(?<=[ }])%(?![A-Za-z(\d.])")


class UnitReplacer(Operator):
    """Another unit in a text: the number beside it is then wrong by a factor."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[Any, Any]]:
        if node.type in ("string", "fstring_string") and not _docstring(node):
            for _ in UNIT.finditer(node.value):
                yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        found = list(UNIT.finditer(node.value))[index]
        text = node.value
        node.value = text[: found.start()] + UNITS[found.group()] + text[found.end() :]
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example('x = "p, kPa"', 'x = "p, MPa"'),)


def _docstring(node: Any) -> bool:
    return node.parent is not None and node.parent.type in ("simple_stmt", "file_input")


@cache
def operators() -> dict[str, Operator]:
    """Name and operator of every change that is drawn."""
    found: dict[str, Operator] = {"units": UnitReplacer()}
    for name in sorted(operator_names()):
        operator = get_operator(name)
        words = name.rpartition("/")[2].split("_")
        pair = {*words[1:]} if len(words) == 3 and words[0].startswith("Replace") else set()
        apart = bool(pair) and not any(pair <= family for family in FAMILIES)
        if name not in LEFT_OUT and not operator.arguments() and not apart:
            found[name] = operator()
    return found
