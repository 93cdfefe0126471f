"""Where things are, for all tests."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"
#: Tables of published numbers, with their sources.
PUBLISHED = ROOT / "runs" / "verification" / "published"
#: Measured data beside the repository.
SHARED = ROOT.parent / "shared" / "data"
#: Folders of the repository that are no part of the package.
NOT_THE_PRODUCT = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist"}


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
    return {path: ast.parse((ROOT / path).read_text(encoding="utf-8")) for path in modules}
