"""No package imports from one above it, in the order of docs/reference/walk.md, and no cycles."""

import ast
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

from .support.paths import ROOT, product_modules

#: From the lowest; those of a line do not depend on each other's order.
LAYERS = (
    {"light_dataclasses", "interrupts", "presenting", "processes", "version", "wording"},
    {"errors", "lazy_modules"},
    {"arguments", "plugins", "storage"},
    {"compilation", "notes"},
    {"readers"},
    {"materials"},
    {"meshes"},
    {"solvers"},
    {"inference"},
    {"experiments"},
    {"project"},
    {"runs"},
    {"reports"},
    {"cli"},
)
LEVELS = {name: level for level, names in enumerate(LAYERS) for name in names}


#: What is no part of the product, or stands above all layers.
OUTSIDE = {"__init__", "__main__", "benchmarks", "docs", "examples", "setup", "tests"}


def top(path: Path) -> str:
    """Return the package or module below the root that a file belongs to."""
    return path.parts[0].removesuffix(".py")


def modules() -> dict[Path, ast.Module]:
    """Return the modules of the product by path, without those above all layers."""
    return {path: tree for path, tree in product_modules().items() if top(path) in LEVELS}


def imported(path: Path) -> Iterator[str]:
    """Yield names of ours that a module imports anywhere, those for types included: "readers.x"."""
    package = ("bubblefit", *path.parent.parts)
    for node in ast.walk(product_modules()[path]):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*parents, *filter(None, [node.module])])
            names = [f"{module}.{alias.name}" for alias in node.names]
        for name in names:
            package_name, _, inside = name.partition(".")
            if package_name == "bubblefit":
                yield inside


def test_every_package_has_a_layer():
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    tops = {*packages, *(path.stem for path in ROOT.glob("*.py"))}
    assert tops - OUTSIDE == set(LEVELS)


def test_no_package_imports_from_above():
    upward = [
        f"{path} imports {name}"
        for path in modules()
        for name in imported(path)
        if LEVELS.get(name.partition(".")[0], 0) > LEVELS[top(path)]
    ]
    assert upward == []


def test_no_module_is_part_of_an_import_cycle():
    names = {
        ".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in modules()
    }
    graph = {}
    for module, path in names.items():
        # A name is a module, or something in one.
        targets = {n if n in names else n.rpartition(".")[0] for n in imported(path)}
        graph[module] = targets & (names.keys() - {module})
    TopologicalSorter(graph).prepare()  # raises CycleError


def test_no_module_below_names_a_presenter_in_a_string():
    words = [
        f"{path} names {node.value}"
        for path, tree in modules().items()
        if top(path) not in ("reports", "cli")
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.startswith("bubblefit.reports")
    ]
    assert words == []


def test_modules_named_in_the_walk_exist():
    pages = ROOT / "docs" / "reference" / "walk.md", ROOT / "benchmarks" / "walk.md"
    walk = "".join(page.read_text("utf-8") for page in pages)
    named = set(re.findall(r"`([\w/]+\.(?:py|html\.j2|bib\.j2))`", walk))
    assert len(named) > 100
    missing = [name for name in named if not (ROOT / name).is_file() and "bench_" not in name]
    assert not missing
