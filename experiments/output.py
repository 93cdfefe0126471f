"""Names and places of the files that a test writes below the output folder of a run."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from ..lazy_modules import pandas as pd
from ..storage.writing import replacing

#: The name of a file below the output folder, and its caption or description.
Shown = tuple[str, str]


@dataclass(frozen=True)
class Output:
    """The place where a test writes: files below `folder`, whose names begin with `prefix`."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Return the output of a test; with several tests, its name begins that of every file.

        Characters that do not belong in the name of a file become dashes; six digits of a checksum
        keep such names apart. test : name of the test.
        """
        max_bytes = 80
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:max_bytes].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain = f"{plain}-{hashlib.sha256(test.encode()).hexdigest()[:6]}".strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """Return the name of a file below the folder, with the prefix."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """Return the path of a file, with the prefix."""
        return self.folder / self.name(file)

    def write(
        self, file: str, table: pd.DataFrame, description: str = "", digits: str | None = "%.9g"
    ) -> Shown:
        """Write a table as CSV; return the name of the file and its description.

        digits : format of numbers; None writes all digits.
        """
        with replacing(self.path(file)) as path:
            table.to_csv(path, index=False, float_format=digits)
        return self.name(file), description
