"""Which files the frames of a test are: files in order, or quoted patterns sorted by number."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from ..notes import Note, NoteKind


def frame_files(
    given: Sequence[str], field: str = "files", folder: Path | None = None
) -> tuple[list[Path], Note | None]:
    """The files, and a note where their order looks unmeant.

    given : names of files, taken in this order, and patterns, whose files are sorted by the
        numbers in their names (frame 2 before frame 10).
    field : what complaints call them.
    folder : where they are; the working folder unless given.

    Raises
    ------
    InputError : a pattern that nothing matches, no such file, a folder, a file given twice.
    """
    files: list[Path] = []
    for own in given:
        name = own if folder is None else str(folder / own)
        if not os.path.exists(name) and glob.has_magic(name):
            # The folder's own name is no pattern.
            wanted = own if folder is None else str(Path(glob.escape(str(folder))) / own)
            found = [Path(f) for f in glob.glob(wanted, recursive=True) if not Path(f).is_dir()]
            if not found:
                raise InputError(None, field, f"no file matches {name!r}")
            files += sorted(found, key=_numbers)
        elif os.path.isdir(name):
            problem = f"expected files; quote a pattern such as {str(Path(name) / '*.csv')!r}"
            raise InputError(name, field, f"is a folder, {problem}")
        else:
            files.append(Path(name))
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError(file, field, "is given twice")
    plain = [str(name if folder is None else folder / name) for name in given]
    return files, _shell_order(files) if list(map(str, files)) == plain else None


def _numbers(file: Path) -> list[tuple[bool, int, str]]:
    """Sorts digits as numbers, and numbers before letters."""
    parts = re.findall(r"\d+|\D+", str(file))
    return [(not p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts]


def _shell_order(files: list[Path]) -> Note | None:
    """A shell sorts frame_10 before frame_2: perhaps not the order of the test."""
    by_number = sorted(files, key=_numbers)
    if by_number == files or sorted(files, key=str) != files:
        return None
    first, second = next((a, b) for a, b in zip(files, by_number, strict=True) if a != b)
    words = (
        f"frames in the order given: {first.name} before {second.name}; quote the pattern to have"
        " them by number"
    )
    return Note(NoteKind.ORDER, words)
