"""python tests/mirror.py: print the long modules that have no test file of their name.

What `runs/folder.py` does is specified by `tests/runs/test_folder.py`, what the package
`experiments/bending` does by `tests/experiments/test_bending.py`, and `notes.py` by
`tests/test_notes.py`. A module of more than 100 lines is long.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Folders of the repository that are no part of the package.
NOT_THE_PRODUCT = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist"}
#: Modules of more lines than this have a test file of their name.
MAX_LINES = 100
#: Modules that have none, and the tests that specify them instead.
REASONS = {}


def test_file_of(module: Path) -> Path:
    """Return the test file of a module of the product, both below the root."""
    package, name = module.parent, module.stem
    if name == "__init__":
        package, name = (package.parent, package.name) if package.parts else (package, "bubblefit")
    return Path("tests") / package / f"test_{name}.py"


def long_modules(root: Path = ROOT) -> list[Path]:
    """Return the modules of the product of more than `MAX_LINES` lines, below the root."""
    modules = []
    for path in sorted(root.rglob("*.py")):
        module = path.relative_to(root)
        apart = module.parts[0] in NOT_THE_PRODUCT or module.parts[0].startswith(".")
        if not apart and module.parts != ("setup.py",):
            if len(path.read_text(encoding="utf-8").splitlines()) > MAX_LINES:
                modules.append(module)
    return modules


def modules_without_tests(root: Path = ROOT) -> list[Path]:
    """Return the long modules that have no test file of their name, with or without a reason."""
    return [module for module in long_modules(root) if not (root / test_file_of(module)).is_file()]


def main() -> None:
    missing = modules_without_tests()
    for module in missing:
        print(f"{module.as_posix()}: {REASONS.get(module.as_posix(), 'no reason')}")
    print(f"{len(missing)} of {len(long_modules())} modules of more than {MAX_LINES} lines")


if __name__ == "__main__":
    main()
