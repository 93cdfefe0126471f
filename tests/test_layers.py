"""No package imports from one above it, in the order of docs/reference/walk.md, and no cycles."""

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import bubblefit as bf

ROOT = Path(bf.__file__).resolve().parent
#: From the lowest; those of a line do not depend on each other's order.
LAYERS = (
    {"errors", "interrupts", "lazy_modules", "presenting", "processes", "version", "wording"},
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


def modules() -> Iterator[Path]:
    """Yield the files of the product, without those that stand above all layers."""
    for path in sorted(ROOT.rglob("*.py")):
        if path.relative_to(ROOT).parts[0].removesuffix(".py") in LEVELS:
            yield path


def imported(path: Path) -> Iterator[str]:
    """Yield names of ours that a module imports anywhere, those for types included: "readers.x"."""
    package = ("bubblefit", *path.relative_to(ROOT).parent.parts)
    for node in ast.walk(ast.parse(path.read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*parents, *filter(None, [node.module])])
            names = [f"{module}.{alias.name}" for alias in node.names]
        for name in names:
            top, _, inside = name.partition(".")
            if top == "bubblefit":
                yield inside


def test_every_package_has_a_layer():
    tops = {path.relative_to(ROOT).parts[0].removesuffix(".py") for path in modules()}
    assert tops == set(LEVELS)


def test_no_package_imports_from_above():
    upward = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules()
        for name in imported(path)
        if LEVELS.get(name.partition(".")[0], 0)
        > LEVELS[path.relative_to(ROOT).parts[0].removesuffix(".py")]
    ]
    assert upward == []


def test_no_module_is_part_of_an_import_cycle():
    names = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in modules()
    }
    graph = {}
    for module, path in names.items():
        # A name is a module, or something in one.
        targets = {n if n in names else n.rpartition(".")[0] for n in imported(path)}
        graph[module] = targets & (names.keys() - {module})
    TopologicalSorter(graph).prepare()  # raises CycleError


def test_no_module_below_names_a_presenter_in_a_string():
    words = [
        f"{path.relative_to(ROOT)} names {node.value}"
        for path in modules()
        if path.relative_to(ROOT).parts[0] not in ("reports", "cli")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.startswith("bubblefit.reports")
    ]
    assert words == []
