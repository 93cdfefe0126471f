"""The mutants of a file, and a random set of them."""

from __future__ import annotations

import ast
import random
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

from .operators import operators

#: How a figure looks, which is judged by eye: arguments of matplotlib, also those kept in a dict.
LOOKS = {
    "alpha", "capsize", "clip_on", "dpi", "figsize", "fontsize", "framealpha", "frameon",
    "handlelength", "height_ratios", "hspace", "labelpad", "labelsize", "linestyle", "linewidth",
    "linewidths", "markeredgewidth", "markerscale", "markersize", "markevery", "ncol", "ncols",
    "numticks", "pad", "rotation", "s", "shrink", "title_fontsize", "width_ratios", "wspace",
    "zorder",
}  # fmt: skip


#: Constants that hold dash patterns.
PATTERNS = {"DASHES"}
#: Functions whose numbers are nothing but size and layout.
LAYOUTS = {"new_figure", "legend_above", "add_gridspec"}
#: Arguments that forbid what correct code does not do anyway.
PROMISES = {"allow_nan", "eq", "frozen", "slots", "strict"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    file: from the repository's root; first, last: the lines of the statement it is in;
    before, after: the line of the change; source: the whole file with it; loading: whether the
    statement runs when the module is loaded, as a constant does or a default of an argument
    """

    file: str
    line: int
    first: int
    last: int
    operator: str
    before: str
    after: str
    source: str
    loading: bool = False

    def __str__(self) -> str:
        return f"{self.file}:{self.line}\n  - {self.before}\n  + {self.after}"


@dataclass(frozen=True)
class Place:
    """Where a file can be changed, and by what: (operator, occurrence in the file)."""

    file: str
    position: tuple[int, int]
    changes: tuple[tuple[str, int], ...]


def places(file: str, source: str) -> list[Place]:
    """Every place of a file, in order, that is more than an annotation or a look."""
    nodes, found = list(ast_nodes(get_ast(source))), defaultdict(list)
    apart = list(_apart(ast.parse(source)))
    for name, operator in operators().items():
        every = (start for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, start in enumerate(every):
            if not any(first <= start < last for first, last in apart):
                found[start].append((name, occurrence))
    return [Place(file, at, tuple(found[at])) for at in sorted(found)]


def draw(sources: Mapping[str, str], seed: int, number: int | None = None) -> Iterator[Mutant]:
    """`number` mutants of the files (path -> source), or one of every place, in random order.

    Every place has the same chance, however many changes there are of it: one is drawn.
    """
    chance = random.Random(seed)
    every = [place for file in sorted(sources) for place in places(file, sources[file])]
    chance.shuffle(every)
    for place in every[:number]:
        operator, occurrence = chance.choice(place.changes)
        if mutant := change(place, sources[place.file], operator, occurrence):
            yield mutant


def change(place: Place, source: str, operator: str, occurrence: int) -> Mutant | None:
    """The mutant, or None where there is no such change or it is no Python (`**` of a call)."""
    try:
        mutated = mutate_code(source, operators()[operator], occurrence)
    except AttributeError:  # cosmic-ray finds `except struct.error`, and cannot replace it
        return None
    if mutated is None or not _code(mutated):
        return None
    pairs = zip(source.split("\n"), mutated.split("\n"), strict=False)
    before, after = next((a, b) for a, b in pairs if a != b)
    tree, line = ast.parse(source), place.position[0]
    first, last = _statement(tree, line)
    text = before.strip(), after.strip()
    return Mutant(place.file, line, first, last, operator, *text, mutated, _loading(tree, line))


def _loading(tree: ast.AST, line: int) -> bool:
    functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))
    return not any(one.body[0].lineno <= line <= (one.end_lineno or 0) for one in functions)


def _code(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def _apart(tree: ast.AST) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Where annotations, `if TYPE_CHECKING` and looks begin and end: (line, column) twice."""
    for node in ast.walk(tree):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.keyword) and node.arg in LOOKS | PROMISES:
            parts.append(node.value)
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") in PATTERNS:
            parts.append(node.value)
        if isinstance(node, ast.Dict):
            pairs = zip(node.keys, node.values, strict=True)
            parts += [value for key, value in pairs if getattr(key, "value", None) in LOOKS]
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            parts += [*node.args, *(k.value for k in node.keywords)] if called in LAYOUTS else []
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            parts.append(node.test)
        for part in parts:
            if isinstance(part, ast.expr):
                end = (part.end_lineno or 0, part.end_col_offset or 0)
                yield (part.lineno, part.col_offset), end


def _statement(tree: ast.AST, line: int) -> tuple[int, int]:
    """First and last line of the smallest statement around a line; of a block, of its head."""
    found = (line, line)
    for node in ast.walk(tree):  # outer ones first
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if body else node.end_lineno or line
            if line <= max(last, node.lineno):
                found = (node.lineno, max(last, node.lineno))
    return found
