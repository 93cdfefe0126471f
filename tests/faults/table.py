"""The list of faults, and what putting one in means."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

TABLE = Path(__file__).parent / "escaped.toml"


@dataclass(frozen=True)
class Fault:
    """One fault: the text `before` of `file`, there once, becomes `after`; `tests` then fail.

    file : below the repository. tests : as pytest names them, each of which fails.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]

    def put_in(self, root: Path) -> None:
        """Change the file below `root`.

        Raises
        ------
        ValueError : the text is not there, or more than once.
        """
        path = root / self.file
        text = path.read_text(encoding="utf-8")
        if text.count(self.before) != 1:
            times = text.count(self.before)
            raise ValueError(f"{self.name}: {self.file} has {times} times {self.before!r}")
        path.write_text(text.replace(self.before, self.after), encoding="utf-8")


def faults() -> list[Fault]:
    """All, in the order of the file."""
    content = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return [Fault(**{**entry, "tests": tuple(entry["tests"])}) for entry in content["fault"]]
