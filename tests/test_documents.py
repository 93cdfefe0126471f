"""The documents against what they speak of: tests with their tolerances, scripts, figures."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from .places import ROOT

DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "examples").glob("*/*.md")]
)
RESULTS, FIGURES = (ROOT / "docs" / "validation" / f"{name}.md" for name in ("results", "figures"))
#: "0.5 %", "1e-4", "0.03 mm".
TOLERANCE = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?(?:e-?\d+)?)( %)?(?![\w.])")
TEST = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")
#: What a tolerance is called where it is not compared with.
NAMES = {"rel", "abs", "rtol", "atol", "tolerance"}


def verified() -> list[tuple[str, str, str]]:
    """What, within and asserted by of every row of the table of results."""
    section = RESULTS.read_text().split("\n## Verified against\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    assert rows[0] == ["what", "against", "within", "asserted by"]
    return [(f"{what}, {against}", within, by) for what, against, within, by in rows[1:]]


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def definition(path: Path, name: str) -> tuple[ast.AST, Path] | None:
    """The function or constant `name` of a module of tests, also where it is imported from."""
    for node in parsed(path).body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return node, path
        if isinstance(node, ast.Assign) and name in [ast.unparse(t) for t in node.targets]:
            return node, path
        if isinstance(node, ast.ImportFrom) and node.level and node.module:
            if name in [a.name for a in node.names]:
                beside = path.parents[node.level - 1].joinpath(*node.module.split("."))
                return definition(beside.with_suffix(".py"), name)
    return None


def tolerances(node: ast.AST, path: Path, deep: int = 2) -> Iterator[float]:
    """Numbers that a test compares with, or gives as tolerance; of what it calls, likewise."""
    if isinstance(node, ast.Assign):
        yield from numbers(node.value)
    for part in ast.walk(node):
        if isinstance(part, ast.Compare):
            yield from numbers(part)
        elif isinstance(part, ast.keyword) and part.arg in NAMES:
            yield from numbers(part.value)
        elif isinstance(part, ast.FunctionDef):
            named = part.args.args[::-1], part.args.defaults[::-1]
            yield from (
                number
                for argument, default in zip(*named, strict=False)
                if argument.arg in NAMES
                for number in numbers(default)
            )
            yield from (n for d in part.decorator_list for n in numbers(d))
        elif isinstance(part, ast.Name) and deep:
            found = definition(path, part.id)
            if found is not None and found[0] is not node:
                yield from tolerances(*found, deep - 1)


def numbers(node: ast.AST) -> Iterator[float]:
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and isinstance(part.value, float):
            yield part.value


@pytest.mark.parametrize(("what", "within", "by"), verified(), ids=[row[0] for row in verified()])
def test_a_row_of_the_results_is_asserted_with_its_tolerance(what, within, by):
    tests = TEST.findall(by)
    assert tests, f"{what}: names no test"
    asserted = set()
    for place, name in tests:
        found = definition(ROOT / place, name)
        assert found is not None, f"{place} has no {name}"
        asserted |= set(tolerances(*found))
    said = [
        float(number) / (100 if percent else 1) for number, percent in TOLERANCE.findall(within)
    ]
    assert said, f"{what}: says no tolerance"
    for number in said:
        close = [a for a in asserted if a == pytest.approx(number, rel=1e-9)]
        assert close, f"{what}: {number:g} is not in {by}"


def scripts() -> set[str]:
    """The benchmarks that are commands: what they share is imported from others."""
    everything = (ROOT / "benchmarks").rglob("*.py")
    return {str(path.relative_to(ROOT)) for path in everything if "__main__" in path.read_text()}


def test_every_script_that_a_document_names_exists():
    for document in DOCUMENTS:
        for name in re.findall(r"(?:benchmarks|tests|solvers)/[\w/]+\.py", document.read_text()):
            assert (ROOT / name).is_file(), f"{document.relative_to(ROOT)} names {name}"


def test_every_benchmark_has_its_figures():
    """The list of figures names each script, and no other."""
    named = set(re.findall(r"benchmarks/[\w/]+\.py", FIGURES.read_text()))
    assert named == scripts()


#: A number with a percent sign, or a number of times: a share that somebody has typed.
TYPED = re.compile(r"\d\s?%|\d\s(?:per cent|percent|times)\b")
#: Rooms of the product, in which no message says what was measured elsewhere.
OUTSIDE = {"tests", "benchmarks", "docs", "examples", ".venv", "build", "out"}


def messages() -> Iterator[tuple[str, str]]:
    """Every string of the product that is no docstring, and every line of its templates."""
    for path in sorted(ROOT.rglob("*.py")):
        room = path.relative_to(ROOT)
        if room.parts[0] in OUTSIDE:
            continue
        tree = parsed(path)
        apart = set()  # docstrings, and formats of what is computed, such as ".0%"
        for node in ast.walk(tree):
            if isinstance(node, ast.Expr):
                apart.add(id(node.value))
            elif isinstance(node, ast.FormattedValue) and node.format_spec is not None:
                apart.update(id(part) for part in ast.walk(node.format_spec))
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                if id(node) not in apart:
                    yield f"{room}:{node.lineno}", node.value
    for path in sorted((ROOT / "templates").rglob("*.*")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            tags = re.sub(r"\{%.*?%\}|\{\{.*?\}\}|:\s*\d+%;", "", line)
            yield f"{path.relative_to(ROOT)}:{number}", tags


def test_no_message_says_a_share_that_is_not_measured_there():
    """A share in a message ("off by 56 %") would be right for one example at best."""
    typed = [f"{place}: {text.strip()}" for place, text in messages() if TYPED.search(text)]
    assert typed == []
