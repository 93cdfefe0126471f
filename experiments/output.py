"""The files that a test writes below the output folder."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from ..lazy_modules import pandas as pd
from ..storage.writing import replacing

#: A file below the output folder, and its caption or what it is.
Shown = tuple[str, str]


@dataclass(frozen=True)
class Output:
    """The place where a test writes: below `folder`, names with `prefix`."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Return the output of a test; its name stands before every file's if there are several.

        What does not belong in the name of a file becomes a dash; digits tell such names apart.
        """
        max_bytes = 80
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:max_bytes].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain = f"{plain}-{hashlib.sha256(test.encode()).hexdigest()[:6]}".strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """Return the file's name below the folder."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """Return the file."""
        return self.folder / self.name(file)

    def write(
        self, file: str, table: pd.DataFrame, description: str = "", digits: str | None = "%.9g"
    ) -> Shown:
        """Write a table as CSV; return the file and its description."""
        with replacing(self.path(file)) as path:
            table.to_csv(path, index=False, float_format=digits)
        return self.name(file), description
