"""The list of faults, and what putting one in means."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

TABLE = Path(__file__).parent / "escaped.toml"
#: Folders whose modules are no part of the product.
APART = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist", "__pycache__"}


@dataclass(frozen=True)
class Fault:
    """One fault: the text `before` of `file`, there once, becomes `after`; `tests` then fail.

    file : below the repository. Where the text is no longer in it, the module may have moved: the
        only module of the product that has the text, once, takes its place; of several the only
        one of the same file name.
    tests : as pytest names them, each of which fails.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]

    def found(self, root: Path) -> Path:
        """Return the module below `root` that has the text.

        Raises
        ------
        ValueError : none has it, or it is there more than once.
        """
        path, name = root / self.file, Path(self.file).name
        times = {path: path.read_text("utf-8").count(self.before)} if path.exists() else {}
        if not any(times.values()):
            times = {path: path.read_text("utf-8").count(self.before) for path in _modules(root)}
        having = {path: count for path, count in times.items() if count}
        if len(having) > 1:
            alike = {path: count for path, count in having.items() if path.name == name}
            having = alike or having
        if list(having.values()) != [1]:
            where = {path.relative_to(root).as_posix(): count for path, count in having.items()}
            raise ValueError(f"{self.name}: {self.before!r} is there {where or 'nowhere'}")
        return next(iter(having))

    def put_in(self, root: Path) -> None:
        """Change the module below `root` that has the text; ValueError as `found`."""
        path = self.found(root)
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(self.before, self.after), encoding="utf-8")


def _modules(root: Path) -> list[Path]:
    """Return the modules of the product, in order."""
    every = ((path, path.relative_to(root).parts) for path in root.rglob("*.py"))
    return sorted(p for p, parts in every if not ({*parts} & APART or parts[0].startswith(".")))


def faults() -> list[Fault]:
    """Return all, in the order of the file."""
    content = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return [Fault(**{**entry, "tests": tuple(entry["tests"])}) for entry in content["fault"]]
