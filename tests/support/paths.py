"""Places in the repository, its modules, and its scripts as modules."""

import ast
import importlib.util
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"
#: Tables of published numbers, with their sources.
PUBLISHED = ROOT / "runs" / "verification" / "published"
#: Measured data beside the repository.
SHARED = ROOT.parent / "shared" / "data"
#: Folders of the repository that are no part of the package.
NOT_THE_PRODUCT = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist"}


@cache
def syntax_tree(path):
    """Return the syntax tree of a module, which is parsed once in a run."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def product_modules():
    """Return the syntax tree of each module of the product by its path below the root."""
    paths = (path.relative_to(ROOT) for path in sorted(ROOT.rglob("*.py")))
    modules = [
        path
        for path in paths
        if path.parts[0] not in NOT_THE_PRODUCT
        and path.parts != ("setup.py",)
        and not path.parts[0].startswith(".")
    ]
    return {path: syntax_tree(ROOT / path) for path in modules}


def load_script(place):
    path = ROOT / place
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Where a dataclass looks for its names, and pickle for its functions.
    sys.modules[spec.name] = module
    # As where it is run: modules beside it are found.
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module
